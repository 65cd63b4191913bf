/** Shows the notifications of the page where only a worker may, and opens the page at a touch. */

addEventListener('notificationclick', (event) => {
  const {hash = ''} = event.notification.data || {};
  event.notification.close();
  event.waitUntil((async () => {
    const [page] = await clients.matchAll({type: 'window', includeUncontrolled: true});
    if (!page) {
      await clients.openWindow(`/${hash}`);
      return;
    }
    page.postMessage({kind: 'go', hash});
    await page.focus();
  })());
});

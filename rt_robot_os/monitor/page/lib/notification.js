// @ts-check
/**
 * Notifications of the desktop or of a phone. Android allows them to a service worker only, where
 * the constructor throws; so the worker shows them wherever there is one.
 */

const WORKER = '/notification_worker.js';

/** Whether this page may show any: 'missing', 'denied', 'ask' or 'granted'. */
export function permission() {
  if (!('Notification' in window) || !window.isSecureContext) {
    return 'missing';
  }
  return {granted: 'granted', denied: 'denied'}[Notification.permission] || 'ask';
}

/** Ask the reader, and prepare the worker. @returns {Promise<boolean>} whether they can be shown */
export async function prepare() {
  if (permission() === 'missing' || await Notification.requestPermission() !== 'granted') {
    return false;
  }
  return await registered(true) !== null || constructs();
}

/**
 * Show one.
 * @param {string} title
 * @param {{body: string, tag: string, renotify?: boolean, requireInteraction?: boolean}} options
 * @param {string} [hash] which view a touch opens; none: the page as it is
 * @returns {Promise<?{close: function(): void}>} null: the browser shows none
 */
export async function notify(title, options, hash = '') {
  if (permission() !== 'granted') {
    return null;
  }
  const worker = await registered(false);
  if (worker) {
    return byWorker(worker, title, {...options, data: {hash}});
  }
  try {
    const made = new Notification(title, options);
    made.onclick = () => {
      window.focus();
      location.hash = hash || location.hash;
      made.close();
    };
    return made;
  } catch (error) {
    return null;
  }
}

async function byWorker(worker, title, options) {
  try {
    await worker.showNotification(title, options);
  } catch (error) {
    return null;
  }
  return {async close() {
    const shown = await worker.getNotifications({tag: options.tag});
    shown.forEach((each) => each.close());
  }};
}

/** The registration of the worker, or null. */
async function registered(isNew) {
  const {serviceWorker} = navigator;
  if (!serviceWorker) {
    return null;
  }
  try {
    if (isNew) {
      await serviceWorker.register(WORKER);
      return await serviceWorker.ready;
    }
    const found = await serviceWorker.getRegistration('/');
    return found?.active ? found : null;
  } catch (error) {
    return null; // such as a certificate that the browser does not trust
  }
}

/** Whether the constructor works: it throws on Android. */
function constructs() {
  try {
    new Notification('', {silent: true, tag: 'probe'}).close();
    return true;
  } catch (error) {
    return false;
  }
}

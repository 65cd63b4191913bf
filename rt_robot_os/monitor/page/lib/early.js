// @ts-check
// Runs before the first paint, so that neither theme nor language flickers.
(function early() {
  let theme = null;
  let language = null;
  try {
    theme = localStorage.getItem('theme');
    language = localStorage.getItem('language');
  } catch (error) {
    // Storage is switched off: the system's choice holds.
  }
  const root = document.documentElement;
  if (theme === 'light' || theme === 'dark') {
    root.dataset.theme = theme;
  }
  root.lang = language || (navigator.language || 'en').slice(0, 2);
})();

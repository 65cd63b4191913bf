// @ts-check
/** Short messages at the foot of the page, with something to do about them if need be. */

import {h} from './dom.js';

const SHOWN_MS = 7000;
// More at a time hide the page.
const MOST = 4;
// What is about to be said, by the place where it will be.
const said = new Map();

/**
 * Show a message.
 * @param {string | Node} text
 * @param {{kind?: string, action?: ?HTMLElement, shownMs?: number}} [how] kind: ok, warn, error
 * @returns {function(): void} take it away
 */
export function toast(text, how = {}) {
  const place = document.getElementById('toasts');
  const made = h(`div.toast.toast-${how.kind || 'ok'}`, h('span.toast-text', text), how.action);
  let timer = 0;
  const close = () => {
    clearTimeout(timer);
    made.remove();
  };
  // Whoever reads or writes in it is not to be hurried.
  const wait = () => {
    clearTimeout(timer);
    timer = setTimeout(() => (made.matches(':hover, :focus-within') ? wait() : close()),
      how.shownMs || SHOWN_MS);
  };
  place.append(made);
  while (place.children.length > MOST) {
    place.firstChild.remove();
  }
  wait();
  return close;
}

/** Say something to screen readers only; now interrupts what is being read. */
export function announce(text, isNow = false) {
  const place = document.getElementById(isNow ? 'say-now' : 'say-later');
  place.textContent = '';
  // A change is read out, the same text again is not.
  clearTimeout(said.get(place));
  said.set(place, setTimeout(() => {
    place.textContent = text;
  }, 50));
}

/** Remove all messages: after signing out nothing that they name is there to be read. */
export function clearMessages() {
  document.getElementById('toasts').replaceChildren();
  for (const id of ['say-now', 'say-later']) {
    const place = document.getElementById(id);
    clearTimeout(said.get(place));
    place.textContent = '';
  }
}

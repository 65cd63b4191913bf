// @ts-check
/**
 * Driving with keys: closed while the space bar is held; arrows or W, A, S, D say where to.
 *
 * What has the focus and takes keys itself (fields, buttons, dialogs) keeps them.
 */

export const DEAD_MAN = 'Space';
const TO = {
  ArrowUp: [0, 1], KeyW: [0, 1],
  ArrowDown: [0, -1], KeyS: [0, -1],
  ArrowLeft: [-1, 0], KeyA: [-1, 0],
  ArrowRight: [1, 0], KeyD: [1, 0],
};
const TAKES_KEYS = 'input, select, textarea, button, a[href], summary, dialog, [contenteditable]';

export class Keys {
  /**
   * @param {import('./hand.js').Hand} hand it drives
   */
  constructor(hand) {
    this.name = 'keys';
    this.hand = hand;
    this.held = new Set();
    this.ondown = (event) => this.down(event);
    this.onup = (event) => this.up(event);
    this.onfocus = (event) => takesKeys(event.target) && this.clear();
    addEventListener('keydown', this.ondown);
    addEventListener('keyup', this.onup);
    addEventListener('focusin', this.onfocus);
    hand.add(this);
  }

  read() {
    if (!this.held.has(DEAD_MAN)) {
      return null;
    }
    const sum = [...this.held].map((code) => TO[code] || [0, 0])
      .reduce((a, b) => [a[0] + b[0], a[1] + b[1]], [0, 0]);
    return {x: Math.sign(sum[0]), y: Math.sign(sum[1])};
  }

  letGo() {
    // Keys that are still down tell so again by repeating, which does not count.
    this.held.clear();
  }

  clear() {
    this.held.clear();
    this.hand.changed();
  }

  down(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) {
      this.clear();
      return;
    }
    if (!isOurs(event.code) || takesKeys(event.target)) {
      return;
    }
    event.preventDefault();
    if (!event.repeat) {
      this.held.add(event.code);
      this.hand.changed();
    }
  }

  up(event) {
    if (this.held.delete(event.code)) {
      event.preventDefault();
      this.hand.changed();
    }
  }

  end() {
    removeEventListener('keydown', this.ondown);
    removeEventListener('keyup', this.onup);
    removeEventListener('focusin', this.onfocus);
    this.held.clear();
  }
}

function isOurs(code) {
  return code === DEAD_MAN || code in TO;
}

function takesKeys(element) {
  return element instanceof Element && element.closest(TAKES_KEYS) !== null
    || document.querySelector('dialog[open]') !== null;
}

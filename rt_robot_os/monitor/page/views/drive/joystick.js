// @ts-check
/** The joystick on the screen: closed while a finger or the mouse's button is down on it. */

import {h} from '../../lib/dom.js';

// Of the pad's radius: how far the knob goes.
const REACH = 0.62;

/**
 * Make a joystick.
 * @param {import('./hand.js').Hand} hand it drives
 * @param {string} label for screen readers
 * @returns {{element: HTMLElement, show: function(number, number, boolean): void}}
 */
export function joystick(hand, label) {
  const knob = h('span.stick-knob');
  const element = h('div.stick', {tabindex: '0', role: 'application', 'aria-label': label},
    h('span.stick-cross', {'aria-hidden': 'true'}), knob);
  const source = new Pointer(element, hand);
  hand.add(source);
  const show = (x, y, isClosed) => {
    element.classList.toggle('is-closed', isClosed);
    knob.style.setProperty('--x', (x * REACH).toFixed(3));
    knob.style.setProperty('--y', (-y * REACH).toFixed(3));
  };
  return {element, show};
}

class Pointer {
  constructor(element, hand) {
    this.name = 'stick';
    this.element = element;
    this.hand = hand;
    this.pointer = null;
    this.at = null;
    element.onpointerdown = (event) => this.down(event);
    element.onpointermove = (event) => this.move(event);
    element.onpointerup = (event) => this.up(event, 'open');
    element.onpointercancel = (event) => this.up(event, 'pointer');
    element.onlostpointercapture = (event) => this.up(event, 'pointer');
    element.oncontextmenu = (event) => event.preventDefault();
  }

  read() {
    return this.at;
  }

  letGo() {
    const pointer = this.pointer;
    this.pointer = this.at = null;
    if (pointer !== null && this.element.hasPointerCapture(pointer)) {
      this.element.releasePointerCapture(pointer);
    }
  }

  down(event) {
    if (this.pointer !== null || event.button !== 0) {
      return;
    }
    event.preventDefault();
    this.element.focus({preventScroll: true});
    this.pointer = event.pointerId;
    try {
      this.element.setPointerCapture(event.pointerId);
    } catch (error) {
      // It is up again already; its end comes all the same.
    }
    this.hand.changed();
    this.take(event);
  }

  move(event) {
    if (event.pointerId !== this.pointer) {
      return;
    }
    if (event.pointerType === 'mouse' && !(event.buttons & 1)) {
      // The button came up where nobody told: over another window.
      this.up(event, 'pointer');
      return;
    }
    this.take(event);
  }

  up(event, why) {
    if (event.pointerId !== this.pointer) {
      return;
    }
    this.pointer = this.at = null;
    if (why === 'open') {
      this.hand.changed();
    } else {
      this.hand.letGo(why);
    }
  }

  take({clientX, clientY}) {
    const box = this.element.getBoundingClientRect();
    const reach = (Math.min(box.width, box.height) / 2) * REACH || 1;
    this.at = {x: (clientX - box.left - box.width / 2) / reach,
      y: (box.top + box.height / 2 - clientY) / reach};
    this.hand.changed();
  }
}

// @ts-check
/**
 * Wheel, drag, pinch and keys over a stack of plots, turned into what is shown of time.
 *
 * Mouse: the wheel zooms over a plot, drag chooses a range, drag with Shift moves. Touch: one
 * finger moves, two zoom.
 */

const WHEEL_STEP = 1.0018;
const LEAST_DRAG_PX = 6;

export class Gestures {
  /**
   * @param {HTMLElement} area of the plots.
   * @param {import('./timeline.js').Timeline} timeline
   * @param {Object} asks
   * @param {() => {left: number, width: number}} asks.box where times are, in CSS pixels of `area`.
   * @param {(x: number | null) => void} asks.cursor it is there, or nowhere.
   * @param {(from: number, to: number | null) => void} asks.choose so much is chosen; null: done.
   * @param {() => void} asks.before what is shown is about to change.
   */
  constructor(area, timeline, asks) {
    this.area = area;
    this.timeline = timeline;
    this.asks = asks;
    this.fingers = new Map();
    this.drag = null;
    this.heard = new AbortController();
    const {signal} = this.heard;
    const on = (name, hear, options) => area.addEventListener(name, hear.bind(this),
      {signal, ...options});
    on('wheel', this._wheel, {passive: false});
    on('pointerdown', this._down);
    on('pointermove', this._move);
    on('pointerup', this._up);
    on('pointercancel', this._cancel);
    on('pointerleave', () => asks.cursor(null));
    on('dblclick', (event) => {
      asks.before();
      timeline.zoom(2, this.timeAt(event));
    });
  }

  close() {
    this.heard.abort();
  }

  /** @return the time at a place of the screen, in ms. */
  timeAt({clientX}) {
    const {left, width} = this.asks.box();
    const x = clientX - this.area.getBoundingClientRect().left - left;
    return this.timeline.start + (x / width) * this.timeline.span;
  }

  _x({clientX}) {
    return clientX - this.area.getBoundingClientRect().left;
  }

  _wheel(event) {
    // Beside the plots the page scrolls.
    if (this._x(event) < this.asks.box().left) {
      return;
    }
    if (event.ctrlKey || Math.abs(event.deltaY) >= Math.abs(event.deltaX)) {
      // A page that scrolls goes on scrolling with Alt.
      if (event.altKey) {
        return;
      }
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 33 : 1;
      const factor = WHEEL_STEP ** (event.deltaY * lines * (event.ctrlKey ? 4 : 1));
      this.timeline.zoom(factor, this.timeAt(event));
    } else {
      event.preventDefault();
      this.timeline.pan(event.deltaX / this.asks.box().width);
    }
  }

  _down(event) {
    if (event.button !== 0 || event.target.closest('button, a, input, select')) {
      return;
    }
    this.fingers.set(event.pointerId, event.clientX);
    this.area.setPointerCapture(event.pointerId);
    if (this.fingers.size === 1) {
      const moves = event.pointerType === 'touch' || event.shiftKey;
      this.drag = {x: this._x(event), moves, last: event.clientX};
    } else {
      this.drag = null;
    }
    this.asks.before();
  }

  _move(event) {
    this.asks.cursor(this._x(event));
    if (!this.fingers.has(event.pointerId)) {
      return;
    }
    if (this.fingers.size === 2) {
      this._pinch(event);
    } else if (this.drag && this.drag.moves) {
      this.timeline.pan((this.drag.last - event.clientX) / this.asks.box().width);
      this.drag.last = event.clientX;
    } else if (this.drag) {
      this.asks.choose(this.drag.x, this._x(event));
    }
    this.fingers.set(event.pointerId, event.clientX);
  }

  _pinch(event) {
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
    const before = Math.abs(this.fingers.get(event.pointerId) - other);
    const now = Math.abs(event.clientX - other);
    if (before > 10 && now > 10) {
      this.timeline.zoom(before / now, this.timeAt({clientX: (event.clientX + other) / 2}));
    }
  }

  _up(event) {
    const {drag} = this;
    this._cancel(event);
    if (drag && !drag.moves && Math.abs(this._x(event) - drag.x) >= LEAST_DRAG_PX) {
      const {left, width} = this.asks.box();
      const at = (x) => this.timeline.start
        + (Math.min(width, Math.max(0, x - left)) / width) * this.timeline.span;
      const [from, to] = [at(drag.x), at(this._x(event))].sort((a, b) => a - b);
      this.timeline.show(from, to);
    }
  }

  _cancel(event) {
    this.fingers.delete(event.pointerId);
    this.drag = null;
    this.asks.choose(0, null);
  }
}

/** What keys do; @return whether the key was one of them. */
export function pressed(event, timeline, ranges) {
  const keys = {
    'ArrowLeft': () => timeline.pan(-0.1), 'ArrowRight': () => timeline.pan(0.1),
    'PageUp': () => timeline.pan(-0.9), 'PageDown': () => timeline.pan(0.9),
    '+': () => timeline.zoom(0.5), '=': () => timeline.zoom(0.5), '-': () => timeline.zoom(2),
    'End': () => timeline.follow(),
  };
  ranges.forEach(([, span], index) => {
    keys[String(index + 1)] = () => timeline.setSpan(span);
  });
  if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) {
    return false;
  }
  keys[event.key]();
  return true;
}

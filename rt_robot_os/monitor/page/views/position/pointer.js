// @ts-check
/** Pointers, wheel and keys over the map: move, zoom, and tap. */

const TAP_PX = 8;
const WHEEL_STEP = 1.0016;
const KEY_PX = 60;

export class Pointers {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import('./transform.js').Viewport} view
   * @param {Object} asks
   * @param {() => void} asks.moved what is shown has changed by hand.
   * @param {(x: number, y: number) => void} asks.tapped a place, in CSS pixels.
   * @param {(x: number, y: number) => ?function} asks.grabbed what drags from there; null: the map.
   */
  constructor(canvas, view, asks) {
    this.canvas = canvas;
    this.view = view;
    this.asks = asks;
    this.fingers = new Map();
    this.start = null;
    this.dragged = null;
    this.heard = new AbortController();
    const on = (name, hear, options) => canvas.addEventListener(name, hear.bind(this),
      {signal: this.heard.signal, ...options});
    on('pointerdown', this._down);
    on('pointermove', this._move);
    on('pointerup', this._up);
    on('pointercancel', this._up);
    on('wheel', this._wheel, {passive: false});
  }

  close() {
    this.heard.abort();
  }

  _at({clientX, clientY}) {
    const box = this.canvas.getBoundingClientRect();
    return [clientX - box.left, clientY - box.top];
  }

  _down(event) {
    if (event.button !== 0) {
      return;
    }
    const at = this._at(event);
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, at);
    if (this.fingers.size === 1) {
      this.start = at;
      this.dragged = this.asks.grabbed(at[0], at[1]);
    } else {
      this.start = null;
      this.dragged = null;
    }
  }

  _move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) {
      return;
    }
    const at = this._at(event);
    if (this.start && Math.hypot(at[0] - this.start[0], at[1] - this.start[1]) > TAP_PX) {
      this.start = null;
    }
    if (this.fingers.size === 2) {
      this._pinch(event.pointerId, before, at);
    } else if (this.dragged) {
      this.dragged(...at);
    } else if (!this.start) {
      this.view.pan(at[0] - before[0], at[1] - before[1]);
      this.asks.moved();
    } else {
      return;
    }
    this.fingers.set(event.pointerId, at);
  }

  _pinch(id, before, at) {
    const other = [...this.fingers].find(([each]) => each !== id)[1];
    const far = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    if (far(before) > 10) {
      this.view.pan((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
      this.view.zoom(far(at) / far(before), (at[0] + other[0]) / 2, (at[1] + other[1]) / 2);
      this.asks.moved();
    }
  }

  _up(event) {
    const {start, dragged} = this;
    this.fingers.delete(event.pointerId);
    this.start = null;
    this.dragged = null;
    if (event.type === 'pointerup' && start && !dragged) {
      this.asks.tapped(start[0], start[1]);
    }
  }

  _wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 33 : 1;
    this.view.zoom(WHEEL_STEP ** (-event.deltaY * lines * (event.ctrlKey ? 4 : 1)),
      ...this._at(event));
    this.asks.moved();
  }
}

/** What keys do on the map; @return whether the key was one of them. */
export function pressed(event, view) {
  const moves = {ArrowLeft: [KEY_PX, 0], ArrowRight: [-KEY_PX, 0], ArrowUp: [0, KEY_PX],
                 ArrowDown: [0, -KEY_PX]};
  if (event.ctrlKey || event.metaKey || event.altKey) {
    return false;
  }
  if (moves[event.key]) {
    view.pan(...moves[event.key]);
  } else if (event.key === '+' || event.key === '=') {
    view.zoom(1.4);
  } else if (event.key === '-') {
    view.zoom(1 / 1.4);
  } else {
    return false;
  }
  return true;
}

// @ts-check
/**
 * Which part of time is shown: one range for all plots, in ms of UTC.
 *
 * It follows the present or stands still. A zoom keeps the time under the cursor where it is.
 */

export const LEAST_MS = 1000;
export const MOST_MS = 366 * 86_400_000;
/** How much of the range lies in the future while it follows: so that the newest is seen. */
const AHEAD = 0.02;

export const RANGES = [
  ['1min', 60_000], ['10min', 600_000], ['1h', 3_600_000], ['8h', 28_800_000],
  ['1d', 86_400_000], ['1w', 604_800_000], ['1mo', 30 * 86_400_000], ['1y', 365 * 86_400_000],
];

export class Timeline {
  /** @param {() => number} now the present in ms, as the server has it. */
  constructor(now, span = 600_000) {
    this.now = now;
    this.follows = true;
    this.changed = () => {};
    this.end = now() + span * AHEAD;
    this.start = this.end - span;
  }

  get span() {
    return this.end - this.start;
  }

  /** Zoom by a factor (below 1: nearer); the time `at` stays where it is. */
  zoom(factor, at = this.follows ? this.now() : (this.start + this.end) / 2) {
    const span = clampSpan(this.span * factor);
    const part = (at - this.start) / this.span;
    this._show(at - part * span, span);
  }

  /** Move by a part of the range; more than 0 is later. */
  pan(part) {
    this._show(this.start + part * this.span, this.span);
  }

  /** Show a range. */
  show(start, end) {
    const span = clampSpan(end - start);
    this._show((start + end - span) / 2, span);
  }

  /** Show so much time: up to the present when it follows, else about its middle. */
  setSpan(span) {
    const wanted = clampSpan(span);
    if (this.follows) {
      this._put(wanted);
      this.changed();
    } else {
      this._show((this.start + this.end - wanted) / 2, wanted);
    }
  }

  /** Follow the present again. */
  follow() {
    this.follows = true;
    this._put(this.span);
    this.changed();
  }

  /** Move on with the present; no more often than a pixel's worth. @return whether it moved. */
  tick(pixels) {
    if (!this.follows) {
      return false;
    }
    const end = this.now() + this.span * AHEAD;
    if (Math.abs(end - this.end) < this.span / Math.max(1, pixels)) {
      return false;
    }
    this._put(this.span);
    return true;
  }

  _put(span) {
    this.end = this.now() + span * AHEAD;
    this.start = this.end - span;
  }

  _show(start, span) {
    const latest = this.now() + span * AHEAD;
    this.follows = start + span >= latest;
    this.end = this.follows ? latest : start + span;
    this.start = this.end - span;
    this.changed();
  }
}

/** @return the span within what can be shown. */
export function clampSpan(span) {
  return Math.min(MOST_MS, Math.max(LEAST_MS, span));
}

// @ts-check
/**
 * The history of signs: asked for when what is shown leaves what is known, or needs a finer one.
 *
 * A request covers half a range more on both sides: whoever moves a little waits for nothing.
 */

import {limitZone, styleOf} from './signs.js';

const MARGIN = 0.5;
const WAIT_MS = 50;
// What robots send later, after a lost connection, and alarms that end, come in by then.
const REFRESH_MS = 60_000;
const FINER = 1.6;
const LONGEST_WAIT_MS = 60_000;
const NS_PER_MS = 1e6;

export class History {
  /**
   * @param {import('../../lib/api.js').Api} api of the page.
   * @param {import('./timeline.js').Timeline} timeline
   * @param {(sign: string, chart: Object) => void} took gets what came.
   * @param {(error: Error | null) => void} failed
   */
  constructor(api, timeline, took, failed) {
    this.api = api;
    this.timeline = timeline;
    this.took = took;
    this.failed = failed;
    this.person = '';
    this.signs = [];
    this.pixels = 800;
    this.loaded = null;
    this.timer = 0;
    this.asked = 0;
    this.requests = 0;
    this.lastMs = 0;
    /** After a failure nothing is asked before that, by the page's clock. */
    this.notBefore = 0;
    this.failures = 0;
  }

  /** Show the signs of a person. */
  of(person, signs) {
    this.person = person;
    this.signs = signs;
    this.refresh();
  }

  /** Ask again, soon. */
  refresh(waitMs = 0) {
    this.loaded = null;
    this.notBefore = 0;
    clearTimeout(this.timer);
    this.timer = 0;
    this._soon(waitMs);
  }

  /** What is shown has changed. */
  look() {
    if (!this._isEnough()) {
      this._soon(WAIT_MS);
    }
  }

  close() {
    clearTimeout(this.timer);
    this.asked += 1;
  }

  _isEnough() {
    const {start, end, span, follows} = this.timeline;
    const {loaded} = this;
    if (!loaded) {
      return false;
    }
    const isFresh = !follows || performance.now() - this.lastMs < Math.max(REFRESH_MS, span / 100);
    const isCovered = start >= loaded.start && (end <= loaded.end || (follows && loaded.isNow));
    const finer = loaded.span / span;
    return isFresh && isCovered && finer < FINER && finer > 1 / FINER;
  }

  _soon(waitMs) {
    if (!this.timer) {
      this.timer = setTimeout(() => {
        this.timer = 0;
        this._ask();
      }, Math.max(waitMs, this.notBefore - performance.now()));
    }
  }

  async _ask() {
    const {start, end, span} = this.timeline;
    if (!this.person || (this.loaded && this._isEnough())) {
      return;
    }
    const mine = this.asked += 1;
    const now = this.timeline.now();
    const from = start - MARGIN * span;
    const to = Math.min(end + MARGIN * span, now + span * 0.1);
    this.loaded = {start: from, end: to, span, isNow: to >= now};
    this.lastMs = performance.now();
    const found = await Promise.allSettled(
      this.signs.map((sign) => this._one(sign, from, to, mine)));
    if (mine !== this.asked) {
      return;
    }
    const wrong = found.find((each) => each.status === 'rejected');
    this.failed(wrong ? wrong.reason : null);
    if (wrong) {
      this.loaded = null;
      this._backOff(wrong.reason);
    } else {
      this.failures = 0;
    }
    this.look();
  }

  /** What may be over soon is asked for again, ever more seldom; what is refused after a minute. */
  _backOff({status = 0}) {
    const isPassing = status === 0 || status === 429 || status >= 500;
    this.failures += 1;
    this.notBefore = performance.now() + (isPassing
      ? Math.min(LONGEST_WAIT_MS, 1000 * 2 ** this.failures) : LONGEST_WAIT_MS);
  }

  async _one(sign, from, to, mine) {
    const pixels = Math.round(this.pixels * ((to - from) / this.timeline.span));
    this.requests += 1;
    const found = await this.api.get(`/api/people/${encodeURIComponent(this.person)}/charts`, {
      sign, start: BigInt(Math.round(from)) * 1_000_000n, end: BigInt(Math.round(to)) * 1_000_000n,
      pixels: Math.max(16, Math.min(4000, pixels))});
    if (mine === this.asked) {
      this.took(sign, chartOf(found, sign, (to - from) / pixels,
        {end: to, isNow: to >= this.timeline.now()}));
    }
  }
}

/** Make what plots use of an answer: times in ms. */
export function chartOf(found, sign, pixelMs, {end, isNow}) {
  const bucketMs = found.bucket_ns === undefined ? pixelMs : found.bucket_ns / NS_PER_MS;
  // A bucket is drawn where its middle is.
  const ms = (times) => (times || []).map((each) => each / NS_PER_MS + bucketMs / 2);
  const range = ({from_ns: from, to_ns: to, ...rest}) => ({
    // What lasted to the end of what was asked for goes on only where that is the present.
    from: from / NS_PER_MS, to: (to ?? null) === null ? (isNow ? null : end) : to / NS_PER_MS,
    ...rest});
  return {
    columns: {t: ms(found.t_ns), low: found.low || [], mean: found.mean || [],
              high: found.high || [], count: found.count || (found.t_ns || []).map(() => 1)},
    // Live values are no finer than what a pixel can show.
    how: {bucketMs: Math.max(bucketMs, pixelMs / 2), longestGapMs: styleOf(sign).staleMs, isNow},
    bad: (found.bad || []).map(range),
    limits: (found.limits || []).map((each) => (typeof each === 'string' ? limitZone(each) : each))
      .filter((each) => each && each.sign === sign),
    alarms: (found.alarms || []).map((each) => ({...each,
      t: (each.opened_ns ?? each.t_ns) / NS_PER_MS})),
  };
}

// @ts-check
/**
 * The values of one sign that a plot draws: columns of numbers, sorted by time.
 *
 * The history comes as buckets of a pixel each (lowest, mean, highest), what is live is appended.
 * The columns are allocated once; the views that a plot gets change only when the length does.
 */

const CAPACITY = 16_384;
// A gateway records what stays the same once a minute; live it says it every second or so.
const RECORDED_MS = 75_000;
const LIVE_MS = 2_500;
const UNKNOWN_MS = 5_000;

export class Columns {
  constructor(capacity = CAPACITY) {
    this.capacity = capacity;
    this.t = new Float64Array(capacity);
    this.low = new Float64Array(capacity);
    this.mean = new Float64Array(capacity);
    this.high = new Float64Array(capacity);
    this.count = new Float64Array(capacity);
    this.length = 0;
    /** How many of them came live, after the history. */
    this.live = 0;
    /** Live values that are nearer than this to the one before are one with it. */
    this.bucketMs = 0;
    /** What lies further apart is not joined: up to the last time of the history, and after it. */
    this.gapMs = Infinity;
    this.liveGapMs = Infinity;
    this.historyEnd = -Infinity;
    this.longestGapMs = Infinity;
    this.version = 0;
    this.dropped = 0;
  }

  /**
   * Take a history; what is live and newer than it is kept when it goes on from there.
   *
   * @param {{t: number[], low: number[], mean: number[], high: number[], count: number[]}} chart
   * @param {Object} how
   * @param {number} how.bucketMs the width of its buckets, 0: single values.
   * @param {number} how.longestGapMs what is further apart is never joined.
   * @param {boolean} how.isNow whether it goes up to the present.
   */
  replace(chart, {bucketMs, longestGapMs, isNow}) {
    const taken = Math.min(chart.t.length, this.capacity >> 1);
    const from = chart.t.length - taken;
    const last = taken ? chart.t[chart.t.length - 1] + bucketMs / 2 : -Infinity;
    const keep = isNow ? this.indexAfter(last) : this.length;
    const tail = Math.min(this.length - keep, this.capacity >> 2);
    const names = ['t', 'low', 'mean', 'high', 'count'];
    for (const name of names) {
      const column = this[name];
      column.copyWithin(taken, this.length - tail, this.length);
      for (let i = 0; i < taken; i += 1) {
        column[i] = chart[name][from + i];
      }
    }
    this.length = taken + tail;
    this.bucketMs = bucketMs;
    this.historyEnd = taken ? this.t[taken - 1] : -Infinity;
    this.live = tail;
    this.longestGapMs = longestGapMs;
    this.gapMs = gapOf(this.t, 0, taken, bucketMs, longestGapMs, RECORDED_MS);
    this._measureLive();
    this.version += 1;
  }

  /** Add a live value; one that is no newer than the last is not added. @return whether it was. */
  append(t, value) {
    const last = this.length - 1;
    if (last >= 0 && t <= this.t[last]) {
      return false;
    }
    this.version += 1;
    if (last >= 0 && t - this.t[last] < this.bucketMs) {
      this._fold(last, value);
      return true;
    }
    if (this.length === this.capacity) {
      this._dropOldest();
    }
    const i = this.length;
    this.t[i] = t;
    this.low[i] = this.mean[i] = this.high[i] = value;
    this.count[i] = 1;
    this.length = i + 1;
    this.live += 1;
    if (this.live < 16 || this.live % 16 === 0) {
      this._measureLive();
    }
    return true;
  }

  /** @return the index of the first value after a time. */
  indexAfter(t) {
    let from = 0;
    let to = this.length;
    while (from < to) {
      const middle = (from + to) >> 1;
      if (this.t[middle] <= t) {
        from = middle + 1;
      } else {
        to = middle;
      }
    }
    return from;
  }

  /** @return the index of the value nearest to a time, -1 without one within `withinMs`. */
  nearest(t, withinMs) {
    const after = this.indexAfter(t);
    let found = -1;
    for (const i of [after - 1, after]) {
      if (i >= 0 && i < this.length && Math.abs(this.t[i] - t) <= withinMs
          && (found < 0 || Math.abs(this.t[i] - t) < Math.abs(this.t[found] - t))) {
        found = i;
      }
    }
    return found;
  }

  /** @return whether value i and the one before it are one stretch. */
  isJoined(i) {
    if (i < 1) {
      return false;
    }
    let limit = this.t[i] <= this.historyEnd ? this.gapMs : this.liveGapMs;
    if (this.t[i - 1] === this.historyEnd) {
      limit = Math.max(limit, this.gapMs);
    }
    return this.t[i] - this.t[i - 1] <= limit;
  }

  /** @return what there is between two times: lowest, mean, highest, count; null without any. */
  summary(start, end) {
    const from = this.indexAfter(start - 1e-6);
    const to = this.indexAfter(end);
    if (from >= to) {
      return null;
    }
    let low = Infinity;
    let high = -Infinity;
    let sum = 0;
    let count = 0;
    for (let i = from; i < to; i += 1) {
      low = Math.min(low, this.low[i]);
      high = Math.max(high, this.high[i]);
      sum += this.mean[i] * this.count[i];
      count += this.count[i];
    }
    return {low, mean: sum / count, high, count, last: this.mean[to - 1], t: this.t[to - 1]};
  }

  clear() {
    this.length = 0;
    this.live = 0;
    this.bucketMs = 0;
    this.historyEnd = -Infinity;
    this.version += 1;
  }

  _measureLive() {
    const from = Math.max(this.indexAfter(this.historyEnd), this.length - 256);
    this.liveGapMs = gapOf(this.t, from, this.length, this.bucketMs, this.longestGapMs, LIVE_MS);
  }

  _fold(i, value) {
    const count = this.count[i];
    this.low[i] = Math.min(this.low[i], value);
    this.high[i] = Math.max(this.high[i], value);
    this.mean[i] += (value - this.mean[i]) / (count + 1);
    this.count[i] = count + 1;
  }

  _dropOldest() {
    const gone = this.capacity >> 2;
    for (const name of ['t', 'low', 'mean', 'high', 'count']) {
      this[name].copyWithin(0, gone, this.length);
    }
    this.length -= gone;
    this.dropped += gone;
  }
}

/**
 * How far apart two values may be to be joined: three of their usual distances.
 *
 * Never further than a value says anything (the sign's own limit), nor nearer than what is usual
 * of its source, and than one and a half buckets.
 *
 * @param {ArrayLike<number>} t times, of which those from `from` to `to` count.
 */
export function gapOf(t, from, to, bucketMs, longestGapMs, leastMs) {
  const steps = [];
  const stride = Math.max(1, Math.floor((to - from) / 256));
  for (let i = from + stride; i < to; i += stride) {
    steps.push(t[i] - t[i - 1]);
  }
  steps.sort((a, b) => a - b);
  // Of few nobody knows yet what is usual.
  const usual = steps.length > 3 ? steps[steps.length >> 1] : Math.max(UNKNOWN_MS, ...steps);
  const longest = Math.max(1.25 * longestGapMs, leastMs);
  return Math.max(1.5 * bucketMs, Math.min(Math.max(3 * usual, leastMs), longest));
}

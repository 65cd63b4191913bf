/**
 * The values of one sign that a plot draws: columns of numbers, sorted by time.
 *
 * The history comes as buckets of a pixel each (lowest, mean, highest), what is live is appended.
 * The columns are allocated once; the views that a plot gets change only when the length does.
 */

const CAPACITY = 16_384;

export class Columns {
  constructor(capacity = CAPACITY) {
    this.capacity = capacity;
    this.t = new Float64Array(capacity);
    this.low = new Float64Array(capacity);
    this.mean = new Float64Array(capacity);
    this.high = new Float64Array(capacity);
    this.count = new Float64Array(capacity);
    this.length = 0;
    /** Samples that are nearer than this to a bucket's start are part of it. */
    this.bucketMs = 0;
    /** What lies further apart than this is not joined. */
    this.gapMs = Infinity;
    this.version = 0;
    this.dropped = 0;
  }

  /**
   * Take a history; what is live and newer than it is kept.
   *
   * @param {{t: number[], low: number[], mean: number[], high: number[], count: number[]}} chart
   * @param {number} bucketMs the width of its buckets, 0: single values.
   * @param {number} longestGapMs what is further apart is never joined.
   */
  replace(chart, bucketMs, longestGapMs) {
    const taken = Math.min(chart.t.length, this.capacity >> 1);
    const from = chart.t.length - taken;
    const last = taken ? chart.t[chart.t.length - 1] + bucketMs : -Infinity;
    const keep = this.indexAfter(last);
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
    this.gapMs = gapOf(this.t, this.length, bucketMs, longestGapMs);
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
    return i > 0 && this.t[i] - this.t[i - 1] <= this.gapMs;
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
    this.bucketMs = 0;
    this.gapMs = Infinity;
    this.version += 1;
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
 * Never further than a value says anything (the sign's own limit), nor nearer than one and a half
 * buckets.
 */
export function gapOf(t, length, bucketMs, longestGapMs) {
  const steps = [];
  const stride = Math.max(1, Math.floor(length / 512));
  for (let i = stride; i < length; i += stride) {
    steps.push(t[i] - t[i - 1]);
  }
  steps.sort((a, b) => a - b);
  const usual = steps.length ? steps[steps.length >> 1] : longestGapMs;
  return Math.max(1.5 * bucketMs, Math.min(3 * usual, Math.max(longestGapMs, 1.5 * bucketMs)));
}

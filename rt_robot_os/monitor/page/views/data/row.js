// @ts-check
/** One sign of a person: its last value in large letters, and its plot. */

import {h, tone, write} from '../../lib/dom.js';
import {Columns} from './columns.js';
import {Plot} from './plot.js';
import {Quality} from './readings.js';
import {newsZones, styleOf} from './signs.js';

export class Row {
  /**
   * @param {Object} context of the page.
   * @param {string} sign
   * @param {() => Object} look palette, labels and words, as they are now.
   */
  constructor(context, sign, look) {
    this.context = context;
    this.sign = sign;
    this.style = styleOf(sign);
    this.columns = new Columns();
    this.quality = new Quality();
    this.limits = [];
    this.now = null;
    this.isSeen = true;
    this.makeLook = look;
    this.name = context.t.word('sign', sign);
    this.value = h('span.data-value.number', '–');
    this.unit = h('span.data-unit', this.style.unit);
    this.note = h('span.data-note.small');
    this.there = h('span.data-there.small.number');
    this.canvas = h('div.data-plot', {role: 'img', 'aria-label': this.name, 'data-sign': sign});
    this.head = h('div.data-head', h('h2.data-name', this.name), this.note,
      h('p.data-last', this.value, context.format.gap(this.style.unit), this.unit), this.there);
    this.element = h('section.data-row', {'data-sign': sign}, this.head, this.canvas);
    this.plot = new Plot(this.canvas, this.columns, this.style, look());
  }

  /** Make the plot anew: another size or theme, or the last one, which has the time axis. */
  build(width, height, withTime) {
    this.plot.look = this.makeLook();
    this.plot.build(width, height, withTime);
  }

  /** Take a history. */
  take({columns, how, bad, limits}) {
    this.columns.replace(columns, how);
    this.quality.replace(bad);
    this.limits = limits;
  }

  /** Take a live value; one that none can have is passed over. */
  append(t, value) {
    if (Number.isFinite(value) && !(this.sign === 'news2' && value < 0)) {
      this.columns.append(t, value);
      this.now = {t, value, quality: this.now?.quality || 'good'};
    }
  }

  /** Take the newest that the server has, unless something newer is known. */
  last({t, value, quality, source}) {
    if (!this.now || this.now.t < t) {
      this.now = {t, value, quality, source};
    }
  }

  /** Take what the robot says of its quality. */
  tell(t, {value, quality, ageS, source}) {
    this.quality.at(t, quality);
    this.now = {t: ageS === null ? t : t - ageS * 1000, value, quality, source};
  }

  /** Show the zones that are wanted. */
  zones({news, limits, own, scale, oxygen}) {
    const {t} = this.context;
    const found = news ? newsZones(this.sign, {scale, oxygen}).map(
      (each) => ({kind: 'news', ...each})) : [];
    const all = new Map([...this.limits, ...own].map((each) => [JSON.stringify(each), each]));
    for (const each of limits ? all.values() : []) {
      const isHigh = Number.isFinite(each.low);
      found.push({kind: 'limit', ...each, text: t(isHigh ? 'data.limit_high' : 'data.limit_low', {
        value: this.number(isHigh ? each.low : each.high), level: t.word('level', each.level)})});
    }
    this.plot.zones = found;
  }

  /** Draw it if there is anything new. @return whether it was drawn. */
  draw(start, end, now, force) {
    const isNew = force || this.quality.version !== this.drawnQuality;
    this.drawnQuality = this.quality.version;
    this.plot.bad = this.quality.marks;
    return this.isSeen && this.plot.uplot ? this.plot.draw(start, end, now, isNew) : false;
  }

  number(value) {
    return this.context.format.number(value, this.style.digits);
  }

  /** Write the last value, and how old and good it is. */
  writeNow(nowMs) {
    const {t, format} = this.context;
    const last = this.columns.length - 1;
    const now = this.now || (last >= 0 && {t: this.columns.t[last], value: this.columns.mean[last],
                                           quality: 'good'});
    if (!now || now.value === null || now.value === undefined) {
      write(this.value, '–');
      write(this.note, now ? t.word('quality', now.quality) : t('data.nothing'));
      tone(this.head, 'quality', now ? now.quality : 'missing');
      return;
    }
    const ageMs = Math.max(0, nowMs - now.t);
    const isOld = ageMs > this.style.staleMs || now.quality !== 'good';
    write(this.value, this.shown(now.value));
    write(this.note, now.quality !== 'good' ? t('data.bad_since', {
      quality: t.word('quality', now.quality), age: format.duration(ageMs / 1000)})
      : ageMs > 5000 ? format.ago(ageMs / 1000) : t('data.now'));
    tone(this.head, 'quality', isOld ? (now.quality === 'good' ? 'stale' : now.quality) : 'good');
  }

  shown(value) {
    const {t} = this.context;
    return this.sign === 'consciousness' && t.has('consciousness', value)
      ? t.word('consciousness', value) : this.number(value);
  }

  /** Write what is at the cursor; null: nothing. */
  writeThere(time, withinMs) {
    const i = time === null ? -1 : this.columns.nearest(time, withinMs);
    if (i < 0) {
      write(this.there, time === null ? '' : '–');
      return;
    }
    const {low, mean, high} = this.columns;
    const isRange = high[i] - low[i] > 10 ** -this.style.digits / 2;
    write(this.there, isRange ? this.context.t('data.mean_range', {mean: this.number(mean[i]),
      low: this.number(low[i]), high: this.number(high[i])}) : this.shown(mean[i]));
  }

  /** Say what is to be seen, for those who do not see it. */
  describe(start, end) {
    const {t} = this.context;
    const found = this.columns.summary(start, end);
    let gaps = 0;
    for (let i = this.columns.indexAfter(start) + 1; i < this.columns.indexAfter(end); i += 1) {
      gaps += this.columns.isJoined(i) ? 0 : 1;
    }
    this.canvas.setAttribute('aria-label', found ? t('data.described', {name: this.name,
      low: this.number(found.low), high: this.number(found.high),
      mean: this.context.format.unit(found.mean, this.style.unit, this.style.digits), last: this.shown(found.last), gaps})
      : t('data.described_empty', {name: this.name}));
  }
}

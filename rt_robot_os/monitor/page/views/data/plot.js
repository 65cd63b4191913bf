// @ts-check
/** The plot of one sign: uPlot with the zones, the marks and the gaps of the sign. */

import '../../lib/locale.js';

import uPlot from '../../vendor/uplot/uPlot.esm.js';

import {bandPaths, meanPaths} from './paths.js';
import {drawMarks, drawZones} from './drawing.js';

export const AXIS_WIDTH = 46;
export const PADDING_RIGHT = 10;
const TIME_HEIGHT = 40;

export class Plot {
  /**
   * @param {HTMLElement} root it is drawn in there.
   * @param {import('./columns.js').Columns} columns
   * @param {Object} style of `signs.js`.
   * @param {Object} look palette, labels (of the time axis), number (of the value axis), words.
   */
  constructor(root, columns, style, look) {
    this.root = root;
    this.columns = columns;
    this.style = style;
    this.look = look;
    /** What lies behind the line: {low, high, kind, points or level, text}. */
    this.zones = [];
    /** Times of which the value is bad: {from, to, quality}. */
    this.bad = [];
    /** Times of alarms: {t, level}. */
    this.alarms = [];
    /** Times without a connection: {from, to}. */
    this.cuts = [];
    this.range = [0, 1];
    this.isEmpty = true;
    this.drawn = -1;
    this.start = this.end = 0;
    this.views = null;
  }

  /** Make it anew, as large as its root, with or without a time axis. */
  build(width, height, withTime) {
    this.destroy();
    this.width = width;
    this.uplot = new /** @type {*} */ (uPlot)(this._options(width, height, withTime), this._views(), this.root);
    this.drawn = -1;
  }

  destroy() {
    this.uplot?.destroy();
    this.uplot = null;
  }

  /** Draw it if anything is new; what goes on goes on to `now`. @return whether it was drawn. */
  draw(start, end, now, force = false) {
    if (!force && this.drawn === this.columns.version && start === this.start
        && end === this.end) {
      return false;
    }
    const isNew = this.drawn !== this.columns.version;
    this.drawn = this.columns.version;
    this.start = start;
    this.end = end;
    this.now = now;
    this.isEmpty = this.columns.indexAfter(start) === this.columns.indexAfter(end);
    this.range = valueRange(this.columns, this.style, this.zones, start, end);
    const u = this.uplot;
    u.batch(() => {
      if (isNew) {
        u.setData(this._views(), false);
      }
      u.setScale('x', {min: start, max: end});
      u.setScale('y', {min: this.range[0], max: this.range[1]});
    });
    return true;
  }

  _views() {
    const {columns} = this;
    if (!this.views || this.views[0].length !== columns.length) {
      this.views = [columns.t, columns.low, columns.mean]
        .map((each) => each.subarray(0, columns.length));
    }
    return this.views;
  }

  _options(width, height, withTime) {
    const {palette, labels, number, font} = this.look;
    const line = {stroke: palette.grid, width: 1};
    const axis = {stroke: palette.muted, font, grid: line, ticks: {show: false}, gap: 6};
    return {
      width, height: height + (withTime ? TIME_HEIGHT : 0), ms: 1,
      padding: [withTime ? 0 : 7, PADDING_RIGHT, 7, 0],
      legend: {show: false}, cursor: {show: false}, select: {show: false},
      scales: {
        x: {time: true, auto: false, range: (u, min, max) => [min ?? 0, max ?? 1]},
        y: {auto: false, range: (u, min, max) => [min ?? 0, max ?? 1]},
      },
      series: [
        {},
        {paths: bandPaths(this.columns), fill: palette.band, points: {show: false}, auto: false},
        {paths: meanPaths(this.columns, this.style.steps), stroke: palette.line,
         fill: palette.line, width: 1.5, points: {show: false}, auto: false},
      ],
      axes: [
        {...axis, side: 0, gap: 22, size: withTime ? TIME_HEIGHT : 0, space: 84,
         values: (u, splits, index, space, step) => (withTime ? labels(splits, step) : [])},
        {...axis, size: AXIS_WIDTH, space: 20, incrs: incrementsOf(this.style),
         values: (u, splits) => splits.map((each) => number(each, this.style.digits))},
      ],
      hooks: {
        drawClear: [(u) => drawZones(u, this, palette)],
        draw: [(u) => drawMarks(u, this, palette)],
      },
    };
  }
}

/** The steps that a value axis may have: whole numbers where values are. */
function incrementsOf(style) {
  const steps = [1, 2, 5, 10, 20, 25, 50, 100, 200, 500, 1000];
  return style.digits ? [0.1, 0.2, 0.5, ...steps] : steps;
}

/**
 * Return the lowest and the highest value of an axis: what is to be seen, and limits near it.
 *
 * @return {[number, number]}
 */
export function valueRange(columns, style, zones, start, end) {
  const from = Math.max(0, columns.indexAfter(start) - 1);
  const to = Math.min(columns.length, columns.indexAfter(end) + 1);
  let low = Infinity;
  let high = -Infinity;
  for (let i = from; i < to; i += 1) {
    low = Math.min(low, columns.low[i]);
    high = Math.max(high, columns.high[i]);
  }
  if (low > high) {
    return padded(style.usual[0], style.usual[1], style);
  }
  const near = Math.max(style.least, high - low) * 0.4;
  for (const zone of zones) {
    for (const edge of zone.kind === 'limit' ? [zone.low, zone.high] : []) {
      if (edge > low - near && edge < high + near) {
        low = Math.min(low, edge - near * 0.2);
        high = Math.max(high, edge + near * 0.2);
      }
    }
  }
  return padded(low, high, style);
}

/** @returns {[number, number]} the ends of an axis around these */
function padded(low, high, style) {
  const span = Math.max(style.least, (high - low) * 1.15);
  const middle = (low + high) / 2;
  // In whole steps, so that the axis does not tremble with each value.
  const step = span / 10;
  let from = Math.floor((middle - span / 2) / step) * step;
  let to = from + Math.ceil(span / step + 1) * step;
  if (style.lowest !== undefined && from < style.lowest) {
    from = style.lowest - step * 0.3;
  }
  if (style.most !== undefined && to > style.most) {
    from -= low - (to - style.most) > from ? 0 : to - style.most;
    to = style.most + step * 0.3;
  }
  return [from, to];
}

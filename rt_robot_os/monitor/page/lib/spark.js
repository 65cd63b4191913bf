// @ts-check
/** A small line of the last while of a number; gaps stay gaps. */

import {attribute, svg} from './dom.js';

const WIDTH = 96;
const HEIGHT = 28;
const EDGE = 3;

/** Make an empty one; it is drawn by draw(). */
export function sparkline() {
  return svg('svg.spark', {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none',
    'aria-hidden': 'true', focusable: 'false'}, svg('path'));
}

/**
 * Draw values over time.
 * @param {SVGElement} element
 * @param {Array<[number, number]>} points t in ns and value, in order of t; NaN is a gap
 * @param {number} startNs of the time that is shown
 * @param {number} endNs
 * @param {number} leastSpan of values: noise does not look like a drama
 * @param {number} gapNs longer without a value is a gap
 */
export function drawSpark(element, points, startNs, endNs, leastSpan, gapNs) {
  const values = points.map(([, value]) => value).filter(Number.isFinite);
  if (!values.length) {
    attribute(element.firstChild, 'd', null);
    return;
  }
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const span = Math.max(high - low, leastSpan);
  const base = (high + low) / 2 - span / 2;
  let path = '';
  let last = -Infinity;
  for (const [t, value] of points) {
    if (Number.isFinite(value) && t >= startNs) {
      const x = ((t - startNs) / (endNs - startNs)) * WIDTH;
      const y = HEIGHT - EDGE - ((value - base) / span) * (HEIGHT - 2 * EDGE);
      path += `${t - last > gapNs ? 'M' : 'L'}${x.toFixed(1)} ${y.toFixed(1)}`;
      last = t;
    }
  }
  attribute(element.firstChild, 'd', path || null);
}

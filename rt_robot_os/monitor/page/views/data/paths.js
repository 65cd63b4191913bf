// @ts-check
/** What uPlot strokes and fills of a sign, in canvas pixels: a line with gaps, values, a band. */

/**
 * Return the path builder of the mean.
 *
 * @param {import('./columns.js').Columns} columns
 * @param {boolean} steps whether a value holds until the next one.
 */
export function meanPaths(columns, steps) {
  return (u, series, from, to) => {
    const stroke = new Path2D();
    const fill = new Path2D();
    const {t, mean} = columns;
    const [ax, bx] = linear(u, 'x');
    const [ay, by] = linear(u, 'y');
    const size = 2 * devicePixelRatio;
    // Few values are told one by one.
    const dots = (to - from) * 14 * devicePixelRatio < u.bbox.width;
    for (let i = from; i <= to && i < columns.length; i += 1) {
      const x = ax * t[i] + bx;
      const y = ay * mean[i] + by;
      const isJoined = i > from && columns.isJoined(i);
      if (isJoined) {
        if (steps) {
          stroke.lineTo(x, ay * mean[i - 1] + by);
        }
        stroke.lineTo(x, y);
      } else {
        stroke.moveTo(x, y);
      }
      if (dots || !(isJoined || (i + 1 < columns.length && columns.isJoined(i + 1)))) {
        fill.rect(x - size, y - size, 2 * size, 2 * size);
      }
    }
    return {stroke, fill, clip: null, band: null, gaps: null, flags: 0};
  };
}

/** Return the path builder of what lies between the lowest and the highest value. */
export function bandPaths(columns) {
  return (u, series, from, to) => {
    const fill = new Path2D();
    let first = from;
    for (let i = from + 1; i <= to + 1; i += 1) {
      if (i > to || i >= columns.length || !columns.isJoined(i)) {
        stretch(fill, columns, first, Math.min(i, columns.length) - 1, u);
        first = i;
      }
    }
    return {stroke: null, fill, clip: null, band: null, gaps: null, flags: 0};
  };
}

function stretch(path, columns, from, to, u) {
  const {t, low, high} = columns;
  const [ax, bx] = linear(u, 'x');
  const [ay, by] = linear(u, 'y');
  if (to < from) {
    return;
  }
  path.moveTo(ax * t[from] + bx, ay * high[from] + by);
  for (let i = from + 1; i <= to; i += 1) {
    path.lineTo(ax * t[i] + bx, ay * high[i] + by);
  }
  for (let i = to; i >= from; i -= 1) {
    path.lineTo(ax * t[i] + bx, ay * low[i] + by);
  }
  path.closePath();
}

/** Return a and b of: canvas pixel = a * value + b. */
function linear(u, key) {
  const {min, max} = u.scales[key];
  const {left, top, width, height} = u.bbox;
  if (key === 'x') {
    const a = width / (max - min);
    return [a, left - a * min];
  }
  const a = -height / (max - min);
  return [a, top + height - a * min];
}

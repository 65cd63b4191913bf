// @ts-check
/** What is drawn on a plot besides its line: zones behind it, marks of bad values and alarms. */

const STRIP = 5;
const LONGEST_TEXT = 60;

/** Draw the zones of limits and of the NEWS2 chart, and what was cut off, behind everything. */
export function drawZones(u, plot, palette) {
  const {ctx} = u;
  ctx.save();
  clip(ctx, u.bbox);
  for (const zone of plot.zones) {
    drawZone(u, zone, palette);
  }
  for (const cut of plot.cuts) {
    hatch(ctx, u, cut.from, cut.to ?? plot.now, u.bbox.top, u.bbox.height, palette.gap);
  }
  ctx.restore();
}

function drawZone(u, zone, palette) {
  const {ctx, bbox} = u;
  const {min, max} = u.scales.y;
  const low = Math.max(zone.low, min);
  const high = Math.min(zone.high, max);
  if (low >= high) {
    return;
  }
  const top = u.valToPos(high, 'y', true);
  const bottom = u.valToPos(low, 'y', true);
  ctx.fillStyle = zone.kind === 'limit' ? palette.limit : palette.news[zone.points];
  ctx.fillRect(bbox.left, top, bbox.width, bottom - top);
  const ratio = devicePixelRatio;
  if (zone.kind === 'limit') {
    const edge = Number.isFinite(zone.low) ? bottom : top;
    ctx.strokeStyle = palette.limitLine;
    ctx.lineWidth = 1.5 * ratio;
    ctx.setLineDash([6 * ratio, 4 * ratio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, edge);
    ctx.lineTo(bbox.left + bbox.width, edge);
    ctx.stroke();
    const below = edge - bbox.top < 16 * ratio;
    text(ctx, zone.text, bbox.left + 6 * ratio, edge + (below ? 12 : -4) * ratio, palette.limitText,
         palette, 'left');
  } else if (bottom - top > 11 * ratio) {
    text(ctx, String(zone.points), bbox.left + bbox.width - 5 * ratio,
         (top + bottom) / 2 + 4 * ratio, palette.muted, palette, 'right');
  }
}

/** Draw what is bad, and alarms, over the line. */
export function drawMarks(u, plot, palette) {
  const {ctx, bbox} = u;
  const ratio = devicePixelRatio;
  ctx.save();
  clip(ctx, bbox);
  for (const each of plot.bad) {
    drawBad(u, each, plot, palette);
  }
  if (plot.isEmpty) {
    text(ctx, plot.look.empty, bbox.left + bbox.width / 2, bbox.top + bbox.height / 2 + 4 * ratio,
         palette.muted, palette, 'center');
  }
  ctx.lineWidth = 1.5 * ratio;
  for (const alarm of plot.alarms) {
    const x = Math.round(u.valToPos(alarm.t, 'x', true));
    if (x >= bbox.left && x <= bbox.left + bbox.width) {
      ctx.strokeStyle = palette.levels[alarm.level] || palette.levels.warning;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
  }
  ctx.restore();
}

function drawBad(u, {from, to, quality}, plot, palette) {
  const {ctx, bbox} = u;
  const ratio = devicePixelRatio;
  const left = Math.max(bbox.left, u.valToPos(from, 'x', true));
  const right = Math.min(bbox.left + bbox.width, u.valToPos(to ?? plot.now, 'x', true));
  if (right <= left) {
    return;
  }
  const y = bbox.top + bbox.height - STRIP * ratio;
  ctx.fillStyle = palette.quality[quality] || palette.stale;
  ctx.fillRect(left, y, Math.max(ratio, right - left), STRIP * ratio);
  const words = plot.look.words(quality);
  ctx.font = palette.small;
  if (right - left > ctx.measureText(words).width + 8 * ratio) {
    text(ctx, words, left + 4 * ratio, y - 3 * ratio, palette.text, palette, 'left');
  }
}

function text(ctx, words, x, y, color, palette, align) {
  ctx.setLineDash([]);
  ctx.font = palette.small;
  ctx.textAlign = align;
  ctx.textBaseline = 'alphabetic';
  ctx.lineWidth = 3 * devicePixelRatio;
  ctx.strokeStyle = palette.surface;
  const shown = words.length > LONGEST_TEXT ? `${words.slice(0, LONGEST_TEXT - 1)}…` : words;
  ctx.strokeText(shown, x, y);
  ctx.fillStyle = color;
  ctx.fillText(shown, x, y);
}

function hatch(ctx, u, from, to, top, height, color) {
  const left = Math.max(u.bbox.left, u.valToPos(from, 'x', true));
  const right = Math.min(u.bbox.left + u.bbox.width, u.valToPos(to, 'x', true));
  if (right <= left) {
    return;
  }
  const step = 8 * devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top, Math.max(devicePixelRatio, right - left), height);
  ctx.clip();
  ctx.strokeStyle = color;
  ctx.lineWidth = devicePixelRatio;
  ctx.beginPath();
  for (let x = left - height; x < right; x += step) {
    ctx.moveTo(x, top + height);
    ctx.lineTo(x + height, top);
  }
  ctx.stroke();
  ctx.restore();
}

function clip(ctx, {left, top, width, height}) {
  ctx.beginPath();
  ctx.rect(left, top, width, height);
  ctx.clip();
}

// @ts-check
/** Symbols of the map; each state has a shape of its own, so that the colour is not all. */

/** A robot: a disc with its nose ahead; hollow when it is old. */
export function robotShape(ctx, x, y, yaw, radius, color, palette, isOld) {
  ctx.save();
  ctx.translate(x, y);
  ctx.rotate(-(yaw || 0));
  ctx.fillStyle = isOld ? palette.surface : color;
  ctx.strokeStyle = isOld ? color : palette.surface;
  ctx.lineWidth = 2.5;
  ctx.setLineDash(isOld ? [4, 3] : []);
  ctx.beginPath();
  ctx.arc(0, 0, radius, 0.5, 2 * Math.PI - 0.5);
  ctx.lineTo(radius * 1.55, 0);
  ctx.closePath();
  ctx.fill();
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.fillStyle = isOld ? color : palette.surface;
  ctx.beginPath();
  ctx.moveTo(radius * 0.9, 0);
  ctx.lineTo(-radius * 0.35, radius * 0.5);
  ctx.lineTo(-radius * 0.1, 0);
  ctx.lineTo(-radius * 0.35, -radius * 0.5);
  ctx.closePath();
  ctx.fill();
  ctx.restore();
}

/** A person: head and shoulders. */
export function personShape(ctx, x, y, color, palette) {
  ctx.fillStyle = color;
  ctx.strokeStyle = palette.surface;
  ctx.lineWidth = 2.5;
  ctx.beginPath();
  ctx.arc(x, y + 14, 11, Math.PI, 2 * Math.PI);
  ctx.closePath();
  ctx.stroke();
  ctx.fill();
  ctx.beginPath();
  ctx.arc(x, y - 5, 6.5, 0, 2 * Math.PI);
  ctx.stroke();
  ctx.fill();
}

const NODE_SHAPES = {
  good: (ctx) => ctx.arc(0, 0, 8, 0, 2 * Math.PI),
  sink: (ctx) => polygon(ctx, [[-9, -9], [9, -9], [9, 9], [-9, 9]]),
  weak: (ctx) => polygon(ctx, [[0, -10], [10, 8], [-10, 8]]),
  doubtful: (ctx) => polygon(ctx, [[0, -11], [11, 0], [0, 11], [-11, 0]]),
  silent: (ctx) => cross(ctx),
  asleep: (ctx) => ctx.arc(0, 0, 7, 0, 2 * Math.PI),
  unheard: (ctx) => ctx.arc(0, 0, 7, 0, 2 * Math.PI),
};
const HOLLOW = new Set(['asleep', 'unheard']);

/** A node of the network in its state. */
export function nodeShape(ctx, x, y, state, palette) {
  const name = state in NODE_SHAPES ? state : 'unheard';
  const color = palette.nodes[name];
  ctx.save();
  ctx.translate(x, y);
  ctx.lineWidth = HOLLOW.has(name) ? 2.5 : 2;
  ctx.fillStyle = HOLLOW.has(name) ? palette.surface : color;
  ctx.strokeStyle = HOLLOW.has(name) ? color : palette.surface;
  ctx.setLineDash(name === 'unheard' ? [3, 3] : []);
  ctx.beginPath();
  NODE_SHAPES[name](ctx);
  ctx.fill();
  ctx.stroke();
  ctx.restore();
}

/** The place of an alarm: a ring with a mark. */
export function alarmShape(ctx, x, y, color, palette) {
  ctx.strokeStyle = palette.surface;
  ctx.lineWidth = 7;
  ctx.beginPath();
  ctx.arc(x, y, 20, 0, 2 * Math.PI);
  ctx.stroke();
  ctx.strokeStyle = color;
  ctx.lineWidth = 4;
  ctx.stroke();
  ctx.fillStyle = color;
  ctx.fillRect(x - 2, y - 38, 4, 9);
  ctx.fillRect(x - 2, y - 27, 4, 4);
}

/** A goal: a ring, and an arrow to where it will look. */
export function goalShape(ctx, x, y, yaw, length, color, palette) {
  ctx.save();
  ctx.translate(x, y);
  ctx.rotate(-yaw);
  for (const [style, width] of [[palette.surface, 6], [color, 3]]) {
    ctx.strokeStyle = style;
    ctx.lineWidth = width;
    ctx.lineCap = 'round';
    ctx.beginPath();
    ctx.arc(0, 0, 11, 0, 2 * Math.PI);
    ctx.moveTo(11, 0);
    ctx.lineTo(length, 0);
    ctx.moveTo(length - 9, -7);
    ctx.lineTo(length, 0);
    ctx.lineTo(length - 9, 7);
    ctx.stroke();
  }
  ctx.restore();
}

function polygon(ctx, points) {
  points.forEach(([x, y], index) => ctx[index ? 'lineTo' : 'moveTo'](x, y));
  ctx.closePath();
}

function cross(ctx) {
  polygon(ctx, [[-9, -5], [-5, -9], [0, -4], [5, -9], [9, -5], [4, 0], [9, 5], [5, 9], [0, 4],
    [-5, 9], [-9, 5], [-4, 0]]);
}

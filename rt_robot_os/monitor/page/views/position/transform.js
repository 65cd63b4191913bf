// @ts-check
/**
 * From cells of a map to metres of its frame, and from metres to the screen; and back.
 *
 * The frame of a map has y upwards, the screen downwards. Metres are those of the map's frame, as
 * poses and goals have them; the origin of a map is where the corner of its lower left cell lies,
 * and by how much its rows are turned.
 */

export const LEAST_SCALE = 2;
export const MOST_SCALE = 600;

/** @return {[number, number]} metres of a place in cells (0, 0 is the corner of the first). */
export function cellToWorld({resolution_m: size, origin}, column, row) {
  const [x0, y0, yaw] = origin;
  const [x, y] = [column * size, row * size];
  return [x0 + x * Math.cos(yaw) - y * Math.sin(yaw), y0 + x * Math.sin(yaw) + y * Math.cos(yaw)];
}

/** @return {[number, number]} the place in cells of metres. */
export function worldToCell({resolution_m: size, origin}, x, y) {
  const [x0, y0, yaw] = origin;
  const [dx, dy] = [x - x0, y - y0];
  return [(dx * Math.cos(yaw) + dy * Math.sin(yaw)) / size,
          (dy * Math.cos(yaw) - dx * Math.sin(yaw)) / size];
}

/** @return {{left, right, bottom, top}} what a map covers, in metres. */
export function boundsOf(map) {
  const corners = [[0, 0], [map.width, 0], [0, map.height], [map.width, map.height]]
    .map(([column, row]) => cellToWorld(map, column, row));
  const [xs, ys] = [corners.map(([x]) => x), corners.map(([, y]) => y)];
  return {left: Math.min(...xs), right: Math.max(...xs), bottom: Math.min(...ys),
          top: Math.max(...ys)};
}

/** Which part of the frame is on the screen. */
export class Viewport {
  constructor(width = 1, height = 1) {
    this.width = width;
    this.height = height;
    /** What is in the middle of the screen, in metres, and pixels a metre. */
    this.x = 0;
    this.y = 0;
    this.scale = 50;
  }

  /** @return {[number, number]} CSS pixels of metres. */
  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale,
            this.height / 2 - (y - this.y) * this.scale];
  }

  /** @return {[number, number]} metres of CSS pixels. */
  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale,
            this.y - (py - this.height / 2) / this.scale];
  }

  /** The screen has another size; its middle stays. */
  resize(width, height) {
    this.width = width;
    this.height = height;
  }

  /** Move what is shown by pixels. */
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  /** Zoom by a factor (above 1: nearer); what is at the place stays there. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(MOST_SCALE, Math.max(LEAST_SCALE, this.scale * factor));
    const [nowX, nowY] = this.toWorld(px, py);
    this.x += x - nowX;
    this.y += y - nowY;
  }

  /** Show all of this, with a margin in pixels. */
  fit({left, right, bottom, top}, margin = 24) {
    const scale = Math.min((this.width - 2 * margin) / Math.max(0.1, right - left),
      (this.height - 2 * margin) / Math.max(0.1, top - bottom));
    this.scale = Math.min(MOST_SCALE, Math.max(LEAST_SCALE, scale));
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2;
  }

  /** Move so far that a place is within the middle part of the screen. */
  follow(x, y, part = 0.3) {
    const [px, py] = this.toScreen(x, y);
    const [mx, my] = [this.width * part, this.height * part];
    this.pan(Math.min(0, this.width - mx - px) + Math.max(0, mx - px),
      Math.min(0, this.height - my - py) + Math.max(0, my - py));
  }
}

/** @return an angle from -pi to pi. */
export function wrapped(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}

// @ts-check
/** The map of a robot as the server keeps it, and as a picture in the colours of the page. */

const UNKNOWN = 255;
const OCCUPIED = 65;
const FREE = 25;

/**
 * Unpack a map as `GET /api/robots/{id}/map` has it.
 *
 * @return {Promise<Object>} width, height, resolution_m, origin and cells (Uint8Array: 0 free to
 *     100 occupied, 255 unknown; the first row is the lowest).
 */
export async function unpacked(found) {
  const packed = Uint8Array.from(atob(found.cells), (each) => each.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  const cells = new Uint8Array(await new Response(stream).arrayBuffer());
  if (cells.length !== found.width * found.height) {
    throw new Error(`a map of ${cells.length} cells, not ${found.width} by ${found.height}`);
  }
  return {...found, cells};
}

/** Draw a map once, upright: a canvas with a pixel a cell. */
export function pictureOf(map, {wall, floor, unknown}) {
  const canvas = document.createElement('canvas');
  canvas.width = map.width;
  canvas.height = map.height;
  const ctx = canvas.getContext('2d');
  const image = ctx.createImageData(map.width, map.height);
  const pixels = new Uint32Array(image.data.buffer);
  const colors = new Uint32Array(256).fill(unknown);
  for (let value = 0; value <= 100; value += 1) {
    colors[value] = value >= OCCUPIED ? wall : value <= FREE ? floor : unknown;
  }
  colors[UNKNOWN] = unknown;
  for (let row = 0; row < map.height; row += 1) {
    const from = (map.height - 1 - row) * map.width;
    for (let column = 0; column < map.width; column += 1) {
      pixels[row * map.width + column] = colors[map.cells[from + column]];
    }
  }
  ctx.putImageData(image, 0, 0);
  return canvas;
}

/** @return a color of CSS as a pixel of a picture. */
export function pixelOf(color) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 1;
  const ctx = canvas.getContext('2d', {willReadFrequently: true});
  ctx.fillStyle = color;
  ctx.fillRect(0, 0, 1, 1);
  return new Uint32Array(ctx.getImageData(0, 0, 1, 1).data.buffer)[0];
}

/** @return what a cell is: free, wall, unknown or outside. */
export function kindAt(map, column, row) {
  const [x, y] = [Math.floor(column), Math.floor(row)];
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) {
    return 'outside';
  }
  const value = map.cells[y * map.width + x];
  return value <= FREE ? 'free' : value <= 100 && value >= OCCUPIED ? 'wall' : 'unknown';
}

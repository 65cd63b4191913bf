// @ts-check
/** Names on the map: the important ones first, none over another. */

const HEIGHT = 15;
const BASE = 12;

export class Labels {
  constructor() {
    this.wanted = [];
  }

  /**
   * Ask for a name.
   *
   * @param {number} x its middle, in CSS pixels.
   * @param {number} y its base line.
   * @param {number} rank 0 is always written, a larger one gives way.
   * @param {number} [instead] the base line when there is no room at the first.
   */
  add(words, x, y, rank, instead = y) {
    if (words) {
      this.wanted.push({words, x, y, rank, instead});
    }
  }

  /** Write them, with a rim so that they are read on anything; then forget them. */
  write(ctx, palette) {
    const taken = [];
    ctx.font = palette.font;
    ctx.textAlign = 'center';
    ctx.lineJoin = 'round';
    ctx.lineWidth = 3;
    ctx.strokeStyle = palette.surface;
    ctx.fillStyle = palette.text;
    for (const {words, x, y, rank, instead} of this.wanted.sort((a, b) => a.rank - b.rank)) {
      const half = ctx.measureText(words).width / 2 + 2;
      const boxAt = (base) => ({left: x - half, right: x + half, top: base - BASE,
                                bottom: base - BASE + HEIGHT});
      const base = [y, instead].find((each) => !taken.some((box) => overlap(box, boxAt(each))));
      if (base !== undefined || rank === 0) {
        taken.push(boxAt(base ?? y));
        ctx.strokeText(words, x, base ?? y);
        ctx.fillText(words, x, base ?? y);
      }
    }
    this.wanted.length = 0;
  }
}

function overlap(a, b) {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

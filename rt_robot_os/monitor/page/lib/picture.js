// @ts-check
/**
 * A live picture of a camera, with its age: grey when it is older than a second, so that nobody
 * takes a frozen picture for the room as it is.
 */

import {cameras} from './cameras.js';
import {h, tone, write} from './dom.js';
import {saidOf, writeSaid} from './said.js';

/** A picture older than this is shown in grey. */
export const STALE_MS = 1000;
const LOOK_MS = 100;
const RATE_HZ = 10;

/**
 * Show a camera.
 * @param {Object} context of the view
 * @param {{robot: string, camera: string, rateHz?: number, label?: string}} what rateHz: pictures a second at most
 * @returns {{element: HTMLElement, close: function(): void, ageMs: function(): ?number,
 *   canvas: HTMLCanvasElement}} on element the event 'picture' tells of each one that was drawn
 */
export function pictureOf(context, {robot, camera, rateHz = RATE_HZ, label = camera}) {
  const shown = new Shown(context, label, cameras());
  context.t.words.load('picture').then(() => shown.look());
  const leave = cameras().look({robot, camera, rateHz}, shown);
  const timer = setInterval(() => shown.look(), LOOK_MS);
  const close = () => {
    clearInterval(timer);
    leave();
    shown.isClosed = true;
  };
  return {element: shown.element, canvas: shown.canvas, close, ageMs: () => shown.ageMs()};
}

class Shown {
  constructor(context, label, connection) {
    this.t = context.t;
    this.format = context.format;
    this.label = label;
    this.connection = connection;
    this.last = null;
    this.whyNot = null;
    this.isClosed = false;
    this.canvas = h('canvas.picture-canvas', {width: 640, height: 480, role: 'img'});
    this.age = h('span.picture-age');
    this.note = h('p.picture-note');
    this.element = h('figure.picture.picture-none',
      h('div.picture-frame', this.canvas, this.note),
      h('figcaption.picture-caption', h('span.picture-name', label), this.age));
  }

  /** Draw a picture; the promise ends when it is on the screen's way. */
  async picture(header, payload) {
    const bitmap = await createImageBitmap(new Blob([payload], {type: 'image/jpeg'}));
    await new Promise((done) => requestAnimationFrame(done));
    if (!this.isClosed) {
      this.draw(bitmap);
      this.last = header;
      this.lastMs = Date.now();
      this.whyNot = null;
      this.look();
      this.element.dispatchEvent(new CustomEvent('picture', {
        detail: {n: header.n, utc_ns: header.utc_ns, ageMs: this.ageMs()}}));
    }
    bitmap.close();
  }

  draw(bitmap) {
    if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
      this.canvas.width = bitmap.width;
      this.canvas.height = bitmap.height;
    }
    this.canvas.getContext('2d').drawImage(bitmap, 0, 0);
  }

  /** There is no such camera, or not for us. */
  gone(message) {
    this.whyNot = saidOf(this.t, message, 'text');
    this.last = null;
    this.canvas.getContext('2d').clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.look();
  }

  ageMs() {
    return this.last ? this.connection.ageMs(this.last.utc_ns) : null;
  }

  /** Bring age and colour up to date. */
  look() {
    const {t} = this;
    const ageMs = this.ageMs();
    const state = !this.last ? 'none' : ageMs !== null && ageMs <= STALE_MS ? 'live' : 'stale';
    tone(this.element, 'picture', state);
    write(this.age, state === 'none' ? '' : t('picture.age', {age: seconds(this.format, ageMs)}));
    writeSaid(this.note, state === 'none' && this.whyNot || {text: this.words(state, ageMs),
      lang: null});
    const spoken = t(state === 'live' ? 'picture.of' : 'picture.old', {camera: this.label});
    if (this.canvas.getAttribute('aria-label') !== spoken) {
      this.canvas.setAttribute('aria-label', spoken);
    }
  }

  words(state, ageMs) {
    const {t} = this;
    if (state === 'live') {
      return '';
    }
    if (state === 'none') {
      return t(this.connection.isOpen ? 'picture.waiting' : 'picture.connecting');
    }
    const since = ageMs === null ? this.lastMs : Date.now() - ageMs;
    return t('picture.since', {time: this.format.time(since)});
  }
}

function seconds(format, ageMs) {
  return ageMs === null ? '–' : format.unit(ageMs / 1000, 's', ageMs < 10000 ? 1 : 0);
}

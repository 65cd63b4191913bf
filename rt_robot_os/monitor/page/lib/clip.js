// @ts-check
/** A player for clips of alarms: picture by picture, with a bar and keys. */

import {parseAvi} from './avi.js';
import {h, replace, write} from './dom.js';
import {icon} from './icons.js';
import {said} from './said.js';

const BYTES_MOST = 256 << 20;
// How many steps the keys go: one picture, and about a second.
const KEYS = {ArrowLeft: -1, ArrowRight: 1, ',': -1, '.': 1};

/**
 * Show a clip.
 * @param {Object} context of the view
 * @param {string} address of the file
 * @param {string} label what it is of
 * @returns {{element: HTMLElement, close: function(): void}}
 */
export function clipOf(context, address, label) {
  const player = new Player(context, label);
  const loading = new AbortController();
  context.t.words.load('clip').then(() => player.load(address, loading.signal));
  return {
    element: player.element,
    close: () => {
      loading.abort();
      player.pause();
    },
  };
}

class Player {
  constructor({t, format}, label) {
    this.t = t;
    this.format = format;
    this.clip = null;
    this.place = 0;
    this.timer = 0;
    this.drawing = 0;
    this.canvas = h('canvas.clip-canvas', {width: 640, height: 480, role: 'img',
      'aria-label': label});
    this.note = h('p.clip-note', {role: 'status'});
    this.button = h('button.button.clip-play', {type: 'button', onclick: () => this.toggle()});
    this.bar = h('input.clip-bar', {type: 'range', min: 0, max: 0, step: 1, value: 0,
      oninput: () => {
        this.pause();
        this.show(Number(this.bar.value));
      }});
    this.time = h('span.clip-time');
    this.controls = h('div.clip-controls', {hidden: true}, this.button, this.bar, this.time);
    this.element = h('div.clip', {onkeydown: (event) => this.key(event)},
      h('div.clip-frame', this.canvas, this.note), this.controls);
  }

  async load(address, signal) {
    const {t} = this;
    this.bar.setAttribute('aria-label', t('clip.bar'));
    write(this.note, t('clip.loading'));
    try {
      const answer = await fetch(address, {credentials: 'same-origin', signal});
      if (!answer.ok) {
        const found = await answer.json().catch(() => ({}));
        const {text, codes} = found.detail || {};
        throw new Error(said(t, text || String(answer.status), codes?.text).text);
      }
      if (Number(answer.headers.get('Content-Length')) > BYTES_MOST) {
        throw new Error(t('clip.long'));
      }
      this.open(parseAvi(await answer.arrayBuffer()));
    } catch (error) {
      if (error.name !== 'AbortError') {
        write(this.note, t('clip.broken', {text: error.message}));
      }
    }
  }

  open(clip) {
    if (!clip.frames.some((frame) => frame.length)) {
      throw new Error(this.t('clip.empty'));
    }
    this.clip = clip;
    this.bar.max = String(clip.frames.length - 1);
    this.controls.hidden = false;
    write(this.note, '');
    this.face();
    this.show(0);
  }

  /** Show a moment: its picture, or the last one before it. */
  async show(place) {
    const {frames, rateHz} = this.clip;
    this.place = Math.max(0, Math.min(frames.length - 1, place));
    this.bar.value = String(this.place);
    const text = `${this.seconds(this.place / rateHz)} / ${this.seconds(frames.length / rateHz)}`;
    write(this.time, text);
    this.bar.setAttribute('aria-valuetext', text);
    let at = this.place;
    while (at > 0 && !frames[at].length) {
      at -= 1;
    }
    const drawing = (this.drawing += 1);
    if (frames[at].length) {
      await this.draw(frames[at], drawing);
    }
    this.element.dispatchEvent(new CustomEvent('shown', {detail: {place: this.place, at}}));
  }

  async draw(frame, drawing) {
    let bitmap;
    try {
      bitmap = await createImageBitmap(new Blob([frame], {type: 'image/jpeg'}));
    } catch (error) {
      return; // one picture that is broken; the others are not
    }
    if (drawing === this.drawing) {
      this.canvas.width = bitmap.width;
      this.canvas.height = bitmap.height;
      this.canvas.getContext('2d').drawImage(bitmap, 0, 0);
    }
    bitmap.close();
  }

  seconds(value) {
    return this.format.unit(value, 's', 1);
  }

  toggle() {
    if (this.timer) {
      this.pause();
      return;
    }
    const from = this.place >= this.clip.frames.length - 1 ? 0 : this.place;
    const begunMs = performance.now();
    this.show(from);
    this.timer = setInterval(() => this.step(from, begunMs), 1000 / this.clip.rateHz);
    this.face();
  }

  step(from, begunMs) {
    const place = from + Math.round((performance.now() - begunMs) * this.clip.rateHz / 1000);
    this.show(place);
    if (place >= this.clip.frames.length - 1) {
      this.pause();
    }
  }

  pause() {
    clearInterval(this.timer);
    this.timer = 0;
    this.face();
  }

  face() {
    replace(this.button, icon(this.timer ? 'pause' : 'play'),
      h('span', this.t(this.timer ? 'clip.pause' : 'clip.play')));
  }

  key(event) {
    if (!this.clip || event.altKey || event.ctrlKey || event.metaKey) {
      return;
    }
    const wide = event.shiftKey ? Math.max(1, Math.round(this.clip.rateHz)) : 1;
    const places = {Home: 0, End: this.clip.frames.length - 1};
    if (event.key === ' ' && event.target !== this.button) {
      this.toggle();
    } else if (event.key in KEYS) {
      this.pause();
      this.show(this.place + KEYS[event.key] * wide);
    } else if (event.key in places) {
      this.pause();
      this.show(places[event.key]);
    } else {
      return;
    }
    event.preventDefault();
  }
}

// @ts-check
/** Pictures and clips that are kept: a list, and the one that is chosen. */

import {attribute, h, keep, replace, write} from '../../lib/dom.js';
import {clipOf} from '../../lib/clip.js';
import {icon} from '../../lib/icons.js';
import {notice} from '../../lib/parts.js';
import {problemElement} from '../../lib/problem.js';

const LOAD_MS = 10000;
const MOST = 100;

export class Kept {
  /**
   * @param {Object} context of the view
   * @param {string} alarm only what is of this one; '' is all
   */
  constructor(context, alarm) {
    this.context = context;
    this.alarm = alarm;
    this.robot = null;
    this.rows = [];
    this.chosen = null;
    this.player = null;
    this.list = h('ul.kept-list');
    this.shown = h('div.kept-shown');
    this.note = h('div');
    this.element = h('div.kept', this.list, this.shown, this.note);
    this.timer = setInterval(() => this.load(true), LOAD_MS);
    this.isClosed = false;
  }

  close() {
    this.isClosed = true;
    clearInterval(this.timer);
    this.player?.close();
  }

  /** Show what is kept of a robot. */
  show(robot) {
    if (robot !== this.robot) {
      this.robot = robot;
      this.rows = [];
      this.choose(null);
      this.load();
    }
  }

  async load(background = false) {
    const {api, t} = this.context;
    const {robot} = this;
    if (!robot) {
      return;
    }
    let rows;
    try {
      rows = await api.get('/api/media', {robot, alarm: this.alarm || null, limit: MOST},
        {background});
    } catch (error) {
      if (!background && !this.isClosed) {
        replace(this.note, notice('error', t('camera.list_failed'), problemElement(error, t)));
      }
      return;
    }
    if (this.isClosed || robot !== this.robot) {
      return;
    }
    this.rows = rows;
    this.draw();
    if (this.alarm && !this.chosen) {
      this.choose(rows.find((each) => each.here) || null);
    }
  }

  draw() {
    const {t} = this.context;
    replace(this.note, this.rows.length ? null
      : notice('empty', t('camera.kept_none'), t('camera.kept_none_text')));
    keep(this.list, this.rows, (row) => row.id, (row) => this.item(row),
      (element, row) => this.update(element, row));
  }

  item(row) {
    const made = h('button.kept-item', {type: 'button', onclick: () => this.choose(
      /** @type {*} */ (made).row)},
      icon(row.kind === 'clip' ? 'clip' : 'picture'),
      h('span.kept-words', h('span.kept-title'), h('span.kept-when.muted')));
    return h('li', made);
  }

  update(element, row) {
    const made = element.firstChild;
    const {t} = this.context;
    made.row = row;
    made.disabled = !row.here;
    write(made.querySelector('.kept-title'), this.title(row));
    write(made.querySelector('.kept-when'), row.here ? this.when(row) : t('camera.on_its_way'));
    attribute(made, 'aria-pressed', String(this.chosen !== null && this.chosen.id === row.id));
  }

  title(row) {
    const {t} = this.context;
    const kind = t(row.kind === 'clip' ? 'camera.clip' : 'camera.picture');
    return row.subject ? t('camera.of_person', {kind, person: row.subject}) : kind;
  }

  when(row) {
    return this.context.format.dateTime(row.t_ns / 1e6);
  }

  choose(row) {
    this.player?.close();
    this.player = null;
    this.chosen = row;
    if (!row) {
      replace(this.shown);
    } else {
      const address = `/api/media/${row.id}`;
      const label = `${this.title(row)}, ${this.when(row)}`;
      replace(this.shown, h('h3.kept-head', label), row.kind === 'clip'
        ? this.clip(address, label)
        : h('img.kept-picture', {src: address, alt: label, width: row.width || null,
          height: row.height || null}));
    }
    this.draw();
  }

  clip(address, label) {
    this.player = clipOf(this.context, address, label);
    return this.player.element;
  }
}

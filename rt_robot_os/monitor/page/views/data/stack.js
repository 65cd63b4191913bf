// @ts-check
/** All plots of a person, one above the other: one time axis, one cursor, one line of alarms. */

import {h, replace, write} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {hasKeys} from '../../lib/keys.js';
import {levelIcon} from '../../lib/parts.js';
import {LEVELS, rank} from '../../lib/alarms.js';
import {timeText} from './axis.js';
import {Gestures} from './gestures.js';
import {AXIS_WIDTH, PADDING_RIGHT} from './plot.js';

const LEAST_HEIGHT = 76;
const MOST_HEIGHT = 168;
const WRITE_MS = 250;
// Alarms that are nearer than a finger are one mark with a number.
const MARK_PX = 44;

export class Stack {
  /**
   * @param {Object} context of the page.
   * @param {import('./timeline.js').Timeline} timeline
   * @param {() => void} before what is shown is about to change by hand.
   */
  constructor(context, timeline, before) {
    this.context = context;
    this.timeline = timeline;
    this.rows = [];
    this.alarms = [];
    this.cursorTime = null;
    this.isDirty = true;
    this.frames = 0;
    this.drawn = 0;
    this.writtenMs = 0;
    this.lane = h('div.data-lane', {role: 'group', 'aria-label': context.t('data.alarms')});
    this.laneRow = h('div.data-lane-row', h('span.data-lane-name.small',
      context.t('data.alarms')), this.lane);
    this.list = h('div.data-rows');
    this.label = h('span.data-cursor-time.number');
    this.cursor = h('div.data-cursor', {hidden: true}, this.label);
    this.choice = h('div.data-choice', {hidden: true});
    this.element = h('div.data-stack', {tabindex: '0', role: 'group', 'aria-label':
      context.t('data.plots'), 'aria-describedby': hasKeys() && 'data-keys'}, this.laneRow, this.list,
    this.cursor, this.choice);
    this.gestures = new Gestures(this.element, timeline, {
      box: () => this.box(), cursor: (x) => this.showCursor(x),
      choose: (from, to) => this.showChoice(from, to), before});
    this.sized = new ResizeObserver(() => this.build());
    this.sized.observe(this.list);
    this.seen = new IntersectionObserver((found) => found.forEach((each) => {
      const row = this.rows.find(({element}) => element === each.target);
      if (row) {
        row.isSeen = each.isIntersecting;
        this.isDirty = true;
      }
    }));
    this.frame = requestAnimationFrame(() => this._frame());
  }

  close() {
    cancelAnimationFrame(this.frame);
    this.sized.disconnect();
    this.seen.disconnect();
    this.gestures.close();
    this.rows.forEach((row) => row.plot.destroy());
  }

  /** Show these rows. */
  show(rows) {
    this.rows.filter((row) => !rows.includes(row)).forEach((row) => row.plot.destroy());
    this.rows = rows;
    this.seen.disconnect();
    replace(this.list, rows.map((row) => row.element));
    rows.forEach((row) => this.seen.observe(row.element));
    this.width = 0;
    this.build();
  }

  /** Make the plots as large as there is room; also after a change of the theme. */
  build(force = false) {
    const first = this.rows[0];
    const width = first ? Math.floor(first.canvas.clientWidth) : 0;
    const height = this._height();
    if (!width || (!force && width === this.width && height === this.height)) {
      return;
    }
    this.width = width;
    this.height = height;
    this.rows.forEach((row, index) => row.build(width, height, index === 0));
    this.isDirty = true;
    this.drawLane();
  }

  /** Where times are, from the left of the stack, in CSS pixels. */
  box() {
    const first = this.rows[0];
    const left = first ? first.canvas.getBoundingClientRect().left
      - this.element.getBoundingClientRect().left : 0;
    return {left: left + AXIS_WIDTH, width: Math.max(1, (this.width || 1) - AXIS_WIDTH
      - PADDING_RIGHT)};
  }

  /** Mark alarms: {robot, id, level, t, title}. */
  mark(alarms) {
    this.alarms = alarms;
    this.rows.forEach((row) => {
      row.plot.alarms = alarms;
    });
    this.isDirty = true;
    this.drawLane();
  }

  _height() {
    const count = Math.max(1, this.rows.length);
    const room = innerHeight - this.element.getBoundingClientRect().top - 128;
    const isNarrow = this.element.clientWidth < 720;
    return Math.round(Math.min(MOST_HEIGHT, Math.max(LEAST_HEIGHT, room / count
      - (isNarrow ? 36 : 1))));
  }

  _frame() {
    this.frame = requestAnimationFrame(() => this._frame());
    this.frames += 1;
    const {timeline} = this;
    const moved = timeline.tick(this.box_ || 800);
    const force = this.isDirty;
    this.isDirty = false;
    const present = timeline.now();
    let drawn = false;
    for (const row of this.rows) {
      drawn = row.draw(timeline.start, timeline.end, present, force) || drawn;
    }
    this.drawn += Number(drawn);
    if (moved || force) {
      this.placeLane();
    }
    const now = performance.now();
    if (now - this.writtenMs > WRITE_MS) {
      this.writtenMs = now;
      this._write();
    }
  }

  _write() {
    this.box_ = this.box().width;
    const now = this.timeline.now();
    for (const row of this.rows) {
      row.writeNow(now);
    }
    this.writeCursor();
  }

  /** What is shown of time has changed. */
  changed() {
    this.isDirty = true;
    this.drawLane();
    this.writeCursor();
  }

  showCursor(x) {
    const {left, width} = this.box();
    const isThere = x !== null && x >= left && x <= left + width;
    this.cursorX = isThere ? (x - left) / width : null;
    this.writeCursor();
  }

  writeCursor() {
    const {timeline, cursorX} = this;
    const isThere = cursorX !== null && cursorX !== undefined && this.rows.length > 0;
    this.cursor.hidden = !isThere;
    this.cursorTime = isThere ? timeline.start + cursorX * timeline.span : null;
    if (isThere) {
      const {left, width} = this.box();
      this.cursor.style.transform = `translateX(${Math.round(left + cursorX * width)}px)`;
      this.cursor.classList.toggle('is-right', cursorX > 0.85);
      write(this.label, timeText(this.cursorTime, timeline.span,
        this.context.t.words.locale));
    }
    for (const row of this.rows) {
      row.writeThere(this.cursorTime, Math.max(row.columns.bucketMs * 2, timeline.span / 60));
    }
  }

  showChoice(from, to) {
    this.choice.hidden = to === null;
    if (to !== null) {
      this.choice.style.left = `${Math.min(from, to)}px`;
      this.choice.style.width = `${Math.abs(to - from)}px`;
    }
  }

  /** Put the alarms above the plots, those that are near each other as one. */
  drawLane() {
    const {start, end, span} = this.timeline;
    const shown = this.alarms.filter(({t}) => t >= start && t <= end).sort((a, b) => a.t - b.t);
    const near = (span * MARK_PX) / Math.max(1, this.box().width);
    const groups = [];
    for (const each of shown) {
      const last = groups[groups.length - 1];
      if (last && each.t - last[0].t < near) {
        last.push(each);
      } else {
        groups.push([each]);
      }
    }
    const key = groups.map((group) => group.map(({robot, id, level}) => `${robot}/${id}/${level}`)
      .join()).join(';');
    if (key !== this.laneKey) {
      this.laneKey = key;
      this.marks = groups.map((group) => ({t: group[0].t, element: this._mark(group)}));
      replace(this.lane, this.marks.map(({element}) => element));
    }
    this.laneRow.classList.toggle('is-empty', !groups.length);
    this.placeLane();
  }

  placeLane() {
    const {start, span} = this.timeline;
    const {width} = this.box();
    for (const {t, element} of this.marks || []) {
      element.style.transform = `translateX(${AXIS_WIDTH + ((t - start) / span) * width}px)`;
    }
  }

  _mark(group) {
    const worst = group.reduce((a, b) => (rank(b.level) > rank(a.level) ? b : a));
    const level = LEVELS.includes(worst.level) ? worst.level : 'warning';
    const title = group.length === 1 ? worst.title
      : this.context.t('data.alarms_here', {n: group.length, title: worst.title});
    const where = `#/alarms/${encodeURIComponent(worst.robot)}/${encodeURIComponent(worst.id)}`;
    const onclick = (event) => {
      if (group.length > 1) {
        event.preventDefault();
        const times = group.map(({t}) => t);
        const pad = Math.max(30_000, (Math.max(...times) - Math.min(...times)) * 0.3);
        this.timeline.show(Math.min(...times) - pad, Math.max(...times) + pad);
      }
    };
    return h(`a.data-mark.data-mark-${level}`, {href: where, title, 'aria-label': title, onclick},
      icon(levelIcon(level)), group.length > 1 && h('span.number', group.length));
  }
}

// @ts-check
/** One alarm: what it is, what to do, pictures, and everything that happened, in order. */

import {pictures} from './pictures.js';
import {timeline} from './timeline.js';
import {acknowledgeButton, cancelAlarm, confirmAlarm, escalate, nameButtons, resolve, submitNote}
  from '../../lib/alarm_actions.js';
import {stateText, whereOf} from '../../lib/alarm_words.js';
import {isLoud, isOpen, kindsText, openedNs} from '../../lib/alarms.js';
import {framed, h, replace, tone, write} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {badge, button, levelIcon, notice} from '../../lib/parts.js';
import {saidElement, saidOf} from '../../lib/said.js';

// What is live comes before it is stored; asked for again once a second.
const ASKED_MOST = 30;

export class Detail {
  /**
   * @param {HTMLElement} pane
   * @param {Object} context
   * @param {string} chosen 'robot/id', or ''
   */
  constructor(pane, context, chosen) {
    this.pane = pane;
    this.context = context;
    const cut = chosen.indexOf('/');
    this.robot = cut < 0 ? '' : chosen.slice(0, cut);
    this.id = chosen.slice(cut + 1);
    this.known = null;
    this.isGone = false;
    this.again = framed(() => this.load());
    /** @type {HTMLElement & {age?: ?HTMLElement}} */
    this.head = h('div.alarm-head');
    this.note = noteForm(context, () => this.current(), () => this.load());
    this.media = h('div.alarm-pictures');
    this.line = h('div');
    if (!this.id) {
      replace(pane, notice('empty', context.t('alarms.select'), context.t('alarms.select_text')));
      return;
    }
    const mayNote = context.permissions.has('acknowledge');
    replace(pane, this.head, this.media, h('section.section', h('h2', context.t('alarms.history')),
      this.line), mayNote && this.note);
    replace(this.line, notice('loading', context.t('alarms.loading')));
    this.load();
  }

  current() {
    const live = this.context.state.alarms.get(`${this.robot}/${this.id}`);
    return live || this.known ? {...this.known, ...live} : null;
  }

  /** Show what is new; a change of this alarm brings its time line anew. */
  show(kind) {
    if (!this.id) {
      return;
    }
    const alarm = this.current();
    const key = alarm && JSON.stringify([alarm.state, alarm.level, alarm.kinds, alarm.by, alarm.t_ns,
      alarm.event, alarm.text, whereOf(this.context, alarm)]);
    if (alarm && key !== this.shown) {
      this.shown = key;
      head(this.head, alarm, this.context);
      if (this.known) {
        this.again();
      }
    }
    if (alarm && this.head.age) {
      const ageS = (this.context.state.nowNs() - openedNs(alarm)) / 1e9;
      write(this.head.age, this.context.format.ago(ageS));
    }
    if (kind === 'tick' && alarm && (this.isGone || this.isBehind(alarm))) {
      this.load();
    }
  }

  /** Whether an event is live and not stored yet; of one that is never stored we stop to ask. */
  isBehind({seq = 0}) {
    if (!this.known || !(seq > (this.known.events?.at(-1)?.seq ?? 0))) {
      return false;
    }
    this.asked = seq === this.behind ? this.asked + 1 : 1;
    this.behind = seq;
    return this.asked <= ASKED_MOST;
  }

  async load() {
    const {api, t} = this.context;
    const path = `/api/alarms/${encodeURIComponent(this.robot)}/${encodeURIComponent(this.id)}`;
    try {
      this.known = await api.get(path);
      this.isGone = false;
      timeline(this.line, this.known, this.context);
      pictures(this.media, this.known, this.context);
      this.show('loaded');
    } catch (error) {
      this.isGone = true;
      const isHere = this.current() !== null;
      replace(this.line, isHere ? notice('empty', t('alarms.no_history'),
        t('alarms.no_history_text')) : notice('error', t('alarms.not_found'),
        t('alarms.not_found_text')));
    }
  }

  close() {
    this.again.stop();
  }
}

function head(element, alarm, context) {
  const {t, format} = context;
  const isOver = !isOpen(alarm);
  element.age = isOver ? null : h('span.number');
  const level = badge(isOver ? 'none' : alarm.level, t.word('level', alarm.level),
    levelIcon(alarm.level));
  const state = badge(isLoud(alarm) ? alarm.level : isOver ? 'none' : 'ok', stateText(alarm, t));
  const robot = context.state.robots.get(alarm.robot);
  const rows = [
    [t('alarms.opened'), h('span.number', format.dateTime(openedNs(alarm) / 1e6), !isOver && ' · '), element.age],
    [t('alarms.robot'), robot?.name || alarm.robot],
    [t('alarms.where'), where(alarm, context)],
    [t('alarms.told'), channels(alarm.told, t)],
    [t('alarms.failed'), channels(alarm.failed, t)],
  ];
  tone(element, 'edge', isOver ? 'none' : alarm.level);
  replace(element, h('a.button.quiet.alarm-back', {href: '#/alarms'}, icon('back'),
    t('shell.view_alarms')), h('h2.alarm-title', `${alarm.subject} – ${kindsText(alarm, t)}`),
  h('p.alarm-badges', level, state), alarm.text && saidElement(saidOf(t, alarm, 'text'), 'p'), h('dl.facts', rows.filter(
    ([, value]) => value).map(([name, ...value]) => [h('dt', name), h('dd', value)])),
  h('div.alarm-actions', actions(alarm, context)));
  nameButtons(element, context, alarm);
}

function actions(alarm, context) {
  const {t, permissions} = context;
  if (!permissions.has('acknowledge') || !isOpen(alarm)) {
    return null;
  }
  const isSuspected = alarm.state === 'suspected';
  return [
    isLoud(alarm) && acknowledgeButton(context, alarm, {kind: 'primary', icon: 'check'}),
    isSuspected && button(t('alarms.confirm'), () => confirmAlarm(context, alarm),
      {kind: 'danger', icon: 'urgent'}),
    isSuspected && button(t('alarms.cancel'), () => cancelAlarm(context, alarm)),
    alarm.state === 'raised' && button(t('alarms.escalate'), () => escalate(context, alarm),
      {icon: 'phone'}),
    !isSuspected && button(t('alarms.resolve'), () => resolve(context, alarm)),
  ];
}

function where(alarm, context) {
  const {t, permissions} = context;
  const words = isOpen(alarm) ? whereOf(context, alarm) : alarm.node && t.word('room', alarm.node);
  const isPlaced = Number.isFinite(Number(alarm.x)) && alarm.x !== null && alarm.x !== undefined;
  if (!isPlaced || !permissions.has('see')) {
    return words;
  }
  return h('a', {href: `#/position/${encodeURIComponent(alarm.robot)}`},
    words || t('shell.view_position'));
}

function channels(names, t) {
  const found = Array.isArray(names) ? names : String(names || '').split(' ').filter(Boolean);
  return found.map((each) => t.word('channel', each)).join(', ');
}

function noteForm(context, current, done) {
  const {t} = context;
  const input = h('input', {type: 'text', maxlength: 500, 'aria-label': t('alarms.note'),
    placeholder: t('alarms.note_write'), autocomplete: 'off'});
  const form = h('form.note-form', input, h('button.button', {type: 'submit'}, icon('note'),
    t('alarms.note_add')));
  form.onsubmit = (event) => {
    event.preventDefault();
    if (current()) {
      submitNote(context, form, current(), done, () => {
        input.value = '';
      });
    }
  };
  return form;
}


// @ts-check
/** What people do about an alarm: acknowledge with one tap, then perhaps a note; resolve; confirm. */

import {nameOf} from './alarm_words.js';
import {kindsText} from './alarms.js';
import {ask} from './dialog.js';
import {attribute, h} from './dom.js';
import {busy, button} from './parts.js';
import {attempt} from './problem.js';
import {toast} from './toast.js';

// For this long a stored note can be withdrawn here; the server allows a minute.
const UNDO_MS = 10000;
const NOTE_SHOWN_MS = 20000;

/** Acknowledge at once; whoever wants may add a note afterwards. */
export async function acknowledge(context, alarm) {
  if (await order(context, alarm, 'acknowledge')) {
    offerNote(context, alarm);
  }
}

/**
 * The button that acknowledges an alarm; nameButtons() gives it its name.
 * @param {Object} context
 * @param {Object} alarm
 * @param {Object} [how] as of button()
 * @param {string} [says] the message of its name
 */
export function acknowledgeButton(context, alarm, how = {}, says = 'alarms.acknowledge_which') {
  const made = button(context.t('alarms.acknowledge'), () => acknowledge(context, alarm), how);
  made.dataset.says = says;
  return made;
}

/** Name what acts on an alarm within an element after the alarm: no two are read out alike. */
export function nameButtons(element, context, alarm) {
  const found = element.querySelectorAll('[data-says]');
  const what = found.length && nameOf(context, alarm);
  found.forEach((each) => attribute(each, 'aria-label', context.t(each.dataset.says, {what})));
}

/** Say that it is over, with a reason. */
export async function resolve(context, alarm) {
  const {t} = context;
  const reason = await ask({title: t('alarms.resolve_title', {what: named(context, alarm)}),
    text: t('alarms.resolve_text'), label: t('alarms.reason'), yes: t('alarms.resolve'),
    no: t('shell.cancel')});
  if (reason !== null && await order(context, alarm, 'resolve', reason)) {
    toast(t('alarms.resolved'));
  }
}

/** Say that a suspicion is true: it is told to people at once. */
export async function confirmAlarm(context, alarm) {
  if (await order(context, alarm, 'confirm')) {
    toast(context.t('alarms.confirmed'));
  }
}

/** Have the next step of the escalation told now. */
export async function escalate(context, alarm) {
  if (await order(context, alarm, 'escalate')) {
    toast(context.t('alarms.escalated'));
  }
}

/** Say that a suspicion is none. */
export async function cancelAlarm(context, alarm) {
  const {t} = context;
  const reason = await ask({title: t('alarms.cancel_title', {what: named(context, alarm)}),
    text: t('alarms.cancel_text'), label: t('alarms.reason'), yes: t('alarms.cancel'),
    no: t('shell.back')});
  if (reason !== null && await order(context, alarm, 'cancel', reason)) {
    toast(t('alarms.cancelled'));
  }
}

/**
 * Store a note at once; for a moment it can be withdrawn.
 * @param {Object} context
 * @param {Object} alarm
 * @param {string} text
 * @param {function(): void} [done] called when it is stored, and when it is withdrawn
 * @returns {Promise<boolean>} whether it is stored; else the reader has been told
 */
export async function addNote(context, alarm, text, done = () => {}) {
  const {t, api} = context;
  const path = `/api/alarms/${encodeURIComponent(alarm.robot)}/${encodeURIComponent(alarm.id)}/notes`;
  const stored = await attempt(() => api.post(path, {text}), t);
  if (stored === null) {
    return false;
  }
  done();
  const close = toast(t('alarms.note_kept', {text}), {shownMs: UNDO_MS, action: button(
    t('shell.undo'), async () => {
      if (await attempt(() => api.delete(`${path}/${stored.id}`), t) !== null) {
        close();
        toast(t('alarms.note_withdrawn'));
        done();
      }
    }, {kind: 'quiet'})});
  return true;
}

/** Which alarm, in a few words. */
export function named(context, alarm) {
  return `${alarm.subject}: ${kindsText(alarm, context.t)}`;
}

async function order(context, alarm, verb, reason = '') {
  const found = await attempt(() => context.command(alarm.robot, 'alarm',
    {verb, alarm: String(alarm.id), reason}), context.t);
  return found !== null;
}

function offerNote(context, alarm) {
  const {t} = context;
  const input = h('input', {type: 'text', maxlength: 500, placeholder: t('alarms.note_hint'),
    'aria-label': t('alarms.note')});
  const form = h('form.toast-form', input, h('button.button', {type: 'submit', 'aria-label':
    t('alarms.note_add_which', {what: nameOf(context, alarm)})}, t('alarms.note_add')));
  const close = toast(t('alarms.acknowledged', {what: named(context, alarm)}),
    {action: form, shownMs: NOTE_SHOWN_MS});
  form.onsubmit = (event) => {
    event.preventDefault();
    submitNote(context, form, alarm, () => context.state.tell('alarms',
      {alarms: [alarm], before: alarm, isFirst: false}), close);
  };
}

/** Store what stands in a form of a note; it stays there until it is stored. */
export function submitNote(context, form, alarm, done, stored) {
  const [input, submit] = form.querySelectorAll('input, button');
  const text = input.value.trim();
  if (!text) {
    stored();
    return;
  }
  busy(submit, async () => {
    if (await addNote(context, alarm, text, done)) {
      stored();
    }
  });
}

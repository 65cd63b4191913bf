/** What people do about an alarm: acknowledge with one tap, then perhaps a note; resolve; confirm. */

import {kindsText} from './alarms.js';
import {ask} from './dialog.js';
import {h} from './dom.js';
import {button} from './parts.js';
import {attempt} from './problem.js';
import {toast} from './toast.js';

// A note can be taken back for so long.
const UNDO_MS = 6000;
const NOTE_SHOWN_MS = 20000;

/** Acknowledge at once; whoever wants may add a note afterwards. */
export async function acknowledge(context, alarm) {
  if (await order(context, alarm, 'acknowledge')) {
    offerNote(context, alarm);
  }
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

/** Keep a note after a moment in which it can be taken back; done is called when it is kept. */
export function keepNote(context, alarm, text, done = () => {}) {
  const {t} = context;
  let isUndone = false;
  const path = `/api/alarms/${encodeURIComponent(alarm.robot)}/${encodeURIComponent(alarm.id)}/notes`;
  const send = async () => {
    if (!isUndone && await attempt(() => context.api.post(path, {text}), t) !== null) {
      done();
    }
  };
  const close = toast(t('alarms.note_kept', {text}), {shownMs: UNDO_MS, action: button(
    t('shell.undo'), () => {
      isUndone = true;
      close();
    }, {kind: 'quiet'})});
  setTimeout(send, UNDO_MS);
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
  const form = h('form.toast-form', input, h('button.button', {type: 'submit'},
    t('alarms.note_add')));
  const close = toast(t('alarms.acknowledged', {what: named(context, alarm)}),
    {action: form, shownMs: NOTE_SHOWN_MS});
  form.onsubmit = (event) => {
    event.preventDefault();
    const text = input.value.trim();
    close();
    if (text) {
      keepNote(context, alarm, text, () => context.state.tell('alarms',
        {alarms: [alarm], before: alarm, isFirst: false}));
    }
  };
}

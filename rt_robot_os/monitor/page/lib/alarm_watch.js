// @ts-check
/** Make alarms heard and seen outside of the page: read out, sound, notification, title, icon. */

import {isLoud, kindsText, rank} from './alarms.js';
import {notify} from './notification.js';
import {saidOf} from './said.js';
import {announce} from './toast.js';

/** Watch the alarms of a context; returns what ends it. */
export function watchAlarms(context) {
  const told = new Set();
  let isNew = true;
  const take = (kind, {alarms, before, isFirst}) => {
    show(context);
    if (isFirst && isNew) {
      isNew = false;
      begin(context, alarms, told);
      return;
    }
    // After a reconnection: what came meanwhile has nothing before it, and is told now.
    for (const alarm of alarms) {
      if (isNews(alarm, before) && !told.has(signature(alarm))) {
        told.add(signature(alarm));
        tell(context, alarm);
      } else if (before && before.state !== alarm.state) {
        announce(sentence(context, alarm));
      }
    }
  };
  show(context);
  const off = context.state.on('alarms', take);
  return () => {
    off();
    context.sound.alarm(null);
  };
}

/** Of those that are open already only the worst is read out. */
function begin(context, alarms, told) {
  alarms.forEach((each) => told.add(signature(each)));
  const [worst] = context.state.openAlarms().filter(isLoud);
  if (worst) {
    announce(sentence(context, worst), true);
  }
}

function signature(alarm) {
  return [alarm.robot, alarm.id, alarm.state, alarm.level, String(alarm.kinds)].join('/');
}

function isNews(alarm, before) {
  return isLoud(alarm) && (!before || before.state !== alarm.state
    || rank(alarm.level) > rank(before.level) || String(before.kinds) !== String(alarm.kinds));
}

/** An alarm as a sentence. */
export function sentence({t}, alarm) {
  return t('shell.alarm_said', {level: t.word('level', alarm.level), subject: alarm.subject,
    kinds: kindsText(alarm, t), state: t.word('state', alarm.state)});
}

function tell(context, alarm) {
  announce(sentence(context, alarm), true);
  if (document.hidden && context.settings.notify) {
    notify(`${context.t.word('level', alarm.level)}: ${alarm.subject}`, {
      body: [kindsText(alarm, context.t), saidOf(context.t, alarm, 'text').text].filter(Boolean).join('\n'),
      tag: `${alarm.robot}/${alarm.id}`, renotify: true, requireInteraction: alarm.level === 'critical',
    }, `#/alarms/${encodeURIComponent(alarm.robot)}/${encodeURIComponent(alarm.id)}`);
  }
}

function show(context) {
  const loud = context.state.openAlarms().filter(isLoud);
  context.sound.alarm(loud.length ? loud[0].level : null);
  context.setBadge(loud.length, loud.length
    ? `${loud[0].subject}: ${kindsText(loud[0], context.t)}` : '');
}

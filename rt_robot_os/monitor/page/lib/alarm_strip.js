/**
 * The line under the head of each view: calm when nothing is open, else the worst alarm with what
 * to do about it. It is always there, so that nothing moves when an alarm comes.
 */

import {acknowledge, confirmAlarm} from './alarm_actions.js';
import {isLoud, kindsText, openedNs} from './alarms.js';
import {framed, h, replace, tone, write} from './dom.js';
import {icon} from './icons.js';
import {button, levelIcon} from './parts.js';

/**
 * Make the line.
 * @returns {{element: HTMLElement, close: function(): void}}
 */
export function alarmStrip(context) {
  const element = h('section.strip.strip-unknown', {'aria-label': context.t('shell.alarm_line')});
  const age = h('span.strip-age');
  let shown = null;
  const draw = framed(() => {
    const open = context.state.openAlarms();
    const key = keyOf(context, open);
    if (key !== shown) {
      shown = key;
      tone(element, 'strip', kind(context, open));
      replace(element, ...(open.length ? loud(context, open, age) : calm(context)));
    }
    if (open.length) {
      const ageS = (context.state.nowNs() - openedNs(open[0])) / 1e9;
      write(age, context.format.ago(ageS));
    }
  });
  const off = context.state.on('alarms robots connection tick', draw);
  draw();
  return {element, close: () => {
    draw.stop();
    off();
  }};
}

function kind(context, open) {
  if (!open.length) {
    return context.state.isKnown ? 'calm' : 'unknown';
  }
  return isLoud(open[0]) ? open[0].level : `taken-${open[0].level}`;
}

function keyOf(context, open) {
  const [worst] = open;
  return JSON.stringify([context.state.isKnown, context.live.isOpen, open.length,
    open.filter(isLoud).length, worst && [worst.robot, worst.id, worst.state, worst.level, worst.kinds,
      worst.text, worst.by], worst ? null : robotsUp(context)]);
}

function robotsUp(context) {
  const robots = [...context.state.robots.values()];
  return [robots.filter((each) => each.connected).length, robots.length];
}

function calm(context) {
  const {t, state} = context;
  if (!state.isKnown) {
    return [icon('clock'), h('p.strip-words', t('shell.connecting'))];
  }
  const [up, all] = robotsUp(context);
  return [icon('check'), h('p.strip-words', h('strong', t('shell.no_alarm')),
    h('span.strip-more', all ? t('shell.robots_up', {n: all, up}) : t('shell.no_robot')))];
}

function loud(context, open, age) {
  const {t} = context;
  const [worst] = open;
  const state = t.word('state', worst.state) + (worst.state === 'acknowledged' && worst.by
    ? ` (${worst.by})` : '');
  const words = h('p.strip-words', h('strong', `${t.word('level', worst.level)}: ${worst.subject} – ${
    kindsText(worst, t)}`), h('span.strip-more', [state, worst.text].filter(Boolean).join(' · ')));
  const others = open.length > 1 && h('a.strip-others', {href: '#/alarms'},
    t('shell.more_alarms', {n: open.length - 1}));
  return [icon(levelIcon(worst.level)), words, age, others, h('div.strip-actions',
    actions(context, worst))];
}

function actions(context, alarm) {
  const {t} = context;
  const show = h('a.button', {href: `#/alarms/${encodeURIComponent(alarm.robot)}/${
    encodeURIComponent(alarm.id)}`}, t('shell.show'));
  if (!context.permissions.has('acknowledge') || !isLoud(alarm)) {
    return [show];
  }
  const first = alarm.state === 'suspected'
    ? button(t('alarms.confirm'), () => confirmAlarm(context, alarm)) : null;
  return [show, first, button(t('alarms.acknowledge'), () => acknowledge(context, alarm),
    {kind: 'primary', icon: 'check'})];
}

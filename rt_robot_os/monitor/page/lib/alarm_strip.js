// @ts-check
/**
 * The line under the head of each view: the worst alarm with what to do about it; without one calm,
 * but only while alarms would be known. It is always there, so that nothing moves when an alarm
 * comes.
 */

import {acknowledgeButton, confirmAlarm, nameButtons} from './alarm_actions.js';
import {stateText, titleOf, whereOf} from './alarm_words.js';
import {isLoud, openedNs} from './alarms.js';
import {framed, h, replace, tone, write} from './dom.js';
import {icon} from './icons.js';
import {outageOf, outageWords, robotsUp} from './outage.js';
import {button, levelIcon} from './parts.js';
import {saidElement, saidOf} from './said.js';

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
    const outage = outageOf(context.state);
    const key = keyOf(context, open, outage);
    if (key !== shown) {
      shown = key;
      tone(element, 'strip', kind(open, outage));
      replace(element, ...(open.length ? loud(context, open, outage, age)
        : outage ? unknown(context, outage) : calm(context)));
    }
    if (open.length) {
      const ageS = (context.state.nowNs() - openedNs(open[0])) / 1e9;
      write(age, context.format.ago(ageS));
      nameButtons(element, context, open[0]);
    }
  });
  const off = context.state.on('alarms robots server connection tick', draw);
  draw();
  return {element, close: () => {
    draw.stop();
    off();
  }};
}

// The worse of what can be unknown is shown like a technical alarm.
const OUTAGES = {start: 'unknown', none: 'unknown', storing: 'partly', server: 'outage'};

function kind(open, outage) {
  if (open.length) {
    return isLoud(open[0]) ? open[0].level : `taken-${open[0].level}`;
  }
  return outage ? OUTAGES[outage.kind] || 'outage' : 'calm';
}

function keyOf(context, open, outage) {
  const {state, silence, sound} = context;
  const [worst] = open;
  return JSON.stringify([outage && [outage.kind, outage.kind === 'server' && outage.sinceMs,
    outage.away.map((each) => each.name), sound.isWanted && silence.sounds(outage)], open.length,
  open.filter(isLoud).length, worst && [worst.robot, worst.id, worst.state, worst.level,
    worst.kinds, worst.text, worst.by, whereOf(context, worst)], worst ? null : robotsUp(state)]);
}

function calm({t, state}) {
  const [up, n] = robotsUp(state);
  return [icon('check'), h('p.strip-words', h('strong', t('shell.no_alarm')),
    h('span.strip-more', t('shell.robots_up', {n, up})))];
}

function unknown(context, outage) {
  const {t, silence} = context;
  const {title, text} = outageWords(outage, context);
  const hush = context.sound.isWanted && silence.sounds(outage) && h('div.strip-actions', button(t('shell.silence'), () => {
    silence.silence(outage);
    context.state.tell('connection');
  }, {icon: 'muted'}));
  return [icon(outage.kind === 'start' ? 'clock' : outage.kind === 'storing' ? 'warn' : 'offline'),
    h('p.strip-words', h('strong', title), text && h('span.strip-more', text)), hush];
}

function loud(context, open, outage, age) {
  const {t} = context;
  const [worst] = open;
  const about = saidOf(t, worst, 'text');
  const lost = outage?.kind === 'server' && outageWords(outage, context).text;
  const words = h('p.strip-words', h('strong', titleOf(context, worst)), h('span.strip-more',
    [lost, whereOf(context, worst), stateText(worst, t)].filter(Boolean).join(' · '),
    about.text && [' · ', saidElement(about)]));
  const others = open.length > 1 && h('a.strip-others', {href: '#/alarms'},
    t('shell.more_alarms', {n: open.length - 1}));
  return [icon(levelIcon(worst.level)), words, age, others, h('div.strip-actions',
    actions(context, worst))];
}

function actions(context, alarm) {
  const {t} = context;
  const show = h('a.button', {href: `#/alarms/${encodeURIComponent(alarm.robot)}/${
    encodeURIComponent(alarm.id)}`, 'data-says': 'shell.show_which'}, t('shell.show'));
  if (!context.permissions.has('acknowledge') || !isLoud(alarm)) {
    return [show];
  }
  const first = alarm.state === 'suspected'
    ? button(t('alarms.confirm'), () => confirmAlarm(context, alarm)) : null;
  return [show, first, acknowledgeButton(context, alarm, {kind: 'primary', icon: 'check'},
    'shell.acknowledge_worst')];
}

// @ts-check
/** The list of alarms: each a link to its time line, with the button to acknowledge it. */

import {acknowledgeButton, nameButtons} from '../../lib/alarm_actions.js';
import {stateText, titleOf, whereOf} from '../../lib/alarm_words.js';
import {isLoud, isOpen, openedNs} from '../../lib/alarms.js';
import {attribute, h, keep, replace, tone, write} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {outageOf, outageWords} from '../../lib/outage.js';
import {levelIcon, notice} from '../../lib/parts.js';
import {problemElement} from '../../lib/problem.js';
import {saidOf, writeSaid} from '../../lib/said.js';

/**
 * Show alarms.
 * @param {HTMLElement & {rows?: HTMLElement, note?: HTMLElement}} element
 * @param {Object} context
 * @param {Array} alarms in their order
 * @param {{isAll: boolean, chosen: string, isLoading: boolean, problem: ?Error}} how
 */
export function list(element, context, alarms, how) {
  if (!element.rows) {
    element.rows = h('ul.alarm-rows');
    element.note = h('div');
    replace(element, element.rows, element.note);
  }
  keep(element.rows, alarms, keyOf, (alarm) => row(alarm),
    (item, alarm) => update(item, alarm, context, how.chosen), true);
  element.rows.hidden = !alarms.length;
  explain(element.note, context, alarms, how);
}

function keyOf(alarm) {
  return `${alarm.robot}/${alarm.id}`;
}

/** The address of an alarm's time line. */
export function addressOf(alarm) {
  return `#/alarms/${encodeURIComponent(alarm.robot)}/${encodeURIComponent(alarm.id)}`;
}

function row(alarm) {
  const parts = {title: h('strong'), state: h('span'), about: h('span'), when: h('span.alarm-when.number'),
    mark: h('span.alarm-mark'), act: h('div.alarm-act')};
  parts.link = h('a.alarm-link', {href: addressOf(alarm)}, parts.mark, h('span.alarm-words',
    parts.title, h('span.alarm-text', parts.state, parts.about), parts.when));
  const made = h('li.alarm-row', parts.link, parts.act);
  return Object.assign(made, {parts});
}

function update(item, alarm, context, chosen) {
  const {t, format, state, permissions} = context;
  const {parts} = item;
  const isOver = !isOpen(alarm);
  const isChosen = keyOf(alarm) === chosen;
  tone(item, 'tone', isLoud(alarm) ? alarm.level : 'plain');
  item.classList.toggle('is-over', isOver);
  attribute(parts.link, 'aria-current', isChosen ? 'true' : null);
  write(parts.title, titleOf(context, alarm));
  const about = saidOf(t, alarm, 'text');
  write(parts.state, [!isOver && whereOf(context, alarm), stateText(alarm, t),
    about.text && ' '].filter(Boolean).join(' · '));
  writeSaid(parts.about, about);
  const began = openedNs(alarm) / 1e6;
  const ageS = state.nowNs() / 1e9 - began / 1e3;
  write(parts.when, isOver ? format.time(began, false)
    : `${format.time(began, false)} · ${format.ago(ageS)}`);
  const key = `${alarm.state}${alarm.level}`;
  if (item.dataset.key !== key) {
    item.dataset.key = key;
    replace(parts.mark, icon(isOver ? 'check' : levelIcon(alarm.level)));
    // Of the chosen one it stands with all else that can be done, at its time line.
    replace(parts.act, isLoud(alarm) && !isChosen && permissions.has('acknowledge')
      && acknowledgeButton(context, alarm));
  }
  nameButtons(parts.act, context, alarm);
}

function explain(element, context, alarms, {isAll, isLoading, problem}) {
  const {t} = context;
  const outage = outageOf(context.state);
  const key = isLoading ? 'loading' : problem && isAll ? 'problem' : alarms.length ? ''
    : isAll ? 'none_ever' : outage ? `outage_${outage.kind}` : 'none_open';
  if (element.dataset.key === key) {
    return;
  }
  element.dataset.key = key;
  replace(element, key === 'loading' ? notice('loading', t('shell.loading'))
    : key === 'problem' ? notice('error', t('alarms.no_past'), problemElement(problem, t))
      : key.startsWith('outage') ? outageNotice(context, outage)
      : key === 'none_open' ? notice('calm', t('alarms.none_open'), t('alarms.none_open_text'))
        : key && notice('empty', t('alarms.none_ever'), t('alarms.none_ever_text')));
}

function outageNotice(context, outage) {
  const {title, text} = outageWords(outage, context);
  return notice(outage.kind === 'start' ? 'loading' : 'offline', title, text);
}

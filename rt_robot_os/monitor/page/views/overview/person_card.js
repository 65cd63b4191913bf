// @ts-check
/** A person: how they are in words, score, last signs with age and quality, place, alarms. */

import {acknowledgeButton, nameButtons} from '../../lib/alarm_actions.js';
import {stateText, titleOf, whereOf} from '../../lib/alarm_words.js';
import {isLoud, openedNs} from '../../lib/alarms.js';
import {attribute, h, keep, replace, tone, write} from '../../lib/dom.js';
import {DECIMALS, isReached, news2Of, placeOf, riskTone, signsOf, STALE_S}
  from '../../lib/health.js';
import {icon} from '../../lib/icons.js';
import {badge, levelIcon, setBadge} from '../../lib/parts.js';
import {drawSpark, sparkline} from '../../lib/spark.js';

// A value is of now.
const FRESH_S = 5;
// Signs that a card has a place for, whether they are measured or not: nothing jumps.
const SHOWN = ['pulse_per_min', 'spo2_percent', 'respiration_per_min', 'body_temperature',
  'systolic_mmhg'];
// The least range of values that a small line shows.
const SPANS = {pulse_per_min: 20, spo2_percent: 6, respiration_per_min: 6, body_temperature: 1,
  systolic_mmhg: 30};
const ICONS = {critical: 'critical', urgent: 'urgent', suspected: 'urgent', warning: 'warn',
  taken: 'person', technical: 'technical', unreached: 'offline', old_signs: 'clock', well: 'check',
  no_score: 'info', risk_some: 'warn', no_signs: 'info', risk_high: 'critical', risk_medium: 'urgent'};

/** Make the card of a person. */
export function personCard(context, person) {
  const {t, permissions} = context;
  const made = h('article.card.person', {'aria-label': person});
  const mayHealth = permissions.has('health');
  const parts = {state: badge('none', ''), place: h('p.muted.small'), alarms: h('div.card-alarms'),
    score: h('div.score'), signs: new Map()};
  const rows = mayHealth ? SHOWN.map((each) => sign(context, each, parts.signs)) : [];
  const name = mayHealth ? h('a', {href: `#/data/${encodeURIComponent(person)}`}, person) : person;
  add(made, h('div.card-head', h('h3.card-name', icon('person'), name), parts.state), parts.place,
    parts.alarms, mayHealth && h('div.person-body', parts.score, h('dl.signs', rows)));
  Object.assign(made, {parts});
  attribute(made, 'data-person', person);
  parts.score.append(h('span.score-name', t('overview.news2')), h('span.score-number'),
    h('span.score-risk'));
  return made;
}

function add(element, ...children) {
  element.append(...children.filter(Boolean));
}

function sign({t, format}, name, signs) {
  const unit = t.word('unit', name);
  const parts = {value: h('span.sign-value.number'), note: h('span.sign-note'), spark: sparkline(),
    row: h('div.sign')};
  signs.set(name, parts);
  parts.row.append(h('dt', t.word('sign', name)), h('dd', h('span.sign-number', parts.value,
    h('span.sign-unit', format.gap(unit), unit)), parts.note), parts.spark);
  return parts.row;
}

/** Show how a person is now. */
export function updatePerson(card, {person, now}, context, trends) {
  const {t, state, format, permissions} = context;
  const {parts} = card;
  tone(card, 'edge', now.tone);
  setBadge(parts.state, now.tone, t(`overview.is_${now.key}`), ICONS[now.key] || 'info');
  const isLost = !isReached(state, person);
  write(parts.place, placeText(context, placeOf(state, person), isLost));
  alarmRows(parts.alarms, now.alarms, context);
  if (permissions.has('health')) {
    showScore(parts.score, news2Of(state, person), t, isLost);
    const found = signsOf(state, person);
    for (const [name, each] of parts.signs) {
      const reading = found.signs.find((one) => one.sign === name);
      showSign(each, reading, context, name, isLost);
      drawSpark(each.spark, trends.of(person, name), trends.startNs, state.nowNs(), SPANS[name],
        trends.gapNs);
    }
  }
}

function placeText({t, format}, place, isLost) {
  if (!place || !(place.room || place.near)) {
    return t('overview.place_unknown');
  }
  const where = place.room ? t.word('room', place.room) : t('overview.near', {node: t.word('room', place.near)});
  return isLost || place.ageS > STALE_S ? t('overview.was_in', {where, ago: format.ago(place.ageS)})
    : t('overview.is_in', {where});
}

function showScore(element, score, t, isLost) {
  const [, total, risk] = element.children;
  const isKnown = score && score.total !== null;
  const isOld = score && (isLost || score.ageS > STALE_S);
  const isPart = score && !isKnown && score.atLeast > 0;
  // What is missing can only add to it: low is not known then.
  const isRisk = (isKnown || isPart) && !(score.risk === 'low' && score.missing.length);
  tone(element, 'tone', isOld || !isRisk ? 'none' : riskTone(score.risk));
  write(total, isKnown ? score.total : isPart ? `≥ ${score.atLeast}` : '–');
  write(risk, !score ? t('overview.no_score') : isOld ? t('overview.score_old')
    : isKnown ? t('overview.risk', {risk: t.word('risk', score.risk)})
      : t('overview.score_missing', {n: score.missing.length}));
  attribute(element, 'title', score?.missing.length ? t('overview.score_missing_which',
    {which: score.missing.map((each) => t.word('sign', each)).join(', ')}) : null);
}

function showSign(parts, reading, {t, format}, name, isLost) {
  const isThere = reading && Number.isFinite(reading.value);
  const isGood = isThere && !isLost && reading.quality === 'good' && reading.ageS <= 120;
  const value = isThere ? format.number(reading.value, DECIMALS[name] || 0) : '–';
  write(parts.value, value);
  parts.row.classList.toggle('is-stale', !isGood);
  parts.row.classList.toggle('is-missing', !isThere);
  const quality = reading ? t.word('quality', reading.quality) : t('overview.not_measured');
  const isBad = !isThere || reading.quality !== 'good';
  const age = !isThere ? '' : !isLost && reading.ageS < FRESH_S ? t('overview.now')
    : format.duration(reading.ageS);
  // What is bad and fresh says why; what is bad and old says that as well.
  write(parts.note, [isBad && quality, (!isBad || reading?.ageS >= FRESH_S) && age]
    .filter(Boolean).join(', '));
}

/** One line for each open alarm, with what to do at once. */
export function alarmRows(element, alarms, context) {
  const {t, permissions, format, state} = context;
  const make = (alarm) => {
    const parts = {link: h('a', {href: `#/alarms/${encodeURIComponent(alarm.robot)}/${
      encodeURIComponent(alarm.id)}`}), words: h('span.small'), act: h('div')};
    const row = h('div.card-alarm', parts.link, parts.words, parts.act);
    return Object.assign(row, {parts});
  };
  const update = (row, alarm) => {
    tone(row, 'tone', isLoud(alarm) ? alarm.level : 'none');
    const ageS = (state.nowNs() - openedNs(alarm)) / 1e9;
    write(row.parts.words, [whereOf(context, alarm), stateText(alarm, t), format.ago(ageS)]
      .filter(Boolean).join(' · '));
    const title = titleOf(context, alarm);
    const key = `${alarm.state} ${title}`;
    if (row.dataset.key !== key) {
      row.dataset.key = key;
      replace(row.parts.link, icon(levelIcon(alarm.level)), h('span', title));
      replace(row.parts.act, isLoud(alarm) && permissions.has('acknowledge')
        && acknowledgeButton(context, alarm));
    }
    nameButtons(row.parts.act, context, alarm);
  };
  keep(element, alarms, (each) => `${each.robot}/${each.id}`, make, update, true);
}

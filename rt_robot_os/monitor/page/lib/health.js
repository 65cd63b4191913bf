// @ts-check
/**
 * What a robot says of a person, made readable: the topics signs, news2_details and place_details
 * are lists of diagnoses; each has a name such as 'anna/pulse_per_min' and values that are texts.
 */

import {isLoud, rank} from './alarms.js';
import {isUp} from './outage.js';

/** Signs in the order in which they are shown. */
export const SIGNS = ['pulse_per_min', 'spo2_percent', 'respiration_per_min', 'body_temperature',
  'systolic_mmhg', 'diastolic_mmhg', 'consciousness', 'oxygen_l_per_min'];
/** How many decimals a sign has. */
export const DECIMALS = {body_temperature: 1, oxygen_l_per_min: 1};
// Signs come each second; a robot that has told none for this long tells of the past.
export const STALE_S = 15;

/** The diagnoses of a message, whatever form it came in: [{name, message, values: {}}]. */
export function diagnoses(value) {
  const list = Array.isArray(value) ? value : value?.status;
  if (!Array.isArray(list)) {
    return [];
  }
  return list.map((each) => ({name: each.name || '', message: each.message || '', values:
    Array.isArray(each.values) ? Object.fromEntries(each.values.map(({key, value: v}) => [key, v]))
      : each.values || {}}));
}

/** The signs of a person: [{sign, value, quality, ageS, source}], those that there are. */
export function signsOf(state, person) {
  const found = state.newest(`health/${person}/signs`);
  if (!found) {
    return {signs: [], ageS: NaN};
  }
  const ageS = (state.nowNs() - found.utcNs) / 1e9;
  const signs = diagnoses(found.value).map(({name, values}) => ({
    sign: name.split('/').pop(), value: number(values.value), quality: values.quality || 'missing',
    ageS: number(values.age_s) + ageS, source: values.source || ''}));
  signs.sort((one, other) => place(one.sign) - place(other.sign));
  return {signs, ageS};
}

/** The score of a person: {total, atLeast, risk, missing: [], ageS}; null is none. */
export function news2Of(state, person) {
  const found = state.newest(`health/${person}/news2_details`);
  const values = found && diagnoses(found.value)[0]?.values;
  if (!values) {
    return null;
  }
  const total = number(values.total);
  return {total: Number.isFinite(total) ? total : null, atLeast: number(values.at_least),
    risk: String(values.risk || '').toLowerCase(),
    missing: String(values.missing || '').split(' ').filter(Boolean),
    response: values.response || '', ageS: (state.nowNs() - found.utcNs) / 1e9};
}

/** Where a person is: {room, ageS, stillS}; null is not known. */
export function placeOf(state, person) {
  const found = state.newest(`health/${person}/place_details`);
  if (!found) {
    return null;
  }
  const values = diagnoses(found.value)[0]?.values || found.value || {};
  return {room: values.room || '', near: values.node || '', stillS: number(values.still_s),
    ageS: (state.nowNs() - found.utcNs) / 1e9 + (number(values.age_s) || 0)};
}

const FOUND = new Map();

/**
 * The person whom an alarm is about, also when its subject is what they wear, or names them ('vital
 * signs of anna'); '' when it is about nobody.
 */
export function personOf(state, alarm) {
  const {subject = '', text = ''} = alarm;
  if (state.people.has(subject)) {
    return subject;
  }
  const worn = (state.robots.get(alarm.robot)?.nodes || []).find(({name}) => name === subject)
    ?.person;
  if (state.people.has(worn)) {
    return worn;
  }
  const named = (words) => [...state.people.keys()].filter((name) => finder(name).test(words))
    .sort((one, other) => other.length - one.length);
  const [found] = named(subject);
  // A device whose report names one person is theirs.
  const others = found || alarm.level !== 'technical' ? [] : named(text);
  return found || (others.length === 1 ? others[0] : '');
}

/** What finds a name as a word. */
function finder(name) {
  if (!FOUND.has(name)) {
    const escaped = name.replace(/[.*+?^${}()|[\]\\]/g, '\\$&');
    FOUND.set(name, new RegExp(`(?<![\\p{L}\\p{N}])${escaped}(?![\\p{L}\\p{N}])`, 'iu'));
  }
  return FOUND.get(name);
}

const RISK_TONES = {low: 'ok', 'low-medium': 'warn', medium: 'urgent', high: 'critical'};

/** The tone of a risk of the score. */
export function riskTone(risk) {
  return RISK_TONES[risk] || 'none';
}

/**
 * How a person is, in one word of words.person: {key, tone, badness, alarms}. What is worst of
 * alarms, vital signs and silence counts.
 */
export function stateOf(state, person) {
  const alarms = state.openAlarms().filter((each) => personOf(state, each) === person);
  const clinical = alarms.filter((each) => each.level !== 'technical');
  const [worst] = clinical;
  if (worst && isLoud(worst)) {
    return worst.state === 'suspected'
      ? {key: 'suspected', tone: 'urgent', badness: 60, alarms}
      : {key: worst.level, tone: worst.level, badness: 60 + 10 * rank(worst.level), alarms};
  }
  if (worst) {
    return {key: 'taken', tone: 'warn', badness: 50, alarms};
  }
  return {...quiet(state, person, alarms), alarms};
}

function quiet(state, person, alarms) {
  const {signs, ageS} = signsOf(state, person);
  const score = news2Of(state, person);
  if (score && score.ageS <= STALE_S && (score.risk === 'high' || score.risk === 'medium')) {
    return {key: `risk_${score.risk}`, tone: riskTone(score.risk),
      badness: score.risk === 'high' ? 48 : 44};
  }
  if (!isReached(state, person)) {
    return {key: 'unreached', tone: 'stale', badness: 40};
  }
  if (alarms.length) {
    return {key: 'technical', tone: 'technical', badness: 30};
  }
  if (!signs.length) {
    return {key: 'no_signs', tone: 'none', badness: 10};
  }
  if (!(ageS <= STALE_S)) {
    return {key: 'old_signs', tone: 'stale', badness: 25};
  }
  if (!score || score.total === null || score.missing.length || !(score.ageS <= STALE_S)) {
    return {key: 'no_score', tone: 'none', badness: 5};
  }
  return score.risk === 'low-medium' ? {key: 'risk_some', tone: 'warn', badness: 20}
    : {key: 'well', tone: 'ok', badness: 0};
}

/** Whether a robot that tells of a person is reached. */
export function isReached(state, person) {
  for (const robot of state.robots.values()) {
    if (isUp(state, robot) && (robot.people || []).includes(person)) {
      return true;
    }
  }
  return false;
}

function number(value) {
  return value === '' || value === undefined || value === null ? NaN : Number(value);
}

function place(sign) {
  const at = SIGNS.indexOf(sign);
  return at < 0 ? SIGNS.length : at;
}

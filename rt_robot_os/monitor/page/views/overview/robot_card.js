// @ts-check
/** A robot: connected, battery, what it does, when it was heard last. */

import {alarmRows} from './person_card.js';
import {charge, chargeAgeS, doing, LOW_BATTERY, otherAlarms} from './robot_words.js';
import {attribute, h, tone, write} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {isUp} from '../../lib/outage.js';
import {badge, setBadge} from '../../lib/parts.js';
import {saidSignal, writeSaid} from '../../lib/said.js';
import {mayOpen, viewNamed} from '../../lib/views.js';

// Drivers tell the charge each few seconds; one that is older is of the past.
const CHARGE_STALE_S = 120;
// Views about one robot, as far as they may be opened.
const LINKS = ['position', 'camera', 'drive', 'network'];

/** Make the card of a robot. */
export function robotCard(context, robot) {
  const {t, permissions} = context;
  const made = h('article.card.robot', {'aria-label': robot.name || robot.id});
  const parts = {state: badge('none', ''), name: h('span', robot.name || robot.id),
    doing: h('p.robot-doing'), battery: h('dd.battery'), seen: h('dd.number'), people: h('dd'),
    stop: h('dd'), stopRow: h('div'), alarms: h('div.card-alarms')};
  parts.level = h('span.battery-level');
  parts.charge = h('span.number');
  parts.battery.append(h('span.battery-box', {'aria-hidden': 'true'}, parts.level), parts.charge);
  parts.stopRow.append(h('dt', t('overview.stopped_by')), parts.stop);
  const links = LINKS.filter((each) => mayOpen(viewNamed(each), permissions)).map((each) => h(
    'a.button.quiet', {href: `#/${each}/${encodeURIComponent(robot.id)}`}, icon(each),
    t(`shell.view_${each}`)));
  made.append(h('div.card-head', h('h3.card-name', icon('robot'), parts.name), parts.state),
    parts.doing, parts.alarms, h('dl.robot-facts', h('div', h('dt', t('overview.battery')),
      parts.battery), h('div', h('dt', t('overview.seen')), parts.seen),
    h('div', h('dt', t('overview.serves')), parts.people), parts.stopRow),
    h('div.card-links', links));
  return Object.assign(made, {parts});
}

/** Show how a robot is now. */
export function updateRobot(card, robot, context) {
  const {t, state, format} = context;
  const {parts} = card;
  const up = isUp(state, robot);
  tone(card, 'edge', up ? 'none' : 'stale');
  card.classList.toggle('is-away', !up);
  setBadge(parts.state, up ? 'ok' : state.isCurrent ? 'urgent' : 'stale', t(up
    ? 'overview.connected' : !state.isCurrent ? 'overview.unknown' : robot.connected
      ? 'overview.silent' : 'overview.away'), up ? 'check' : 'offline');
  const {text, lang} = doing(context, robot);
  writeSaid(parts.doing, {text: up ? text : t('overview.last_doing', {doing: text}), lang});
  const isOld = !up || chargeAgeS(state, robot) > CHARGE_STALE_S;
  showBattery(parts, charge(state, robot), isOld, context);
  const ageS = (state.nowNs() - (robot.last_seen_ns || NaN)) / 1e9;
  write(parts.seen, up ? t('overview.now') : Number.isFinite(ageS)
    ? format.ago(ageS) : t('overview.never'));
  write(parts.people, (robot.people || []).join(', ') || '–');
  const stop = saidSignal(context, robot.id, 'stop_reason');
  parts.stopRow.hidden = !stop.text || stop.text === 'none';
  writeSaid(parts.stop, stop);
  alarmRows(parts.alarms, otherAlarms(state, robot), context);
}

function showBattery(parts, share, isOld, {t, format}) {
  const isKnown = Number.isFinite(share);
  const isLow = share < LOW_BATTERY;
  parts.level.style.setProperty('width', `${Math.round(100 * Math.min(1, isKnown ? share : 0))}%`);
  parts.battery.classList.toggle('is-low', isLow);
  parts.battery.classList.toggle('is-old', isKnown && isOld);
  const words = isLow ? t('overview.battery_low', {share: format.percent(share)})
    : format.percent(share);
  write(parts.charge, !isKnown ? t('overview.battery_unknown') : isOld
    ? t('overview.battery_last', {charge: words}) : words);
  attribute(parts.battery, 'data-share', isKnown ? share : null);
}

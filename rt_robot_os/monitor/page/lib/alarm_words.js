// @ts-check
/** An alarm in words, the same wherever it stands: who, what, where, and who has it. */

import {kindsText} from './alarms.js';
import {personOf, placeOf} from './health.js';

// An older place is where somebody was.
const OLD_PLACE_S = 60;

/** What it is: 'Critical: anna – Fall'. */
export function titleOf({t, state}, alarm) {
  return `${t.word('level', alarm.level)}: ${whoOf(state, alarm)} – ${kindsText(alarm, t)}`;
}

/** Where it is: a room, else what it is near, else that this is not known; '' where none counts. */
export function whereOf({t, state, format}, alarm) {
  const nodes = state.robots.get(alarm.robot)?.nodes || [];
  const person = personOf(state, alarm);
  const place = person && placeOf(state, person);
  if (place?.room) {
    const where = t.word('room', place.room);
    return place.ageS > OLD_PLACE_S
      ? t('alarms.was_in', {where, ago: format.ago(place.ageS)}) : where;
  }
  const node = nodes.find((each) => each.name === alarm.node);
  const isWorn = node?.person || (person && !node);
  if (alarm.node && !isWorn) {
    return t.word('room', alarm.node);
  }
  const near = place?.near || nearest(nodes, alarm);
  if (near) {
    return t('alarms.near', {node: t.word('room', near)});
  }
  const isOfDevice = !person && alarm.level === 'technical';
  return isOfDevice ? '' : t('alarms.no_place');
}

/** The name of an alarm for what acts on it; no other open alarm has the same. */
export function nameOf(context, alarm) {
  const {state} = context;
  const name = shortName(context, alarm);
  const others = state.openAlarms().filter((each) => shortName(context, each) === name);
  const robot = state.robots.get(alarm.robot)?.name || alarm.robot;
  return others.length > 1 ? `${name}, ${robot} ${alarm.id}` : name;
}

/** Who has it: its state with the name. */
export function stateText(alarm, t) {
  const by = alarm.by && alarm.state !== 'raised' ? ` (${alarm.by})` : '';
  return t.word('state', alarm.state) + by;
}

function whoOf(state, alarm) {
  return alarm.subject || state.robots.get(alarm.robot)?.name || alarm.robot;
}

function shortName(context, alarm) {
  const {t, state} = context;
  return [whoOf(state, alarm), kindsText(alarm, t), whereOf(context, alarm)].filter(Boolean)
    .join(', ');
}

/** The name of the node that hangs nearest to an alarm with a place; '' without one. */
function nearest(nodes, {x, y}) {
  if (!Number.isFinite(x) || !Number.isFinite(y)) {
    return '';
  }
  const far = (each) => Math.hypot(each.x - x, each.y - y);
  const hung = nodes.filter((each) => !each.person && Number.isFinite(far(each)));
  return hung.reduce((best, each) => (best && far(best) <= far(each) ? best : each), null)?.name
    || '';
}

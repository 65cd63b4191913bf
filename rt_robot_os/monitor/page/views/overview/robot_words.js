// @ts-check
/** How a robot is, in words and as a number to sort by. */

import {isLoud, rank} from '../../lib/alarms.js';
import {personOf} from '../../lib/health.js';
import {isUp} from '../../lib/outage.js';
import {saidSignal} from '../../lib/said.js';

/** Below this share of its battery a robot should be charged. */
export const LOW_BATTERY = 0.2;

/** The charge as a share from 0 to 1, or NaN; some drivers say percent. */
export function charge(state, robot) {
  const value = state.signal(robot.id, 'battery')?.value;
  const share = typeof value === 'number' ? value : Number(value?.percentage ?? NaN);
  return share > 1.5 ? share / 100 : share;
}

/** How old the charge is, in s; NaN without one. */
export function chargeAgeS(state, robot) {
  return (state.nowNs() - (state.signal(robot.id, 'battery')?.utcNs ?? NaN)) / 1e9;
}

/** What it does, as its agent says it: {text, lang}. */
export function doing(context, robot) {
  const found = saidSignal(context, robot.id, 'agent/state');
  return found.text ? found : {text: context.t('overview.doing_unknown'), lang: null};
}

/** Open alarms of a robot that are about no person. */
export function otherAlarms(state, robot) {
  return state.openAlarms().filter((each) => each.robot === robot.id
    && !personOf(state, each));
}

/** The larger, the more a robot needs somebody, or the more urgent is what it does. */
export function badnessOf(state, robot) {
  const alarms = state.openAlarms().filter((each) => each.robot === robot.id);
  const [worst] = alarms;
  const urgency = !worst ? 0 : isLoud(worst) ? 10 + 10 * rank(worst.level) : 4 + rank(worst.level);
  return urgency + (isUp(state, robot) ? 0 : 35) + (charge(state, robot) < LOW_BATTERY ? 3 : 0)
    + (isBusy(state, robot) ? 2 : 0);
}

function isBusy(state, robot) {
  return !/^(idle\b|$)/.test(String(state.signal(robot.id, 'agent/state')?.value ?? ''));
}

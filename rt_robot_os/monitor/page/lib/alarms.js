// @ts-check
/** What alarms are, and in which order they come. */

/** From the least to the worst. */
export const LEVELS = ['technical', 'warning', 'urgent', 'critical'];
/** How loud the states are: who has not been answered comes first. */
const STATES = ['acknowledged', 'suspected', 'raised'];
const OVER = new Set(['resolved', 'cancelled']);

/** Whether somebody still has to do with it. */
export function isOpen(alarm) {
  return alarm.is_open ?? !OVER.has(alarm.state);
}

/** Whether nobody has taken it on yet. */
export function isLoud(alarm) {
  return isOpen(alarm) && alarm.state !== 'acknowledged';
}

/** A number for how bad a level is; -1 is none. */
export function rank(level) {
  return LEVELS.indexOf(level);
}

/** For sort: unanswered before acknowledged, the worst first, then the oldest. */
export function order(one, other) {
  return (Number(isLoud(other)) - Number(isLoud(one))) || (rank(other.level) - rank(one.level))
    || (STATES.indexOf(other.state) - STATES.indexOf(one.state))
    || ((one.opened_ns || one.t_ns || 0) - (other.opened_ns || other.t_ns || 0));
}

/** When it began, in ns. */
export function openedNs(alarm) {
  return alarm.opened_ns || alarm.t_ns || 0;
}

/** What the causes are, in words of the reader. */
export function kindsText(alarm, t) {
  const kinds = Array.isArray(alarm.kinds) ? alarm.kinds : String(alarm.kinds || '').split(' ');
  return kinds.filter(Boolean).map((kind) => t.word('kind', kind)).join(', ');
}

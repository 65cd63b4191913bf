// @ts-check
/**
 * What keeps alarms from being known: no server, no robot, a robot that is away. "No open alarms"
 * is good news only while none of these holds.
 */

import {store, stored} from './i18n.js';

// Without the server, or without a robot, for longer than this: it sounds.
const SERVER_SOUNDS_MS = 10000;
const ROBOT_SOUNDS_MS = 60000;
const SILENCED = 'silenced_robots';

/** Whether a robot is reached: connected, heard of by the server, and the server by us. */
export function isUp(state, robot) {
  return state.isCurrent && Boolean(robot.connected) && !robot.silent;
}

/** Robots that should be there: not those whose token was revoked. */
function expected(state) {
  return [...state.robots.values()].filter((each) => !each.retired);
}

/** How many robots are reached, and how many should be. */
export function robotsUp(state) {
  const robots = expected(state);
  return [robots.filter((each) => isUp(state, each)).length, robots.length];
}

/**
 * What alarms may be missed by now; null: nothing.
 * @param {import('./state.js').State} state
 * @returns {?{kind: string, sinceMs: number, ageMs: number, away: Array}} kind: start (the server
 *   has said nothing yet), server (nothing comes from it), storing (it cannot store), none (no
 *   robot is known), robots (away: those that are not reached); sinceMs by this computer's clock
 */
export function outageOf(state) {
  const {live} = state;
  if (!state.isCurrent) {
    const {contactMs} = live;
    const kind = state.isKnown || !live.isYoung ? 'server' : 'start';
    return {kind, sinceMs: contactMs, ageMs: live.silentMs, away: []};
  }
  const robots = expected(state);
  const away = robots.filter((each) => !isUp(state, each));
  if (away.length) {
    const seenNs = Math.max(...away.map((each) => each.last_seen_ns || 0));
    return {kind: 'robots', sinceMs: seenNs / 1e6, ageMs: (state.nowNs() - seenNs) / 1e6, away};
  }
  const kind = !robots.length ? 'none' : state.server.storing === false ? 'storing' : '';
  return kind ? {kind, sinceMs: NaN, ageMs: 0, away: []} : null;
}

/** An outage in words: {title, text}. */
export function outageWords(outage, {t, state, format}) {
  const [up, n] = robotsUp(state);
  const time = Number.isFinite(outage.sinceMs) ? format.time(outage.sinceMs) : '';
  switch (outage.kind) {
    case 'start':
      return {title: t('shell.connecting'), text: ''};
    case 'server':
      return {title: t('shell.unknown_alarms'), text: t('shell.no_server_since', {time})};
    case 'none':
      return {title: t('shell.no_robot'), text: ''};
    case 'storing':
      return {title: t('shell.no_alarm'), text: t('shell.not_storing')};
    default:
      return {title: up ? t('shell.unknown_alarms_of', {
        names: outage.away.map((each) => each.name || each.id).join(', ')})
        : t('shell.unknown_alarms'), text: t('shell.robots_up', {n, up})};
  }
}

/** Which outages sound, until someone silences them; a new one, or another robot, sounds again. */
export class Silence {
  constructor() {
    this.isServer = false;
    this.robots = new Set((stored(SILENCED) || '').split(' ').filter(Boolean));
  }

  /** Whether an outage lasts long enough to sound, and is not silenced. */
  sounds(outage) {
    if (outage?.kind === 'server') {
      return outage.ageMs > SERVER_SOUNDS_MS && !this.isServer;
    }
    return outage?.kind === 'robots' && outage.ageMs > ROBOT_SOUNDS_MS
      && outage.away.some((each) => !this.robots.has(each.id));
  }

  /** Silence what is now; the words stay. */
  silence(outage) {
    this.isServer = this.isServer || outage.kind === 'server';
    outage.away.forEach((each) => this.robots.add(each.id));
    this.store();
  }

  /** Forget of what is reached again that it was silenced. */
  update(state) {
    if (!state.isCurrent) {
      return;
    }
    this.isServer = false;
    const back = [...state.robots.values()].filter((each) => isUp(state, each)
      && this.robots.delete(each.id));
    if (back.length) {
      this.store();
    }
  }

  store() {
    store(SILENCED, [...this.robots].join(' ') || null);
  }
}

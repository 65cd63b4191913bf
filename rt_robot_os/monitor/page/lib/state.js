// @ts-check
/**
 * What is known now of robots, people, alarms and signals; whoever shows it is told of changes.
 */

import {isOpen, order} from './alarms.js';

const TICK_MS = 1000;
// Gaps that are kept for those who draw over time.
const GAPS = 100;

export class State {
  /** @param {import('./live.js').Live} live */
  constructor(live) {
    this.live = live;
    this.listeners = new Map();
    this.clear();
    const on = (name, take) => live.addEventListener(name,
      (event) => take(/** @type {CustomEvent} */ (event).detail));
    on('state', (found) => this.takeState(found));
    on('robot', (found) => this.takeRobot(found));
    on('alarm', (found) => this.takeAlarm(found));
    on('signals', (found) => this.takeSignals(found));
    on('server', (found) => this.takeServer(found));
    on('gap', (found) => this.takeGap(found));
    live.addEventListener('connection', () => this.tell('connection'));
    live.addEventListener('rtt', () => this.tell('rtt'));
    setInterval(() => this.tell('tick'), TICK_MS);
  }

  clear() {
    /** Whether the server has told how everything is. */
    this.isKnown = false;
    /** What the server says of itself: whether it can store. */
    this.server = {};
    this.robots = new Map();
    this.people = new Map();
    this.alarms = new Map();
    this.signals = new Map();
    this.gaps = [];
  }

  /**
   * Hear of changes.
   * @param {string} kinds of robots, people, alarms, signals, gap, server, connection, session,
   *   tick; with blanks
   * @param {function(string, *): void} listener gets the kind and what changed
   * @returns {function(): void} hear no more
   */
  on(kinds, listener) {
    const names = kinds.split(' ');
    for (const kind of names) {
      if (!this.listeners.has(kind)) {
        this.listeners.set(kind, new Set());
      }
      this.listeners.get(kind).add(listener);
    }
    return () => names.forEach((kind) => this.listeners.get(kind).delete(listener));
  }

  tell(kind, detail) {
    for (const listener of [...(this.listeners.get(kind) || [])]) {
      listener(kind, detail);
    }
  }

  /** Whether all that is known here is of now; else it is what was last known. */
  get isCurrent() {
    return this.isKnown && this.live.isCurrent;
  }

  /** Now by the server's clock, in ns. */
  nowNs() {
    return this.live.nowNs();
  }

  /** The last of a signal: {utcNs, value}, or null. */
  signal(robot, name) {
    const found = this.signals.get(robot)?.get(name);
    return found ? {utcNs: found[0], value: found[1]} : null;
  }

  /** The newest of a signal from any robot: {robot, utcNs, value}, or null. */
  newest(name) {
    let best = null;
    for (const [robot, signals] of this.signals) {
      const found = signals.get(name);
      if (found && (!best || found[0] > best.utcNs)) {
        best = {robot, utcNs: found[0], value: found[1]};
      }
    }
    return best;
  }

  /** Open alarms, the worst first. */
  openAlarms() {
    return [...this.alarms.values()].sort(order);
  }

  takeServer(server) {
    this.server = server;
    this.tell('server');
  }

  takeState({robots = [], people = [], alarms = [], server = {}}) {
    this.server = server;
    this.robots = new Map(robots.map((each) => [each.id, each]));
    this.people = new Map(people.map((each) => [nameOf(each), asPerson(each)]));
    const open = alarms.filter(isOpen);
    this.alarms = new Map(open.map((each) => [keyOf(each), each]));
    for (const robot of robots) {
      this.mergeSignals(robot.id, robot.signals || {});
    }
    this.isKnown = true;
    this.tell('robots');
    this.tell('people');
    this.tell('alarms', {alarms: open, isFirst: true});
    this.tell('signals', {robot: null, signals: {}});
  }

  takeRobot({robot: found, ...rest}) {
    const robot = typeof found === 'object' ? found : {...rest, id: found ?? rest.id};
    if (robot.id === undefined) {
      return;
    }
    this.robots.set(robot.id, {...this.robots.get(robot.id), ...robot});
    for (const name of robot.people || []) {
      if (!this.people.has(name)) {
        this.people.set(name, {person: name, robots: [robot.id]});
        this.tell('people');
      }
    }
    this.tell('robots', robot.id);
  }

  takeAlarm({alarm: found, ...rest}) {
    const alarm = typeof found === 'object' ? found : rest;
    const key = keyOf(alarm);
    const before = this.alarms.get(key) || null;
    const now = {...before, ...alarm};
    if (isOpen(now)) {
      this.alarms.set(key, now);
    } else {
      this.alarms.delete(key);
    }
    this.tell('alarms', {alarms: [now], before, isFirst: false});
  }

  takeSignals({robot, signals = {}, ...rest}) {
    this.mergeSignals(robot, signals);
    this.tell('signals', {robot, signals, ...rest});
  }

  mergeSignals(robot, signals) {
    let known = this.signals.get(robot);
    if (!known) {
      known = new Map();
      this.signals.set(robot, known);
    }
    for (const [name, pair] of Object.entries(signals)) {
      known.set(name, pair);
    }
  }

  takeGap(gap) {
    this.gaps.push(gap);
    this.gaps.splice(0, this.gaps.length - GAPS);
    this.tell('gap', gap);
  }
}

function keyOf(alarm) {
  return `${alarm.robot}/${alarm.id}`;
}

function nameOf(person) {
  return typeof person === 'string' ? person : person.person ?? person.id ?? person.name;
}

function asPerson(person) {
  return typeof person === 'string' ? {person} : {...person, person: nameOf(person)};
}

// @ts-check
/** What is known of where everything is: the robot and its track, people, nodes, plan, scan. */

const NS_PER_MS = 1e6;
const TRACK_MOST = 4096;
const TRACK_MS = 10 * 60_000;
const TRACK_STEP_M = 0.03;
// A robot does not jump so far between two poses: it was carried, or found itself again.
const TRACK_JUMP_M = 1.5;
const DETAILS_MS = 60_000;

/** From this age on it is shown as old, in ms. */
export const OLD_MS = {robot: 5_000, person: 120_000, nodes: 60_000, scan: 2_000, plan: 10_000};

/** Whether what is of a moment t is old; isLost: nothing comes any more, so that all is. */
export function isOld({nowMs, isLost}, t, kind) {
  return isLost || nowMs - t > OLD_MS[kind];
}

export const SIGNALS = ['pose', 'plan', 'planner/state', 'trajectory/state', 'trajectory/progress',
  'stop_reason', 'codes/*', 'battery', 'wsn/nodes', 'health/*/place', 'health/*/place_details'];

export class Scene {
  constructor() {
    this.track = {x: new Float32Array(TRACK_MOST), y: new Float32Array(TRACK_MOST),
                  t: new Float64Array(TRACK_MOST), first: 0, length: 0};
    this.clear();
  }

  clear() {
    this.pose = null;
    this.plan = null;
    this.scan = null;
    this.nodes = null;
    this.people = new Map();
    this.texts = new Map();
    this.track.length = 0;
    this.track.first = 0;
    this.version = (this.version || 0) + 1;
  }

  /** Take signals: {name: [utc_ns, value]}. */
  take(signals) {
    for (const [name, [utcNs, value]] of Object.entries(signals)) {
      this._one(name, utcNs / NS_PER_MS, value);
    }
    this.version += 1;
  }

  _one(name, t, value) {
    if (name === 'pose' && isPlace(value)) {
      this._moved(t, value);
    } else if (name === 'plan') {
      this.plan = {t, points: (value?.points || []).filter(isPoint)};
    } else if (name === 'scan' && Array.isArray(value?.ranges)) {
      this.scan = {t, ...value};
    } else if (name === 'wsn/nodes' && Array.isArray(value?.nodes)) {
      this.nodes = {t, nodes: value.nodes};
    } else if (name.startsWith('health/') && name.endsWith('/place') && isPlace(value)) {
      this._place(name.split('/')[1], t, value);
    } else if (name.startsWith('health/') && name.endsWith('/place_details')) {
      this._details(name.split('/')[1], t, value);
    } else if (typeof value === 'string' || typeof value === 'number') {
      this.texts.set(name, {t, value});
    }
  }

  _place(person, t, {x, y, stddev_m: stddevM}) {
    const told = this.people.get(person)?.toldT;
    // How old a place is the details say; without them it is as old as the message.
    this._person(person, {x, y, stddevM, ...(t - told < DETAILS_MS ? {} : {t})});
  }

  _person(person, more) {
    this.people.set(person, {...this.people.get(person), person, ...more});
  }

  _details(person, t, value) {
    const said = value?.status?.[0]?.values || value || {};
    const found = {room: said.room || '', node: said.node || '', how: said.how || ''};
    const ageMs = Number(said.age_s) * 1000;
    if (Number.isFinite(ageMs) && said.age_s !== '') {
      found.t = t - ageMs;
      found.toldT = t;
    }
    if (Number(said.uncertainty_m) > 0) {
      found.uncertaintyM = Number(said.uncertainty_m);
    }
    this._person(person, found);
  }

  _moved(t, {x, y, yaw, stddev_m: stddevM}) {
    this.pose = {t, x, y, yaw, stddevM};
    const {track} = this;
    const last = (track.first + track.length - 1) % TRACK_MOST;
    if (track.length && Math.hypot(track.x[last] - x, track.y[last] - y) < TRACK_STEP_M) {
      return;
    }
    const at = (track.first + track.length) % TRACK_MOST;
    track.x[at] = x;
    track.y[at] = y;
    track.t[at] = t;
    if (track.length < TRACK_MOST) {
      track.length += 1;
    } else {
      track.first = (track.first + 1) % TRACK_MOST;
    }
  }

  /** Call with each stretch of the track of the last minutes: draw(x, y, isNew). */
  eachTrack(nowMs, draw) {
    const {track} = this;
    let before = -1;
    for (let i = 0; i < track.length; i += 1) {
      const at = (track.first + i) % TRACK_MOST;
      if (nowMs - track.t[at] > TRACK_MS) {
        continue;
      }
      const isNew = before < 0 || Math.hypot(track.x[at] - track.x[before],
        track.y[at] - track.y[before]) > TRACK_JUMP_M;
      draw(track.x[at], track.y[at], isNew);
      before = at;
    }
  }

  /** @return how far it is along the plan from the robot, in m; null without one. */
  distanceM() {
    if (!this.pose || !this.plan || this.plan.points.length < 1) {
      return null;
    }
    const {points} = this.plan;
    let nearest = 0;
    for (let i = 1; i < points.length; i += 1) {
      if (this._far(points[i]) < this._far(points[nearest])) {
        nearest = i;
      }
    }
    let length = this._far(points[nearest]);
    for (let i = nearest + 1; i < points.length; i += 1) {
      length += Math.hypot(points[i][0] - points[i - 1][0], points[i][1] - points[i - 1][1]);
    }
    return length;
  }

  _far([x, y]) {
    return Math.hypot(x - this.pose.x, y - this.pose.y);
  }
}

function isPlace(value) {
  return Boolean(value) && Number.isFinite(value.x) && Number.isFinite(value.y);
}

function isPoint(point) {
  return Array.isArray(point) && Number.isFinite(point[0]) && Number.isFinite(point[1]);
}

/** @return how good a link is: good, fair, poor or unknown. */
export function linkOf(node) {
  const share = node.recent ?? node.delivery;
  if (['silent', 'unheard', 'asleep'].includes(node.state) || !Number.isFinite(share)) {
    return 'unknown';
  }
  return share >= 0.95 ? 'good' : share >= 0.8 ? 'fair' : 'poor';
}

// @ts-check
/**
 * The last hour of a few signs of each person, for the small lines of the overview: the past from
 * the server, one request at a time; what comes live is added.
 */

import {signsOf} from './health.js';

const SPAN_S = 3600;
const PIXELS = 60;
const STEP_S = SPAN_S / PIXELS;
// What is not there may come with the next release of the server, not in a minute.
const AGAIN_MS = 300000;

export class Trends {
  constructor(context) {
    this.context = context;
    this.points = new Map();
    this.queue = [];
    this.isAsking = false;
    this.isClosed = false;
    this.off = context.state.on('signals', () => this.add());
  }

  /** [[t_ns, value]] of a sign; asks for the past when it is wanted first. */
  of(person, sign) {
    const key = `${person}/${sign}`;
    let found = this.points.get(key);
    if (!found) {
      found = [];
      this.points.set(key, found);
      this.queue.push([person, sign, found]);
      this.ask();
    }
    return found;
  }

  get startNs() {
    return this.context.state.nowNs() - SPAN_S * 1e9;
  }

  get gapNs() {
    return 2.5 * STEP_S * 1e9;
  }

  async ask() {
    if (this.isAsking || this.isClosed || !this.queue.length) {
      return;
    }
    this.isAsking = true;
    const [person, sign, points] = this.queue.shift();
    try {
      const end = Math.round(this.context.state.nowNs());
      const chart = await this.context.api.get(`/api/people/${encodeURIComponent(person)}/charts`,
        {sign, start: end - SPAN_S * 1e9, end, pixels: PIXELS}, {background: true});
      const past = (chart?.t_ns || []).map((t, index) => [t, chart.mean[index]]);
      const first = points.length ? points[0][0] : Infinity;
      points.unshift(...past.filter(([t]) => t < first));
    } catch (error) {
      this.queue = error.status === 404 || error.status === 0 ? [] : this.queue;
      setTimeout(() => {
        this.points.delete(`${person}/${sign}`);
      }, AGAIN_MS);
    }
    this.isAsking = false;
    this.ask();
  }

  add() {
    const {state} = this.context;
    const now = state.nowNs();
    for (const [key, points] of this.points) {
      const [person, sign] = key.split('/');
      const found = signsOf(state, person).signs.find((each) => each.sign === sign);
      const isNew = !points.length || now - points[points.length - 1][0] > STEP_S * 1e9 / 4;
      if (found && found.quality === 'good' && Number.isFinite(found.value) && isNew) {
        points.push([now, found.value]);
        while (points.length && points[0][0] < now - 1.1 * SPAN_S * 1e9) {
          points.shift();
        }
      }
    }
  }

  close() {
    this.isClosed = true;
    this.off();
  }
}

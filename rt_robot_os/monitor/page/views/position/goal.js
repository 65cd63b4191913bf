// @ts-check
/** Send the robot to a place: choose, turn, confirm; then how far it is, and cancel. */

import {attribute, h, tone, write} from '../../lib/dom.js';
import {isUp} from '../../lib/outage.js';
import {button, field} from '../../lib/parts.js';
import {problemText} from '../../lib/problem.js';
import {said, saidOf} from '../../lib/said.js';
import {kindAt} from './map.js';
import {wrapped, worldToCell} from './transform.js';

const ARROW_PX = 64;
const GRAB_PX = 26;
const DEGREES = 180 / Math.PI;
// What a planner or a follower says of a drive that goes on.
const UNDER_WAY = /^(planning|planned|waiting|turning|driving)\b/;

export class Goal {
  /**
   * @param {Object} context of the page.
   * @param {Object} place robot() and map() of the view, view (its viewport), scene, changed().
   */
  constructor(context, place) {
    this.context = context;
    this.place = place;
    this.target = null;
    this.isSent = false;
    this.answer = '';
    const {t} = context;
    this.fields = Object.fromEntries(['x', 'y', 'yaw'].map((name) => [name, h('input', {
      type: 'number', step: name === 'yaw' ? 5 : 0.05, id: `goal-${name}`,
      oninput: () => this._typed()})]));
    this.title = h('h2');
    this.note = h('p.position-goal-note', {role: 'status', id: 'goal-note'});
    this.places = h('div.position-goal-fields', field(t('position.x_m'), this.fields.x),
      field(t('position.y_m'), this.fields.y), field(t('position.heading_deg'), this.fields.yaw));
    this.go = button(t('position.go'), () => this.send(), {kind: 'primary', icon: 'position'});
    attribute(this.go, 'aria-describedby', 'goal-note');
    this.leave = button(t('position.leave'), () => this.drop(), {kind: 'quiet'});
    this.stop = button(t('position.cancel'), () => this.cancel(), {kind: 'danger'});
    this.element = h('section.position-goal', {hidden: true, 'aria-label': t('position.goal')},
      this.title, this.places, this.note, h('div.actions', this.leave, this.stop, this.go));
  }

  get mayDrive() {
    return this.context.permissions.has('drive');
  }

  /** Choose a place in metres; the robot will look as it would come. */
  choose(x, y) {
    if (!this.mayDrive || !this.place.robot()) {
      return;
    }
    const {pose} = this.place.scene;
    const yaw = this.target && !this.isSent ? this.target.yaw
      : pose ? Math.atan2(y - pose.y, x - pose.x) : 0;
    this.target = {x, y, yaw};
    this.isSent = false;
    this.answer = '';
    this._write();
    this._makeRoom();
    this.show();
  }

  /** Stand in a corner in which the target is not. */
  _makeRoom() {
    const {view} = this.place;
    const [px, py] = view.toScreen(this.target.x, this.target.y);
    const corner = py > view.height / 2 ? 'top' : px > view.width / 2 ? 'left' : 'right';
    tone(this.element, 'at', corner);
  }

  /** Put the target in the middle of what is shown, for who uses keys. */
  chooseMiddle() {
    this.choose(this.place.view.x, this.place.view.y);
    if (this.target) {
      this.fields.x.focus();
    }
  }

  /** @return what drags from a place of the screen: the arrow turns, the ring moves. */
  grab(px, py) {
    if (!this.target || this.isSent) {
      return null;
    }
    const {view} = this.place;
    const [x, y] = view.toScreen(this.target.x, this.target.y);
    const [tipX, tipY] = [x + ARROW_PX * Math.cos(this.target.yaw),
                          y - ARROW_PX * Math.sin(this.target.yaw)];
    const near = (ax, ay) => Math.hypot(px - ax, py - ay) < GRAB_PX;
    if (near(tipX, tipY)) {
      return (nowX, nowY) => this._change({yaw: Math.atan2(y - nowY, nowX - x)});
    }
    if (near(x, y)) {
      return (nowX, nowY) => {
        const [worldX, worldY] = view.toWorld(nowX, nowY);
        this._change({x: worldX, y: worldY});
      };
    }
    return null;
  }

  async send() {
    const {t} = this.context;
    const {x, y, yaw} = this.target;
    const args = {x: rounded(x), y: rounded(y), yaw: rounded(wrapped(yaw))};
    this.note.textContent = t('position.sending');
    try {
      const answer = await this.context.command(this.place.robot(), 'goal', args);
      this.isSent = answer?.ok !== false;
      this.answer = answer ? saidOf(t, answer, 'text').text : '';
      if (!this.isSent) {
        this.context.toast(t('position.refused', {text: this.answer}), {kind: 'warn'});
      }
    } catch (error) {
      this.answer = problemText(error, t);
      this.context.toast(t('position.refused', {text: this.answer}), {kind: 'warn'});
    }
    this.show();
  }

  async cancel() {
    const {t} = this.context;
    try {
      await this.context.command(this.place.robot(), 'cancel');
      this.drop();
    } catch (error) {
      this.context.toast(t('position.cancel_failed', {text: problemText(error, t)}),
        {kind: 'critical'});
    }
  }

  drop() {
    this.target = null;
    this.isSent = false;
    this.show();
  }

  /** Show how it stands. */
  show() {
    const {t} = this.context;
    const state = this._state();
    const isDriving = UNDER_WAY.test(state);
    this.element.hidden = !this.target && !(isDriving && this.mayDrive);
    const isChosen = Boolean(this.target) && !this.isSent;
    this.element.classList.toggle('is-chosen', isChosen);
    this.places.hidden = !isChosen;
    this.go.hidden = !isChosen;
    this.leave.hidden = !isChosen && isDriving;
    this.stop.hidden = !isDriving || isChosen;
    write(this.leave.querySelector('.label'), t(isChosen ? 'position.leave' : 'position.close'));
    const name = this.context.state.robots.get(this.place.robot())?.name || this.place.robot();
    write(this.title, isChosen ? t('position.send_there', {robot: name})
      : t(isDriving ? 'position.under_way' : 'position.goal'));
    write(this.note, isChosen ? this.answer || this._warning() : this._progress(state));
    this._showGo();
    this.place.changed();
  }

  _state() {
    const texts = this.place.scene.texts;
    const planner = String(texts.get('planner/state')?.value || '');
    const follower = String(texts.get('trajectory/state')?.value || '');
    return /^(done|stopped|refused|idle)/.test(planner) || !planner ? planner || follower : planner;
  }

  _progress(state) {
    const {t, format} = this.context;
    if (!isUp(this.context.state, this.context.state.robots.get(this.place.robot()) || {})) {
      return t('position.progress_unknown');
    }
    const far = this.place.scene.distanceM();
    const word = /^\w+/.exec(state)?.[0] || 'idle';
    const text = this._words(word, state);
    return UNDER_WAY.test(state) && far !== null
      ? t('position.to_go', {state: text, metres: format.unit(far, 'm', 1)}) : text;
  }

  /** A state of the planner, or of what follows its path, in the reader's words. */
  _words(word, state) {
    const {t} = this.context;
    const robot = this.place.robot();
    const name = ['planner/state', 'trajectory/state'].find((each) =>
      this.context.state.signal(robot, each)?.value === state);
    const why = name && this.context.state.signal(robot, `codes/${name}`)?.value?.args?.why;
    const rest = why ? said(t, why.text, why.code ? why : null).text
      : state.slice(word.length).replace(/^[:,\s]+/, '');
    const found = t(`position.state_${word}`, {text: rest});
    return found.startsWith('position.') ? state : found;
  }

  /** What is where the robot would go: free, unknown, wall or outside; without a map free. */
  _kind() {
    const map = this.place.map();
    return map && this.target
      ? kindAt(map, ...worldToCell(map, this.target.x, this.target.y)) : 'free';
  }

  _warning() {
    const kind = this._kind();
    return this.context.t(kind === 'free' ? 'position.turn_hint' : `position.target_${kind}`);
  }

  /** Nobody is sent into a wall, or off the map; into what is not known only on purpose. */
  _showGo() {
    const kind = this._kind();
    attribute(this.go, 'disabled', kind === 'wall' || kind === 'outside');
    this.go.classList.toggle('primary', kind === 'free');
    write(this.go.querySelector('.label'), this.context.t(kind === 'unknown' ? 'position.go_anyway'
      : 'position.go'));
  }

  _change(what) {
    Object.assign(this.target, what);
    this.answer = '';
    this._write();
    this.show();
  }

  _typed() {
    const [x, y, degrees] = ['x', 'y', 'yaw'].map((name) => this.fields[name].valueAsNumber);
    if (this.target && [x, y, degrees].every(Number.isFinite)) {
      Object.assign(this.target, {x, y, yaw: degrees / DEGREES});
      this.answer = '';
      this.show();
    }
  }

  _write() {
    this.fields.x.value = this.target.x.toFixed(2);
    this.fields.y.value = this.target.y.toFixed(2);
    this.fields.yaw.value = String(Math.round(wrapped(this.target.yaw) * DEGREES));
  }
}

Goal.ARROW_PX = ARROW_PX;

function rounded(value) {
  return Math.round(value * 1000) / 1000;
}

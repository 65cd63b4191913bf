// @ts-check
/** The cameras of a robot, live; pictures on order; pictures and clips of alarms. */

import {h, keep, replace} from '../lib/dom.js';
import {button, notice, section} from '../lib/parts.js';
import {pictureOf} from '../lib/picture.js';
import {attempt} from '../lib/problem.js';
import {robotChoice} from '../lib/robot_choice.js';
import {saidElement, saidOf} from '../lib/said.js';
import {voiceOf} from '../lib/voice.js';
import {Kept} from './camera/kept.js';

export const view = {
  name: 'camera',
  permission: 'camera',
  open(root, context, arg) {
    return new CameraView(root, context, arg).close;
  },
};

class CameraView {
  constructor(root, context, arg) {
    this.context = context;
    const [robot, alarm] = (arg || '').split('/').map(decodeURIComponent);
    this.pictures = new Map();
    this.voice = null;
    this.choice = robotChoice(context, robot, () => this.look());
    this.snapshot = button(context.t('camera.snapshot'), () => this.order(), {icon: 'picture'});
    this.live = h('div.camera-live');
    this.note = h('div.camera-note');
    this.talk = h('div.camera-talk');
    this.kept = new Kept(context, alarm || '');
    replace(root,
      h('div.section-head', h('p.muted', context.t('camera.private')), this.choice.element,
        this.snapshot),
      this.note, this.live, this.talk, section(context.t('camera.kept'), this.kept.element));
    const off = context.state.on('robots', () => this.look());
    const offAlarms = context.state.on('alarms', () => this.kept.load());
    this.close = () => {
      off();
      offAlarms();
      this.kept.close();
      this.voice?.close();
      this.choice.close();
      this.pictures.forEach((each) => each.close());
    };
    this.look();
  }

  get robot() {
    return this.context.state.robots.get(this.choice.robot) || null;
  }

  look() {
    const {t, state} = this.context;
    const {robot} = this;
    const names = (robot && robot.cameras) || [];
    const wanted = names.map((camera) => ({key: JSON.stringify([robot.id, camera]), camera}));
    for (const [key, picture] of [...this.pictures]) {
      if (!wanted.some((each) => each.key === key)) {
        picture.close();
        this.pictures.delete(key);
      }
    }
    keep(this.live, wanted, (each) => each.key, (each) => this.open(robot, each), () => {});
    replace(this.note, this.words(robot, names));
    this.snapshot.disabled = !robot || !robot.connected
      || !(robot.capabilities || []).includes('snapshot');
    this.snapshot.title = this.snapshot.disabled ? t('camera.no_snapshot') : '';
    this.kept.show(robot ? robot.id : null);
    this.call(robot);
    this.live.classList.toggle('camera-one', names.length === 1);
    this.isKnown = state.isKnown;
  }

  open(robot, {key, camera}) {
    const picture = pictureOf(this.context, {robot: robot.id, camera});
    this.pictures.set(key, picture);
    return picture.element;
  }

  words(robot, names) {
    const {t, state} = this.context;
    if (!state.isKnown) {
      return notice('loading', t('camera.waiting'));
    }
    if (!robot) {
      return notice('empty', t('camera.no_robot'));
    }
    return names.length ? null : notice('empty', t('camera.none'), t('camera.none_text'));
  }

  /** Talk with whoever is there, where that is allowed and the robot can. */
  call(robot) {
    const id = robot && (robot.capabilities || []).includes('talk')
      && this.context.permissions.has('talk') ? robot.id : null;
    if (id === this.calls) {
      return;
    }
    this.calls = id;
    this.voice?.close();
    this.voice = id ? voiceOf(this.context, {robot: id}) : null;
    replace(this.talk, this.voice && this.voice.element);
  }

  async order() {
    const {api, t, toast} = this.context;
    const {robot} = this;
    const answer = await attempt(() => api.post(
      `/api/robots/${encodeURIComponent(robot.id)}/commands`, {do: 'snapshot', args: {}}), t);
    if (answer) {
      toast(answer.ok === false ? saidElement(saidOf(t, answer, 'text')) : t('camera.taken'));
      this.kept.load();
    }
  }
}

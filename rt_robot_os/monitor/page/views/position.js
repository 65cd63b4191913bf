// @ts-check
/** Where everything is: the map of a robot with its way, people, nodes and alarms; and go there. */

import {h, replace} from '../lib/dom.js';
import {store, stored} from '../lib/i18n.js';
import {personOf} from '../lib/health.js';
import {hasKeys} from '../lib/keys.js';
import {isUp} from '../lib/outage.js';
import {button, notice} from '../lib/parts.js';
import {problemText} from '../lib/problem.js';
import {robotChoice} from '../lib/robot_choice.js';
import {onTheme} from './data/look.js';
import {Goal} from './position/goal.js';
import {Labels} from './position/labels.js';
import * as layers from './position/layers.js';
import {legend, PlaceList} from './position/list.js';
import {pictureOf, unpacked} from './position/map.js';
import {paletteOf} from './position/palette.js';
import {Pointers, pressed} from './position/pointer.js';
import {isOld, Scene, SIGNALS} from './position/scene.js';
import {alarmShape, goalShape, nodeShape, personShape, robotShape} from './position/symbols.js';
import {boundsOf, Viewport} from './position/transform.js';

const LAYERS = {track: true, plan: true, people: true, nodes: true, alarms: true, scan: false};
const CHOICES = 'position.layers';
const NS_PER_MS = 1e6;
const AROUND = {left: -3, right: 3, bottom: -3, top: 3};
const STATES = ['good', 'weak', 'silent', 'asleep', 'doubtful', 'unheard', 'sink'];

class PositionView {
  constructor(root, context, arg) {
    this.root = root;
    this.context = context;
    this.scene = new Scene();
    this.view = new Viewport();
    this.labels = new Labels();
    this.map = null;
    this.follows = false;
    this.isFitted = false;
    this.isDirty = true;
    this.drawn = 0;
    this.asked = 0;
    this.layers = {...LAYERS, ...read(CHOICES)};
    this.choice = robotChoice(context, arg, () => this.choose());
    this.goal = new Goal(context, {view: this.view, scene: this.scene,
      robot: () => this.choice.robot, map: () => this.map, changed: () => this.change()});
    this.list = new PlaceList(context, (x, y) => this.find(x, y));
    this.palette = paletteOf(root);
    this.legend = legend(context, this.legendWords(), (ctx, name) => this.paint(ctx, name));
    this.build();
    this.pointers = new Pointers(this.canvas, this.view, {
      moved: () => this.byHand(), grabbed: (x, y) => this.goal.grab(x, y),
      tapped: (x, y) => this.goal.choose(...this.view.toWorld(x, y))});
    this.sized = new ResizeObserver(() => this.resize());
    this.sized.observe(this.box);
    this.ends = [
      context.state.on('signals', (kind, {robot, signals}) => this.take(robot, signals)),
      context.state.on('alarms robots', () => this.write()),
      context.state.on('tick', () => this.write()),
      onTheme(() => this.restyle()),
    ];
    this.choose();
    this.frame = requestAnimationFrame(() => this._frame());
  }

  build() {
    const {t} = this.context;
    this.canvas = h('canvas.position-canvas', {tabindex: '0', role: 'application', 'aria-label':
      t('position.map'), 'aria-describedby': hasKeys() && 'position-keys'});
    this.canvas.onkeydown = (event) => this.key(event);
    this.note = h('div.position-note');
    this.followButton = button(t('position.follow'), () => this.setFollow(!this.follows));
    const tool = (sign, text, onclick) => h('button.button.icon-only', {type: 'button',
      'aria-label': text, title: text, onclick}, h('span', {'aria-hidden': 'true'}, sign));
    this.tools = h('div.position-tools', tool('+', t('position.nearer'), () => this.zoom(1.4)),
      tool('−', t('position.farther'), () => this.zoom(1 / 1.4)),
      tool('⤢', t('position.all'), () => this.fit()));
    this.box = h('div.position-box', this.canvas, this.tools, this.note, h('div.position-cross',
      {'aria-hidden': 'true'}), this.goal.element);
    const boxes = Object.keys(LAYERS).map((name) => {
      const input = h('input', {type: 'checkbox', checked: this.layers[name]});
      input.onchange = () => this.setLayer(name, input.checked);
      return h('label.toggle', input, h('span', t(`position.layer_${name}`)));
    });
    replace(this.root, h('p.unseen', {id: 'position-keys'}, t(this.goal.mayDrive
      ? 'position.keys_drive' : 'position.keys')), this.box, h('div.position-side',
      h('div.position-head', this.choice.element, this.followButton), this.list.element,
      h('details.position-more', {open: true}, h('summary', t('position.layers')),
        h('div.position-layers', boxes)),
      h('details.position-more', {open: true}, h('summary', t('position.legend')),
        this.legend.element)));
  }

  close() {
    cancelAnimationFrame(this.frame);
    this.ends.forEach((end) => end());
    this.endWatch?.();
    this.pointers.close();
    this.sized.disconnect();
    this.choice.close();
    this.asked += 1;
  }

  /** Show another robot: its own map, and what it says. */
  choose() {
    const {robot} = this.choice;
    this.scene.clear();
    this.goal?.drop();
    this.map = null;
    this.mapDigest = undefined;
    this.isFitted = false;
    if (robot) {
      const known = this.context.state.signals.get(robot);
      this.take(robot, known ? Object.fromEntries(known) : {});
    }
    this.watch();
    this.write();
  }

  watch() {
    const {robot} = this.choice;
    this.endWatch?.();
    const wanted = this.layers.scan ? [...SIGNALS, 'scan'] : SIGNALS;
    this.endWatch = robot ? this.context.live.watch('position', robot, wanted, 10) : null;
  }

  take(robot, signals) {
    if (robot === this.choice.robot || robot === null) {
      this.scene.take(signals);
      if (this.follows && this.scene.pose) {
        this.view.follow(this.scene.pose.x, this.scene.pose.y);
      }
      this.change();
    }
  }

  /** Ask for the map when the robot has another one. */
  async load() {
    const robot = this.context.state.robots.get(this.choice.robot);
    const digest = robot && (robot.map || '');
    if (!robot || digest === this.mapDigest) {
      return;
    }
    this.mapDigest = digest;
    const mine = this.asked += 1;
    try {
      const found = await unpacked(await this.context.api.get(
        `/api/robots/${encodeURIComponent(robot.id)}/map`));
      if (mine === this.asked) {
        const isFirst = !this.map;
        this.map = found;
        this.picture = pictureOf(found, this.palette.map);
        this.explain('');
        isFirst && this.fit(); // one that grows leaves what somebody looks at where it is
      }
    } catch (error) {
      if (mine === this.asked) {
        const had = this.map && error.status !== 404;
        if (!had) {
          this.map = null;
          this.explain(error.status === 404 ? 'no_map' : 'map_failed', problemText(error, this.context.t));
          this.fit();
        }
        if (error.status !== 404) {
          setTimeout(() => mine === this.asked && this.retry(), 5000);
        }
      }
    }
    this.change();
  }

  retry() {
    this.mapDigest = undefined;
    this.load();
  }

  explain(key, text = '') {
    const {t} = this.context;
    replace(this.note, key && notice(key === 'no_map' ? 'empty' : 'error', t(`position.${key}`),
      key === 'no_map' ? t('position.no_map_text') : text));
  }

  /** Open alarms of the robot; one without a place of its own is where the person is. */
  alarms() {
    return this.context.state.openAlarms().filter((each) => each.robot === this.choice.robot)
      .map((each) => {
        const {x, y} = this.scene.people.get(personOf(this.context.state, each)) || {};
        return Number.isFinite(each.x) && Number.isFinite(each.y) ? each : {...each, x, y};
      });
  }

  /** Write what changes with time: ages, the list, how the drive stands. */
  write() {
    const {context, scene} = this;
    this.load();
    const robot = context.state.robots.get(this.choice.robot);
    if (!robot && context.state.isKnown) {
      this.explain('no_robot');
    }
    this.list.show(scene, robot, this.alarms(), this.now());
    this.goal.show();
    this.change();
  }

  /** Now, and whether nothing comes any more from the robot: all that is shown was so. */
  now() {
    const {live, state} = this.context;
    return {nowMs: live.nowNs() / NS_PER_MS,
      isLost: !isUp(state, state.robots.get(this.choice.robot) || {})};
  }

  change() {
    this.isDirty = true;
  }

  byHand() {
    this.setFollow(false);
    this.change();
  }

  setFollow(isOn) {
    this.follows = isOn;
    this.followButton.setAttribute('aria-pressed', String(isOn));
    if (isOn && this.scene.pose) {
      this.view.x = this.scene.pose.x;
      this.view.y = this.scene.pose.y;
    }
    this.change();
  }

  zoom(factor) {
    this.view.zoom(factor);
    this.change();
  }

  find(x, y) {
    this.view.x = x;
    this.view.y = y;
    this.view.scale = Math.max(this.view.scale, 60);
    this.byHand();
  }

  /** Show the whole map; without one what is around the robot. */
  fit() {
    const {pose} = this.scene;
    const around = pose ? {left: pose.x - 3, right: pose.x + 3, bottom: pose.y - 3,
                           top: pose.y + 3} : AROUND;
    this.view.fit(this.map ? boundsOf(this.map) : around);
    this.isFitted = this.view.width > 10;
    this.change();
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.box;
    if (!width || !height) {
      return;
    }
    this.canvas.width = Math.round(width * devicePixelRatio);
    this.canvas.height = Math.round(height * devicePixelRatio);
    this.view.resize(width, height);
    if (!this.isFitted) {
      this.fit();
    }
    this.change();
  }

  restyle() {
    this.palette = paletteOf(this.root);
    this.picture = this.map && pictureOf(this.map, this.palette.map);
    this.legend.show();
    this.change();
  }

  setLayer(name, isOn) {
    this.layers[name] = isOn;
    store(CHOICES, JSON.stringify(this.layers));
    if (name === 'scan') {
      this.watch();
    }
    this.change();
  }

  key(event) {
    if (pressed(event, this.view)) {
      this.byHand();
    } else if (event.key === 'Enter' && this.goal.mayDrive) {
      this.goal.chooseMiddle();
    } else if (event.key === 'Escape' && this.goal.target) {
      this.goal.drop();
    } else if (event.key === 'f') {
      this.setFollow(!this.follows);
    } else if (event.key === 'Home') {
      this.fit();
    } else {
      return;
    }
    event.preventDefault();
  }

  _frame() {
    this.frame = requestAnimationFrame(() => this._frame());
    if (this.isDirty && this.view.width > 1) {
      this.isDirty = false;
      this.draw();
    }
  }

  draw() {
    const {view, scene, palette, context, labels} = this;
    const {t, format} = context;
    const ctx = this.canvas.getContext('2d');
    const pen = {ctx, view, palette, labels, ...this.now()};
    ctx.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    const step = layers.drawMap(pen, this.map, this.picture);
    const on = this.layers;
    on.scan && layers.drawScan(pen, scene);
    on.track && layers.drawTrack(pen, scene);
    on.plan && layers.drawPlan(pen, scene);
    on.nodes && layers.drawNodes(pen, scene, (node) => format.percent(
      node.recent ?? node.delivery));
    on.people && layers.drawPeople(pen, scene, (person) => this.aged(pen, person.person,
      person.t, 'person'));
    on.alarms && layers.drawAlarms(pen, this.alarms().filter((each) => Number.isFinite(each.x)
      && Number.isFinite(each.y)));
    layers.drawRobot(pen, scene, this.aged(pen, context.state.robots.get(this.choice.robot)?.name
      || '', scene.pose?.t ?? pen.nowMs, 'robot'));
    if (this.goal.target) {
      goalShape(ctx, ...view.toScreen(this.goal.target.x, this.goal.target.y),
        this.goal.target.yaw, Goal.ARROW_PX, palette.goal, palette);
    }
    layers.drawScale(pen, step, this.context.format.unit(step, 'm', step < 1 ? 1 : 0));
    labels.write(ctx, palette);
    this.drawn += 1;
  }

  aged(pen, name, t, kind) {
    return isOld(pen, t, kind)
      ? `${name}, ${this.context.format.ago((pen.nowMs - t) / 1000)}` : name;
  }

  legendWords() {
    const {t} = this.context;
    return [['robot', t('position.legend_robot')], ['robot_old', t('position.legend_robot_old')],
      ['person', t('position.legend_person')], ['alarm', t('position.legend_alarm')],
      ...STATES.map((each) => [`node_${each}`, t('position.legend_node', {
        state: t.word('node_state', each)})]),
      ...['good', 'fair', 'poor'].map((each) => [`link_${each}`, t(`position.legend_${each}`)])];
  }

  paint(ctx, name) {
    const {palette} = this;
    if (name.startsWith('robot')) {
      const isOld = name === 'robot_old';
      robotShape(ctx, 12, 14, 0, 8, isOld ? palette.stale : palette.robot, palette, isOld);
    } else if (name === 'person') {
      personShape(ctx, 14, 13, palette.person, palette);
    } else if (name === 'alarm') {
      ctx.scale(0.55, 0.55);
      alarmShape(ctx, 25, 29, palette.levels.critical, palette);
    } else if (name.startsWith('node_')) {
      nodeShape(ctx, 14, 14, name.slice(5), palette);
    } else {
      const link = name.slice(5);
      ctx.strokeStyle = palette.links[link];
      ctx.lineWidth = 2.5;
      ctx.setLineDash({good: [], fair: [8, 5], poor: [2, 5]}[link]);
      ctx.moveTo(2, 14);
      ctx.lineTo(26, 14);
      ctx.stroke();
    }
  }
}

function read(name) {
  try {
    return JSON.parse(stored(name)) || {};
  } catch (error) {
    return {};
  }
}

export const view = {
  name: 'position',
  permission: 'see',
  open(root, context, arg) {
    const made = new PositionView(root, context, arg);
    root.positionView = made;
    return () => made.close();
  },
};

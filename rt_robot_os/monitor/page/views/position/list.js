// @ts-check
/** Everything that is on the map, in words: for those who do not see it, and to find it. */

import {h, keep, replace, write} from '../../lib/dom.js';
import {saidSignal} from '../../lib/said.js';
import {kindsText} from '../../lib/alarms.js';
import {isOld, linkOf} from './scene.js';

export class PlaceList {
  /**
   * @param {Object} context of the page.
   * @param {(x: number, y: number) => void} find show a place in the middle of the map.
   */
  constructor(context, find) {
    this.context = context;
    this.find = find;
    const {t} = context;
    this.parts = Object.fromEntries(['robot', 'people', 'alarms', 'nodes'].map((name) => {
      const list = h('ul.position-list');
      const element = h(`section.position-${name}`, h('h2', t(`position.${name}`)), list);
      return [name, {list, element}];
    }));
    this.element = h('div.position-lists', Object.values(this.parts).map((each) => each.element));
  }

  /** Write it again; now: {nowMs, isLost}. */
  show(scene, robot, alarms, now) {
    this._part('robot', robot && scene.pose ? [this._robot(scene, robot, now)] : []);
    this._part('people', [...scene.people.values()].map((each) => this._person(each, now)));
    this._part('alarms', alarms.map((each) => this._alarm(each)));
    this._part('nodes', (scene.nodes?.nodes || []).map((each) => this._node(each, scene, now)));
  }

  _part(name, items) {
    const {list, element} = this.parts[name];
    element.hidden = !items.length;
    keep(list, items, (item) => item.key, () => h('li', h('button.position-item', {type: 'button'},
      h('span.position-item-name'), h('span.position-item-text.small'))), (made, item) => {
      const button = /** @type {HTMLButtonElement} */ (made.children[0]);
      const [title, text] = button.children;
      write(title, item.name);
      write(text, item.text);
      button.classList.toggle('is-stale', item.isOld);
      button.disabled = !Number.isFinite(item.x);
      button.onclick = () => this.find(item.x, item.y);
    });
  }

  _robot({pose, texts}, robot, now) {
    const {t, format} = this.context;
    const ageMs = now.nowMs - pose.t;
    const wasThere = isOld(now, pose.t, 'robot');
    const degrees = Math.round((((pose.yaw || 0) * 180) / Math.PI + 360) % 360);
    const stop = saidSignal(this.context, robot.id, 'stop_reason');
    const parts = [this._place(pose), t('position.looks', {degrees})];
    if (stop.text && stop.text !== 'none') {
      parts.push(t('position.stands', {why: stop.text}));
    }
    if (wasThere) {
      parts.push(t('position.since', {ago: format.ago(ageMs / 1000)}));
    }
    return {key: robot.id, name: robot.name || robot.id, text: parts.join(' · '),
            isOld: wasThere, ...pose};
  }

  _person(person, now) {
    const {t, format} = this.context;
    const ageMs = now.nowMs - person.t;
    const isKnown = Number.isFinite(person.x);
    const parts = [person.room ? t.word('room', person.room) : t(isKnown ? 'position.no_room'
      : 'position.no_place')];
    const stddev = person.uncertaintyM || person.stddevM;
    if (isKnown) {
      parts.push(this._place(person) + (stddev ? ` ± ${format.unit(stddev, 'm', 1)}` : ''));
    }
    if (now.isLost || ageMs > 10_000) {
      parts.push(t('position.seen', {ago: format.ago(ageMs / 1000)}));
    }
    return {key: person.person, name: person.person, text: parts.join(' · '),
            isOld: isOld(now, person.t, 'person'), x: person.x, y: person.y};
  }

  _alarm(alarm) {
    const {t} = this.context;
    const who = alarm.subject ? `${alarm.subject}: ` : '';
    return {key: `${alarm.robot}/${alarm.id}`, name: who + kindsText(alarm, t), x: alarm.x,
            y: alarm.y, isOld: false, text: [t.word('level', alarm.level), t.word('state',
              alarm.state), Number.isFinite(alarm.x) ? this._place(alarm)
              : t('position.no_place')].join(' · ')};
  }

  _node(node, scene, now) {
    const {t, format} = this.context;
    const parts = [t.word('node_state', node.state)];
    const parent = scene.nodes.nodes.find(({id}) => id === node.parent);
    if (parent) {
      parts.push(t(`position.over_${linkOf(node)}`, {parent: parent.name || parent.id,
        share: format.percent(node.recent ?? node.delivery)}));
    }
    const ageS = (node.age_s || 0) + (now.nowMs - scene.nodes.t) / 1000;
    if (now.isLost || ageS > 60) {
      parts.push(t('position.seen', {ago: format.ago(ageS)}));
    }
    if (!Number.isFinite(node.x)) {
      parts.push(t('position.no_place'));
    }
    return {key: String(node.id), name: node.name || String(node.id), text: parts.join(' · '),
            isOld: isOld(now, scene.nodes.t, 'nodes') || node.state === 'silent',
            x: node.x, y: node.y};
  }

  _place({x, y}) {
    const {format} = this.context;
    return `${format.number(x, 2)}, ${format.unit(y, 'm', 2)}`;
  }
}

/** Make the legend: the same symbols as on the map, with words. */
export function legend(context, entries, paint) {
  const list = h('ul.position-legend.small', {'aria-label': context.t('position.legend')});
  const show = () => replace(list, entries.map(([name, text]) => {
    const canvas = h('canvas', {width: 28 * devicePixelRatio, height: 28 * devicePixelRatio,
      'aria-hidden': 'true'});
    const ctx = canvas.getContext('2d');
    ctx.scale(devicePixelRatio, devicePixelRatio);
    paint(ctx, name);
    return h('li', canvas, text);
  }));
  show();
  return {element: list, show};
}

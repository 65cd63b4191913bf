// @ts-check
/** The wireless nodes of a robot: battery, delivery, packets, last heard, way to the sink. */

import {attribute, framed, h, keep, replace, write} from '../lib/dom.js';
import {icon} from '../lib/icons.js';
import {isUp} from '../lib/outage.js';
import {badge, notice, setBadge} from '../lib/parts.js';
import {robotChoice} from '../lib/robot_choice.js';

// From the best to the worst; the numbers are those of the network's rows.
const STATES = ['unheard', 'good', 'weak', 'silent', 'asleep', 'doubtful', 'sink'];
const BADNESS = {sink: 0, good: 1, asleep: 2, unheard: 3, weak: 4, doubtful: 5, silent: 6};
const TONES = {sink: 'accent', good: 'ok', asleep: 'none', unheard: 'none', weak: 'warn',
  doubtful: 'warn', silent: 'urgent'};
const ICONS = {sink: 'info', good: 'check', asleep: 'clock', unheard: 'info', weak: 'warn',
  doubtful: 'warn', silent: 'urgent'};
// Rows come each few seconds; older than this they tell of the past.
const STALE_S = 30;

/** The columns: key, how to sort by it, whether numbers; the worst first at the first tap. */
const COLUMNS = [
  {key: 'name', of: (node) => nameOf(node), up: true},
  {key: 'state', of: (node) => BADNESS[stateOf(node)]},
  {key: 'battery', of: (node) => node.battery_v, up: true, end: true},
  {key: 'days', of: (node) => node.days_left, up: true, end: true},
  {key: 'delivery', of: (node) => node.recent ?? node.delivery, up: true, end: true},
  {key: 'packets', of: (node) => node.received, end: true},
  {key: 'lost', of: (node) => node.lost, end: true},
  {key: 'heard', of: (node) => node.age_s, end: true},
  {key: 'parent', of: (node) => node.hops},
];

export const view = {
  name: 'network',
  permission: 'see',
  open(root, context, arg) {
    return new Network(root, context, arg).close;
  },
};

class Network {
  constructor(root, context, arg) {
    this.context = context;
    this.column = COLUMNS[1];
    this.isUp = false;
    this.draw = framed(() => this.show());
    this.body = h('tbody');
    this.note = h('div');
    this.summary = h('p.muted.number');
    this.heads = COLUMNS.map((each) => this.head(each));
    this.choice = robotChoice(context, arg, () => this.watch());
    this.box = h('div.table-box', {role: 'region', tabindex: '0', 'aria-label':
      context.t('network.table')}, h('table.table', h('thead', h('tr', this.heads)), this.body));
    replace(root, h('div.section-head', this.summary, this.choice.element), this.note, this.box,
      h('p.help', context.t('network.help')));
    const off = context.state.on('signals robots tick', this.draw);
    this.close = () => {
      off();
      this.draw.stop();
      this.choice.close();
      this.unwatch?.();
    };
    this.watch();
  }

  watch() {
    this.unwatch?.();
    this.unwatch = this.context.live.watch('network', this.choice.robot, ['wsn/nodes'], 1);
    this.draw();
  }

  head(column) {
    const {t} = this.context;
    return h(`th${column.end ? '.end' : ''}`, {scope: 'col'}, h('button.sort', {type: 'button',
      onclick: () => this.sort(column)}, t(`network.${column.key}`), icon('sort')));
  }

  sort(column) {
    this.isUp = column === this.column ? !this.isUp : Boolean(column.up);
    this.column = column;
    this.show(true);
  }

  show(isAsked = false) {
    const {context} = this;
    const {t, state, format} = context;
    const found = state.signal(this.choice.robot, 'wsn/nodes');
    const nodes = found?.value?.nodes || [];
    this.box.hidden = !nodes.length;
    const ageS = found ? (state.nowNs() - found.utcNs) / 1e9 : NaN;
    const isOld = ageS > STALE_S || !isUp(state, state.robots.get(this.choice.robot) || {});
    this.box.classList.toggle('is-stale', isOld);
    this.explain(found, nodes, isOld);
    COLUMNS.forEach((each, index) => attribute(this.heads[index], 'aria-sort',
      each === this.column ? (this.isUp ? 'ascending' : 'descending') : null));
    keep(this.body, this.sorted(nodes), (node) => String(node.id), () => row(),
      (element, node) => update(element, node, context, nodes, isOld), isAsked);
    const bad = nodes.filter((each) => BADNESS[stateOf(each)] > 3).length;
    write(this.summary, nodes.length ? `${t('network.nodes', {n: nodes.length})} · ${
      t('network.bad', {n: bad})} · ${t('network.as_of', {ago: format.ago(ageS)})}` : '');
  }

  explain(found, nodes, isOld) {
    const {t, state, format} = this.context;
    const key = !state.isKnown ? 'loading' : !found ? 'none' : !nodes.length ? 'empty'
      : isOld ? 'old' : '';
    if (key !== this.explained) {
      this.explained = key;
      const kind = {loading: 'loading', old: 'offline'}[key] || 'empty';
      replace(this.note, key && notice(kind, t(`network.note_${key}`), key === 'old'
        ? t('network.note_old_text', {time: format.time(found.utcNs / 1e6)})
        : t(`network.note_${key}_text`)));
    }
  }

  sorted(nodes) {
    const sign = this.isUp ? 1 : -1;
    const {of} = this.column;
    return [...nodes].sort((one, other) => {
      const [a, b] = [of(one), of(other)];
      // What is not known is last, whichever way.
      if (!isKnown(a) || !isKnown(b)) {
        return Number(isKnown(b)) - Number(isKnown(a)) || one.id - other.id;
      }
      const by = typeof a === 'string' ? a.localeCompare(b) : a - b;
      return sign * by || one.id - other.id;
    });
  }
}

function isKnown(value) {
  return typeof value === 'string' || Number.isFinite(value);
}

function nameOf(node) {
  return node.name || String(node.id);
}

function stateOf(node) {
  return typeof node.state === 'number' ? STATES[node.state] || 'unheard' : node.state;
}

function row() {
  const cells = COLUMNS.slice(1).map((each) => h(`td${each.end ? '.end' : ''}`));
  const made = h('tr', h('th', {scope: 'row'}), cells);
  cells[0].append(badge('none', ''));
  return made;
}

function update(element, node, {t, format}, nodes, isOld) {
  const [name, state, battery, days, delivery, packets, lost, heard, parent] = element.children;
  const word = stateOf(node);
  write(name, nameOf(node));
  // What a node was is not what it is.
  setBadge(state.firstChild, isOld ? 'stale' : TONES[word] || 'none', t.word('node_state', word),
    isOld ? 'clock' : ICONS[word]);
  write(battery, Number.isFinite(node.battery_v) ? format.unit(node.battery_v, 'V', 2) : '–');
  write(days, Number.isFinite(node.days_left) ? format.number(node.days_left) : '–');
  days.classList.toggle('is-low', node.days_left !== null && node.days_left < 14);
  write(delivery, format.percent(node.recent ?? node.delivery));
  delivery.classList.toggle('is-low', (node.recent ?? node.delivery ?? 1) < 0.8);
  write(packets, format.number(node.received));
  write(lost, format.number(node.lost));
  write(heard, Number.isFinite(node.age_s) ? format.ago(node.age_s) : t('network.never'));
  write(parent, way(node, nodes, t));
}

function way(node, nodes, t) {
  if (!Number.isFinite(node.parent) || node.parent < 0) {
    return '–';
  }
  const parent = nodes.find((each) => each.id === node.parent);
  const name = parent ? nameOf(parent) : String(node.parent);
  return Number.isFinite(node.hops) ? t('network.way', {name, n: node.hops}) : name;
}

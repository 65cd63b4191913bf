// @ts-check
/** The data of a person: signs over time, live and back to a year, with limits, alarms and gaps. */

import {kindsText, openedNs} from '../lib/alarms.js';
import {h, replace} from '../lib/dom.js';
import {personOf} from '../lib/health.js';
import {store, stored} from '../lib/i18n.js';
import {notice, select} from '../lib/parts.js';
import {timeLabels} from './data/axis.js';
import {pressed} from './data/gestures.js';
import {History} from './data/history.js';
import {onTheme, paletteOf} from './data/look.js';
import {hear, signsOf} from './data/readings.js';
import {Row} from './data/row.js';
import {inOrder, limitZone, SIGNS} from './data/signs.js';
import {Stack} from './data/stack.js';
import {writeTable} from './data/table.js';
import {RANGES, Timeline} from './data/timeline.js';
import {Toolbar} from './data/toolbar.js';

const USUAL = ['pulse_per_min', 'spo2_percent', 'respiration_per_min', 'systolic_mmhg',
  'diastolic_mmhg', 'body_temperature', 'news2'];
const NS_PER_MS = 1e6;
const BACK_MOST = 20;
// What a robot has kept for us comes within that.
const LATE_MS = 3000;
const TABLE_MS = 2000;
// What the plots show is said in words, too, that often.
const WORDS_MS = 2000;
const CHOICES = 'data.layers';

class DataView {
  constructor(root, context, person) {
    this.root = root;
    this.context = context;
    this.person = person;
    this.rows = new Map();
    this.chartAlarms = new Map();
    this.back = [];
    this.layers = {news: true, limits: true, alarms: true, ...read(CHOICES)};
    this.palette = paletteOf(root);
    this.timeline = new Timeline(() => context.live.nowNs() / NS_PER_MS);
    this.stack = new Stack(context, this.timeline, () => this.remember());
    this.history = new History(context.api, this.timeline,
      (sign, chart) => this.took(sign, chart), (error) => this.toolbar.failed(error));
    this.toolbar = new Toolbar(context, this);
    this.timeline.changed = () => this.changed();
    this.table = h('table.data-table');
    this.tablePart = h('div.data-table-part', {tabindex: '0', role: 'region', hidden: true,
      'aria-label': context.t('data.as_table')}, this.table);
    this.stack.element.onkeydown = (event) => this.key(event);
    this.build();
    this.ends = [
      hear(context, person, (...value) => this.append(...value), (...said) => this.tell(...said)),
      context.state.on('alarms', () => this.showAlarms()),
      context.state.on('signals', (kind, {signals}) => this.details(signals)),
      context.state.on('gap', () => this.gap()),
      context.state.on('connection', () => this.connection()),
      context.state.on('robots', () => this.showCuts()),
      context.state.on('people', () => this.toolbar.showPeople()),
      onTheme(() => this.restyle()),
    ];
    this.words = setInterval(() => this.describe(), WORDS_MS);
    this.begin();
  }

  build() {
    const {t} = this.context;
    replace(this.root, this.toolbar.element, h('p.unseen', {id: 'data-keys'}, t('data.keys')),
      this.stack.element, this.tablePart, h('div.data-foot', this.toolbar.legend(),
      h('p.muted.small', t('data.not_medical'))));
    for (const sign of USUAL) {
      this.row(sign);
    }
    this.showRows();
  }

  /** Ask which signs there are; then for their history. */
  async begin() {
    const last = this.context.state.newest(`health/${this.person}/signs`);
    if (last) {
      this.tell(last.utcNs / NS_PER_MS, signsOf(last.value));
    }
    this.showAlarms();
    this.toolbar.showRange();
    try {
      const path = `/api/people/${encodeURIComponent(this.person)}/latest`;
      const found = await this.context.api.get(path);
      if (!this.ends) {
        return; // left meanwhile: plots that are built now would never be destroyed
      }
      found.forEach((each) => this.row(each.code).last({...each, t: each.t_ns / NS_PER_MS}));
      this.showRows();
    } catch (error) {
      // The history says so, if it cannot be had either.
    }
    if (this.ends) {
      this.history.of(this.person, [...this.rows.keys()]);
    }
  }

  close() {
    this.ends.forEach((end) => end());
    this.ends = null;
    clearInterval(this.words);
    clearTimeout(this.tableTimer);
    clearTimeout(this.describeTimer);
    this.history.close();
    this.toolbar.close();
    this.stack.close();
  }

  look() {
    const {t} = this.context;
    return {palette: this.palette, font: this.palette.font,
            labels: timeLabels(t.words.locale),
            number: (value, digits) => this.context.format.number(value, digits),
            words: (quality) => t.word('quality', quality), empty: t('data.empty')};
  }

  row(sign) {
    if (!this.rows.has(sign)) {
      this.rows.set(sign, new Row(this.context, sign, () => this.look()));
    }
    return this.rows.get(sign);
  }

  /** Show the rows in their order; of those that nobody measures only the usual ones. */
  showRows() {
    const names = inOrder([...this.rows.keys()]);
    const shown = names.filter((each) => !(this.layers.hidden || []).includes(each));
    this.shown = shown.map((each) => this.rows.get(each));
    this.shown.forEach((row) => this.zones(row));
    this.showCuts();
    this.stack.show(this.shown);
    this.history.pixels = this.stack.box().width;
    this.showAlarms();
    this.toolbar.showLayers(names.map((each) => [each, this.rows.get(each).name]), this.layers);
  }

  zones(row) {
    const details = this.context.state.newest(`health/${this.person}/news2_details`)?.value;
    const said = details?.status?.[0]?.values || {};
    const own = String(said.limits || '').split(';').map(limitZone).filter((each) =>
      each?.sign === row.sign);
    row.zones({...this.layers, own, scale: Number(said.spo2_scale) || 1,
               oxygen: Number(said.oxygen_l_per_min_score) > 0});
    this.stack.isDirty = true;
  }

  /** The robot says what it assesses by: own limits, the scale of SpO2, whether oxygen is given. */
  details(signals) {
    const text = JSON.stringify(signals[`health/${this.person}/news2_details`]?.[1] ?? null);
    if (text !== 'null' && text !== this.detailsText) {
      this.detailsText = text;
      this.rows.forEach((row) => this.zones(row));
    }
  }

  append(sign, t, value) {
    if (!this.rows.has(sign)) {
      if (!(sign in SIGNS)) {
        return;
      }
      this.row(sign);
      this.showRows();
      this.history.of(this.person, [...this.rows.keys()]);
    }
    this.rows.get(sign).append(t, value);
  }

  tell(t, signs) {
    for (const [sign, said] of Object.entries(signs)) {
      this.rows.get(sign)?.tell(t, said);
    }
  }

  took(sign, chart) {
    const row = this.rows.get(sign);
    row.take(chart);
    this.zones(row);
    for (const each of chart.alarms) {
      this.chartAlarms.set(`${each.robot}/${each.id}`, each);
    }
    this.showAlarms();
    this.stack.isDirty = true;
    this.changedSoon();
  }

  showAlarms() {
    const {context} = this;
    const all = new Map(this.layers.alarms ? this.chartAlarms : []);
    if (this.layers.alarms) {
      const mine = context.state.openAlarms().filter(
        (each) => personOf(context.state, each) === this.person);
      for (const each of mine) {
        all.set(`${each.robot}/${each.id}`, {...each, t: openedNs(each) / NS_PER_MS});
      }
    }
    const {t, format} = context;
    this.stack.mark([...all.values()].map((each) => ({...each, title: t('data.alarm_title', {
      level: t.word('level', each.level), kinds: kindsText(each, t),
      time: format.dateTime(each.t)})})));
  }

  /** A robot was away for a while: mark it, and ask again for what it sends later. */
  gap() {
    this.showCuts();
    this.history.refresh(LATE_MS);
  }

  /** We were away for a while, or are: what came meanwhile is asked for. */
  connection() {
    const {live} = this.context;
    if (live.isOpen && this.wasLost) {
      this.history.refresh(LATE_MS);
    }
    this.wasLost = !live.isOpen;
    this.showCuts();
  }

  /** Mark when robots, or we, were not connected; what lasts has no end. */
  showCuts() {
    const {state, live} = this.context;
    const robots = state.people.get(this.person)?.robots || [...state.robots.keys()];
    const cuts = state.gaps.filter((each) => robots.includes(each.robot))
      .map((each) => ({from: each.from_ns / NS_PER_MS, to: each.to_ns / NS_PER_MS}));
    for (const id of robots) {
      const robot = state.robots.get(id);
      if (robot && !robot.connected && robot.last_seen_ns) {
        cuts.push({from: robot.last_seen_ns / NS_PER_MS, to: null});
      }
    }
    if (!live.isOpen && live.lostMs) {
      cuts.push({from: live.lostMs + live.offsetMs, to: null});
    }
    this.rows.forEach((row) => {
      row.plot.cuts = cuts;
    });
    this.stack.isDirty = true;
  }

  changed() {
    this.history.pixels = this.stack.box().width;
    this.history.look();
    this.stack.changed();
    this.toolbar.showRange();
    this.changedSoon();
  }

  changedSoon() {
    clearTimeout(this.describeTimer);
    this.describeTimer = setTimeout(() => {
      this.describe();
      this.writeTable();
    }, 300);
  }

  describe() {
    const {start, end} = this.timeline;
    this.shown.forEach((row) => row.describe(start, end));
  }

  remember() {
    const {start, end, follows} = this.timeline;
    this.back.push({start, end, follows});
    this.back.splice(0, this.back.length - BACK_MOST);
  }

  /** Show what was shown before the last change by hand. */
  goBack() {
    const last = this.back.pop();
    if (last && last.follows) {
      this.timeline.follows = true;
      this.timeline.setSpan(last.end - last.start);
    } else if (last) {
      this.timeline.show(last.start, last.end);
    }
  }

  key(event) {
    if (event.target !== this.stack.element) {
      return;
    }
    if (event.key === 'Backspace') {
      this.goBack();
      event.preventDefault();
    } else if (event.shiftKey && event.key.startsWith('Arrow')) {
      const {left, width} = this.stack.box();
      const step = event.key === 'ArrowLeft' ? -0.02 : 0.02;
      const at = Math.min(1, Math.max(0, (this.stack.cursorX ?? 0.5) + step));
      this.stack.showCursor(left + at * width);
      event.preventDefault();
    } else if (pressed(event, this.timeline, RANGES)) {
      event.preventDefault();
    }
  }

  setLayers(layers) {
    this.layers = {...this.layers, ...layers};
    store(CHOICES, JSON.stringify(this.layers));
    if ('hidden' in layers) {
      this.showRows();
    }
    this.rows.forEach((row) => this.zones(row));
    this.showAlarms();
  }

  setTable(isShown) {
    this.tablePart.hidden = !isShown;
    this.stack.element.hidden = isShown;
    this.writeTable();
    if (!isShown) {
      this.stack.build(true);
    }
  }

  writeTable() {
    clearTimeout(this.tableTimer);
    if (!this.tablePart.hidden) {
      writeTable(this.table, this.shown, this.timeline, this.context);
      this.tableTimer = setTimeout(() => {
        this.timeline.tick(1000);
        this.writeTable();
      }, TABLE_MS);
    }
  }

  restyle() {
    this.palette = paletteOf(this.root);
    this.stack.build(true);
  }
}

function read(name) {
  try {
    return JSON.parse(stored(name)) || {};
  } catch (error) {
    return {};
  }
}

/** Ask whose data are wanted, until there is somebody. */
function choose(root, context, isOver) {
  const {t} = context;
  const people = [...context.state.people.keys()].sort();
  if (people.length === 1) {
    context.go(`#/data/${encodeURIComponent(people[0])}`);
  } else if (people.length) {
    const options = Object.fromEntries([['', t('data.choose')], ...people.map((each) =>
      [each, each])]);
    replace(root, h('div.data-choose', h('h2', t('data.whose')), select(options, '', (person) =>
      context.go(`#/data/${encodeURIComponent(person)}`))));
  } else {
    replace(root, notice(context.state.isKnown ? 'empty' : 'loading',
      t(context.state.isKnown ? 'data.nobody' : 'data.loading')));
  }
  return isOver;
}

export const view = {
  name: 'data',
  permission: 'health',
  open(root, context, arg) {
    if (arg) {
      const made = new DataView(root, context, arg);
      root.dataView = made;
      return () => made.close();
    }
    choose(root, context);
    return context.state.on('people', () => choose(root, context));
  },
};

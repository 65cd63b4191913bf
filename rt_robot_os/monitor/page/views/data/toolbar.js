// @ts-check
/** What is above the plots: whose data, which range, what else is shown, and export. */

import {attribute, h, replace, write} from '../../lib/dom.js';
import {button, notice, select} from '../../lib/parts.js';
import {problemElement} from '../../lib/problem.js';
import {timeText} from './axis.js';
import {RANGES} from './timeline.js';

export class Toolbar {
  /**
   * @param {Object} context of the page.
   * @param {Object} view person, timeline, goBack, setLayers, setTable, layers.
   */
  constructor(context, view) {
    this.context = context;
    this.view = view;
    const {t} = context;
    this.people = h('span.data-person');
    this.ranges = h('div.segments.data-ranges', {role: 'group', 'aria-label': t('data.range')},
      RANGES.map(([name, span]) => h('button', {type: 'button', 'data-range': name,
        title: t(`data.range_${name}_long`), 'aria-label': t(`data.range_${name}_long`),
        onclick: () => view.timeline.setSpan(span)}, t(`data.range_${name}`))));
    this.now = button(t('data.follow'), () => view.timeline.follow(), {icon: 'clock'});
    this.now.classList.add('data-now');
    this.steps = h('div.data-steps', {role: 'group', 'aria-label': t('data.move')},
      step('‹', t('data.earlier'), () => this.byHand(() => view.timeline.pan(-0.5))),
      step('›', t('data.later'), () => this.byHand(() => view.timeline.pan(0.5))),
      step('+', t('data.nearer'), () => this.byHand(() => view.timeline.zoom(0.5))),
      step('−', t('data.farther'), () => this.byHand(() => view.timeline.zoom(2))));
    this.shown = h('p.data-shown.number', {'aria-live': 'off'});
    this.layers = h('div.data-layers');
    this.problem = h('div.data-problem');
    this.asTable = button(t('data.as_table'), () => this.switchTable(), {kind: 'quiet'});
    attribute(this.asTable, 'aria-pressed', 'false');
    this.menu = h('details.data-menu', h('summary.button.quiet', t('data.shown')), this.layers);
    this.export = this.exports();
    this.element = h('div.data-toolbar', h('div.data-tools', this.people, this.ranges, this.now,
      this.steps, h('span.data-space'), this.menu, this.asTable, this.export), this.shown,
    this.problem);
    this.heard = new AbortController();
    const {signal} = this.heard;
    document.addEventListener('pointerdown', (event) => this.fold(event.target), {signal});
    this.element.addEventListener('keydown', (event) => event.key === 'Escape'
      && this.fold(null, true), {signal});
    this.showPeople();
  }

  close() {
    this.heard.abort();
  }

  /** Fold the menus in which a place is not; by key the focus goes back to what opens it. */
  fold(place, byKey = false) {
    for (const each of [this.menu, this.export]) {
      if (each.open && !each.contains(place)) {
        each.open = false;
        if (byKey) {
          /** @type {HTMLElement} */ (each.firstChild).focus();
        }
      }
    }
  }

  byHand(change) {
    this.view.remember();
    change();
  }

  showPeople() {
    const {context, view} = this;
    const names = [...new Set([view.person, ...context.state.people.keys()])].sort();
    if (names.join('\n') === this.names) {
      return;
    }
    this.names = names.join('\n');
    const options = Object.fromEntries(names.map((each) => [each, each]));
    const made = select(options, view.person, (person) => context.go(
      `#/data/${encodeURIComponent(person)}`));
    made.setAttribute('aria-label', context.t('data.person'));
    replace(this.people, names.length > 1 ? made : h('strong.data-name-of', view.person));
  }

  /** Show which range it is, and whether it follows. */
  showRange() {
    const {timeline} = this.view;
    const {locale} = this.context.t.words;
    for (const each of this.ranges.children) {
      const range = each.getAttribute('data-range');
      const span = Number(RANGES.find(([name]) => name === range)[1]);
      attribute(each, 'aria-pressed', String(Math.abs(timeline.span / span - 1) < 0.01));
    }
    attribute(this.now, 'aria-pressed', String(timeline.follows));
    write(this.now.querySelector('.label'), this.context.t(timeline.follows ? 'data.live'
      : 'data.follow'));
    write(this.shown, timeline.follows ? '' : this.context.t('data.from_to', {
      from: timeText(timeline.start, timeline.span, locale),
      to: timeText(timeline.end, timeline.span, locale)}));
    this.writeExports();
  }

  showLayers(signs, layers) {
    const {t} = this.context;
    const hidden = new Set(layers.hidden || []);
    const box = (text, isOn, changed) => {
      const input = h('input', {type: 'checkbox', checked: isOn});
      input.onchange = () => changed(input.checked);
      return h('label.toggle', input, h('span', text));
    };
    const layer = (name) => box(t(`data.layer_${name}`), layers[name] !== false,
      (isOn) => this.view.setLayers({[name]: isOn}));
    replace(this.layers, h('fieldset', h('legend', t('data.layers')), layer('limits'),
      layer('news'), layer('alarms')), h('fieldset', h('legend', t('data.signs')),
      signs.map(([sign, name]) => box(name, !hidden.has(sign), (isOn) => {
        hidden[isOn ? 'delete' : 'add'](sign);
        this.view.setLayers({hidden: [...hidden]});
      }))));
  }

  legend() {
    const {t} = this.context;
    const entry = (kind, text) => h('li', h(`span.data-key.data-key-${kind}`), text);
    return h('ul.data-legend.small', {'aria-label': t('data.legend')},
      entry('line', t('data.legend_mean')), entry('band', t('data.legend_band')),
      entry('limit', t('data.legend_limit')), entry('news', t('data.legend_news')),
      entry('bad', t('data.legend_bad')), entry('gap', t('data.legend_gap')));
  }

  exports() {
    const {t} = this.context;
    this.csv = h('a.menu-link', {download: ''}, t('data.csv'));
    this.fhir = h('a.menu-link', {download: ''}, t('data.fhir'));
    return h('details.data-menu', h('summary.button.quiet', t('data.export')),
      h('div.data-layers', this.csv, this.fhir, h('p.help', t('data.export_help'))));
  }

  writeExports() {
    const {view} = this;
    const ns = (ms) => BigInt(Math.round(ms)) * 1_000_000n;
    const query = `start=${ns(view.timeline.start)}&end=${ns(view.timeline.end)}`;
    const base = `/api/people/${encodeURIComponent(view.person)}`;
    this.csv.href = `${base}/export.csv?${query}`;
    this.fhir.href = `${base}/export.json?${query}`;
  }

  switchTable() {
    const isShown = this.asTable.getAttribute('aria-pressed') !== 'true';
    attribute(this.asTable, 'aria-pressed', String(isShown));
    this.view.setTable(isShown);
  }

  /** Say why there is no history; null: there is. */
  failed(error) {
    const {t} = this.context;
    if (!error) {
      replace(this.problem);
      return;
    }
    const text = error.status === 0 ? t('data.no_answer') : problemElement(error, t);
    replace(this.problem, notice('error', t('data.no_history'), text, button(t('data.again'),
      () => this.view.history.refresh())));
  }
}

function step(sign, text, onclick) {
  return h('button.button.icon-only.quiet', {type: 'button', 'aria-label': text, title: text,
    onclick}, h('span', {'aria-hidden': 'true'}, sign));
}

// @ts-check
/** Alarms: the open ones and those of the past; of the chosen one the time line and what to do. */

import {Detail} from './alarms/detail.js';
import {list} from './alarms/list.js';
import {h, replace, write} from '../lib/dom.js';
import {outageOf} from '../lib/outage.js';
import {segments} from '../lib/parts.js';

const HISTORY = 100;
// The past changes rarely; what is open comes live.
const AGAIN_MS = 30000;

export const view = {
  name: 'alarms',
  permission: 'see',
  open(root, context, arg) {
    return new Alarms(root, context, arg).close;
  },
};

class Alarms {
  constructor(root, context, arg) {
    const {t} = context;
    this.context = context;
    this.past = null;
    this.problem = null;
    this.isAll = false;
    this.chosen = arg;
    this.items = h('div.alarm-list');
    this.count = h('h2');
    this.pane = h('section.alarm-pane', {'aria-label': t('alarms.history')});
    const choice = segments(t('alarms.show'), {open: t('alarms.open'), all: t('alarms.all')},
      'open', (value) => this.showAll(value === 'all'));
    this.root = root;
    replace(root, h('div.alarm-columns', h('section.section', h('div.section-head',
      this.count, choice), this.items), this.pane));
    root.classList.toggle('has-chosen', Boolean(arg));
    this.detail = new Detail(this.pane, context, arg);
    const off = context.state.on('alarms tick', (kind) => this.show(kind));
    this.timer = setInterval(() => this.isAll && this.load(true), AGAIN_MS);
    this.close = () => {
      off();
      clearInterval(this.timer);
      this.detail.close();
    };
    this.show('alarms');
    if (!context.state.openAlarms().length) {
      choice.show('all');
      this.showAll(true);
    }
  }

  showAll(isAll) {
    this.isAll = isAll;
    this.show('alarms');
    if (isAll) {
      this.load(false);
    }
  }

  async load(isBackground) {
    try {
      this.past = await this.context.api.get('/api/alarms', {limit: HISTORY},
        {background: isBackground});
      this.problem = null;
    } catch (error) {
      this.problem = error;
    }
    this.show('alarms');
  }

  show(kind) {
    const n = this.context.state.openAlarms().length;
    // None is an answer only where there would be another one.
    write(this.count, n || !outageOf(this.context.state) ? this.context.t('alarms.count', {n})
      : this.context.t('alarms.count_unknown'));
    list(this.items, this.context, this.found(), {isAll: this.isAll, chosen: this.chosen,
      isLoading: this.isAll && !this.past && !this.problem, problem: this.problem});
    this.detail.show(kind);
  }

  found() {
    const open = this.context.state.openAlarms();
    if (!this.isAll || !this.past) {
      return open;
    }
    const known = new Set(open.map((each) => `${each.robot}/${each.id}`));
    const past = this.past.filter((each) => !known.has(`${each.robot}/${each.id}`));
    past.sort((one, other) => (other.opened_ns || 0) - (one.opened_ns || 0));
    return [...open, ...past];
  }
}

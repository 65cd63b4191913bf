// @ts-check
/** The audit log: who did and saw what; whether it is whole; to take it away. */

import {add, attribute, h, replace, write} from '../lib/dom.js';
import {badge, button, field, notice, section} from '../lib/parts.js';
import {attempt} from '../lib/problem.js';
import {said} from '../lib/said.js';

const PAGE = 100;
// Ids of robots and sessions, which say nothing to people; so much of one tells it from others.
const ID = /\b([0-9a-f]{16,})\b/;
const SHORT_ID = 8;

export const view = {
  name: 'audit',
  permission: 'audit',
  open(root, context) {
    const shown = new AuditView(root, context);
    return () => shown.close();
  },
};

class AuditView {
  constructor(root, context) {
    this.context = context;
    const {t} = context;
    this.asked = 0;
    this.name = h('input', {type: 'search', autocomplete: 'off', spellcheck: 'false'});
    this.action = h('input', {type: 'search', autocomplete: 'off', spellcheck: 'false',
      placeholder: 'session.'});
    const form = h('form.audit-filter', field(t('audit.name'), this.name),
      field(t('audit.action'), this.action, t('audit.action_help')),
      h('button.button', {type: 'submit'}, t('audit.search')));
    form.onsubmit = (event) => {
      event.preventDefault();
      this.begin();
    };
    this.verdict = h('div', {role: 'status'});
    this.note = h('div', {role: 'status'});
    this.body = h('tbody');
    this.more = button(t('audit.more'), () => this.load());
    replace(root, section(t('audit.chain'), h('div.card.audit-chain', h('p', t('audit.text')),
      this.verdict, h('div.actions', button(t('audit.verify'), () => this.verify(),
        {kind: 'primary', icon: 'check'}), h('a.button', {href: '/api/audit/export',
        download: 'audit.jsonl'}, t('audit.export'))))),
    section(t('audit.rows'), form, this.note, h('div.table-box', {tabindex: '0', role: 'region',
      'aria-label': t('audit.rows')}, h('table.table.audit-table', h('thead', h('tr',
      ['time', 'name', 'action', 'object', 'details', 'address', 'seq'].map((each) => h('th',
        {scope: 'col'}, t(`audit.${each}`))))), this.body)), this.more));
    this.begin();
  }

  begin() {
    this.before = null;
    this.asked += 1;
    replace(this.body);
    return this.load();
  }

  async load() {
    const {t, api} = this.context;
    const mine = this.asked;
    const found = await attempt(() => api.get('/api/audit', {before: this.before, limit: PAGE,
      name: this.name.value || null, action: this.action.value || null}), t);
    if (!found || mine !== this.asked) {
      return;
    }
    this.before = found.rows.at(-1)?.seq ?? this.before;
    this.more.hidden = found.rows.length < PAGE;
    add(this.body, found.rows.map((each) => this.row(each)));
    replace(this.note, found.lost + found.waiting > 0 && notice('error', t('audit.lost',
      {n: found.lost + found.waiting})), !this.body.children.length && notice('empty',
      t('audit.none')));
  }

  row(each) {
    const {t, format} = this.context;
    const action = actionText(each.action, t);
    const details = Object.entries(each.details).filter(([key]) => key !== 'flag')
      .map(([key, value]) => `${key}: ${typeof value === 'object' ? JSON.stringify(value) : value}`);
    return h('tr', h('td', format.dateTime(each.t_ns / 1e6)),
      h('th', {scope: 'row'}, each.name), h('td', action, action !== each.action && h('div.small.muted', {translate: 'no'}, each.action),
        each.details.flag === 'emergency' && [' ', badge('warn', t('audit.flag'), 'warn')]),
      h('td.wrap', this.readable(each.object)),
      h('td.wrap.audit-details', this.readable(details.join('; '))),
      h('td', each.address), h('td.end', String(each.seq)));
  }

  /** A text in which ids are short: the name of a robot, or a button that shows the whole id. */
  readable(text) {
    // What the brackets of the expression hold is at odd places.
    return String(text ?? '').split(ID).map((part, at) => (at % 2 ? this.short(part) : part));
  }

  short(id) {
    const {t, state} = this.context;
    const short = state.robots.get(id)?.name || `${id.slice(0, SHORT_ID)}…`;
    const made = h('button.audit-id', {type: 'button', title: id, 'aria-expanded': 'false',
      'aria-label': t('audit.id', {short})}, short);
    made.onclick = () => {
      const isWhole = made.getAttribute('aria-expanded') === 'true';
      attribute(made, 'aria-expanded', String(!isWhole));
      attribute(made, 'aria-label', isWhole ? t('audit.id', {short}) : null);
      write(made, isWhole ? short : id);
    };
    return made;
  }

  async verify() {
    const {t, api} = this.context;
    const found = await attempt(() => api.get('/api/audit/verify'), t);
    if (found) {
      replace(this.verdict, found.whole
        ? notice('calm', t('audit.whole', {n: found.rows}), t('audit.head', {head: found.head}))
        : notice('error', t('audit.broken'), found.problems.map((each, index) =>
          said(t, each, found.codes?.[index]).text).join('; ')));
    }
  }

  close() {
    this.asked += 1;
  }
}

/** What was done in words; what this page has no word for is shown as the server has it. */
function actionText(action, t) {
  const key = `audit.do_${action.replaceAll('.', '_')}`;
  return t.words.messages.has(key) ? t(key) : action;
}

// @ts-check
/** Who saw, in an emergency, whom they may not see otherwise, and why. */

import {h, replace} from '../../lib/dom.js';
import {badge, notice} from '../../lib/parts.js';
import {attempt} from '../../lib/problem.js';

export async function emergencies(place, context, isOpen) {
  const {t, api, format} = context;
  const found = await attempt(() => api.get('/api/emergencies'), t);
  if (!found || !isOpen()) {
    return;
  }
  replace(place, h('h2', t('admin.emergencies')), h('p.help', t('admin.emergencies_text')),
    found.length ? h('div.table-box', {tabindex: '0', role: 'region',
      'aria-label': t('admin.emergencies')}, h('table.table', h('thead', h('tr',
      ['who', 'person', 'reason', 'from', 'to'].map((each) => h('th', {scope: 'col'},
        t(`admin.emergency_${each}`))))), h('tbody', found.map((each) => h('tr',
      h('th', {scope: 'row'}, each.name),
      h('td', each.person === '*' ? t('admin.everybody') : each.person),
      h('td.wrap', each.reason), h('td', format.dateTime(each.begins_ns / 1e6)),
      h('td', each.is_open ? badge('warn', t('admin.emergency_open'), 'clock')
        : format.dateTime(each.ends_ns / 1e6)))))))
      : notice('calm', t('admin.no_emergency')));
}

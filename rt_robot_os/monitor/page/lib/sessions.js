// @ts-check
/** A table of sessions, one's own or somebody else's. */

import {h} from './dom.js';
import {badge, button, notice} from './parts.js';

/**
 * @param {Object} context
 * @param {Array} sessions as the server gives them
 * @param {function(Object): *} end ends one
 */
export function sessionTable({t, format}, sessions, end) {
  if (!sessions.length) {
    return notice('empty', t('admin.no_session'));
  }
  return h('div.table-box', {tabindex: '0', role: 'region', 'aria-label': t('admin.sessions')},
    h('table.table', h('thead', h('tr', ['browser', 'address', 'since', 'used', 'end'].map(
      (each) => h('th', {scope: 'col'}, t(`admin.session_${each}`))))),
    h('tbody', sessions.map((each) => h('tr', h('th', {scope: 'row', title: each.browser},
      browserName(each.browser, t), each.is_this && [' ', badge('accent', t('admin.this'))]),
    h('td', each.address), h('td', format.time(each.created_ns / 1e6, false)),
    h('td', format.time(each.seen_ns / 1e6, false)),
    h('td', !each.is_this && button(t('admin.session_end'), () => end(each), {kind: 'quiet'})))))));
}

/** What people call a browser and its machine, of what it calls itself. */
function browserName(text, t) {
  const browser = [['Edg', 'Edge'], ['OPR', 'Opera'], ['Firefox', 'Firefox'], ['Chrome', 'Chrome'],
    ['Safari', 'Safari']].find(([word]) => text.includes(word));
  const machine = [['iPad', 'iPad'], ['iPhone', 'iPhone'], ['Android', 'Android'],
    ['Windows', 'Windows'], ['Macintosh', 'Mac'], ['Linux', 'Linux']]
    .find(([word]) => text.includes(word));
  return [browser?.[1], machine?.[1]].filter(Boolean).join(', ') || t('admin.other_browser');
}

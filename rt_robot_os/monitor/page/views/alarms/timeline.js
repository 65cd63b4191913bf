/** What happened to an alarm: events, notes and pictures, the first at the top. */

import {h, replace} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {notice} from '../../lib/parts.js';

const ICONS = {suspected: 'urgent', raised: 'critical', cause: 'warn', confirmed: 'urgent',
  notified: 'phone', delivered: 'check', failed: 'close', repeated: 'phone', escalated: 'up',
  top: 'up', acknowledged: 'person', unacknowledged: 'critical', resolved: 'check',
  cancelled: 'close', test: 'info', note: 'note', picture: 'picture'};
const LOUD = new Set(['raised', 'suspected', 'cause', 'confirmed', 'unacknowledged', 'failed', 'top']);
const DONE = new Set(['acknowledged', 'resolved', 'cancelled']);

/** Show the time line of an alarm with its events, notes and media. */
export function timeline(element, alarm, context) {
  const {t} = context;
  const found = entries(alarm).sort((one, other) => one.ns - other.ns);
  if (!found.length) {
    replace(element, notice('empty', t('alarms.no_history'), t('alarms.no_history_text')));
    return;
  }
  replace(element, h('ol.timeline', found.map((each) => entry(each, context))));
}

function entries(alarm) {
  const events = (alarm.events || []).map((each) => ({ns: each.utc_ns || each.t_ns,
    kind: each.event, by: each.by, text: about(each), kinds: each.kinds}));
  const notes = (alarm.notes || []).map((each) => ({ns: each.t_ns, kind: 'note', by: each.by,
    text: each.text}));
  const media = (alarm.media || []).map((each) => ({ns: each.t_ns, kind: 'picture', text: each.camera
    || ''}));
  return [...events, ...notes, ...media];
}

function about({event, why, text}) {
  return ['raised', 'suspected', 'cause', 'confirmed'].includes(event) ? why || text : why;
}

function entry(each, {t, format}) {
  const kind = LOUD.has(each.kind) ? 'loud' : DONE.has(each.kind) ? 'done' : 'plain';
  const said = told(each, t);
  return h(`li.moment.moment-${kind}`, h('span.moment-mark', icon(ICONS[each.kind] || 'info')),
    h('time.number', {datetime: new Date(each.ns / 1e6).toISOString()},
      format.time(each.ns / 1e6)),
    h('p', h('strong', t.word('event', each.kind)), each.by && ` – ${each.by}`,
      said && h('span.moment-text', said)));
}

/** Channels in words, where the text of an event names them. */
function told({kind, text}, t) {
  if (!text || !['notified', 'delivered', 'failed', 'repeated', 'escalated'].includes(kind)) {
    return text;
  }
  const [names, ...rest] = text.split(': ');
  return [names.split(', ').map((each) => t.word('channel', each)).join(', '), ...rest].join(': ');
}

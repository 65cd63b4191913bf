// @ts-check
/** What happened to an alarm: events, notes and pictures, the first at the top. */

import {h, replace} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';
import {notice} from '../../lib/parts.js';
import {said, saidElement} from '../../lib/said.js';

const ICONS = {suspected: 'urgent', raised: 'critical', cause: 'warn', confirmed: 'urgent',
  notified: 'phone', delivered: 'check', failed: 'close', repeated: 'phone', escalated: 'up',
  top: 'up', acknowledged: 'person', unacknowledged: 'critical', resolved: 'check',
  cancelled: 'close', test: 'info', note: 'note', picture: 'picture'};
const LOUD = new Set(['raised', 'suspected', 'cause', 'confirmed', 'unacknowledged', 'failed', 'top']);
const DELIVERIES = new Set(['notified', 'delivered', 'repeated', 'escalated']);
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
    kind: each.event, by: each.by, ...about(each), kinds: each.kinds}));
  const notes = (alarm.notes || []).map((each) => ({ns: each.t_ns, kind: 'note', by: each.by,
    text: each.text}));
  const media = (alarm.media || []).map((each) => ({ns: each.t_ns, kind: 'picture', text: each.camera
    || ''}));
  return [...events, ...notes, ...media];
}

/** Of an event: why it happened, or of the first ones what the alarm is about. */
function about({event, why, text, codes}) {
  const isFirst = ['raised', 'suspected', 'cause', 'confirmed'].includes(event);
  return why || !isFirst ? {text: why, coded: codes?.why} : {text, coded: codes?.text};
}

function entry(each, {t, format}) {
  const kind = LOUD.has(each.kind) ? 'loud' : DONE.has(each.kind) ? 'done' : 'plain';
  const text = wordsOf(each, t);
  return h(`li.moment.moment-${kind}`, h('span.moment-mark', icon(ICONS[each.kind] || 'info')),
    h('time.number', {datetime: new Date(each.ns / 1e6).toISOString()},
      format.time(each.ns / 1e6)),
    h('p', h('strong', t.word('event', each.kind)), each.by && ` – ${each.by}`,
      text && h('span.moment-text', text)));
}

/** What is to be said of it; channels in words, where the text of an event is a list of them. */
function wordsOf({kind, text, coded}, t) {
  if (!text || kind === 'note' || kind === 'picture') {
    return text;
  }
  if (!coded && DELIVERIES.has(kind)) {
    return text.split(', ').map((each) => t.word('channel', each)).join(', ');
  }
  return saidElement(said(t, text, coded));
}

// @ts-check
/** The same as the plots, as a table: for those who do not see them, and to read off numbers. */

import {h, replace} from '../../lib/dom.js';
import {timeText} from './axis.js';

const LINES = 24;

/** Return the times at which the lines of a table begin: round ones. */
export function linesOf(start, end, most = LINES) {
  const wanted = (end - start) / most;
  const steps = [100, 200, 500, 1000, 2000, 5000, 10_000, 15_000, 30_000, 60_000, 120_000, 300_000,
    600_000, 900_000, 1_800_000, 3_600_000, 7_200_000, 14_400_000, 28_800_000, 86_400_000,
    172_800_000, 604_800_000, 1_209_600_000, 2_592_000_000];
  const step = steps.find((each) => each >= wanted) || steps[steps.length - 1];
  const lines = [];
  for (let t = Math.floor(end / step) * step; t > start - step; t -= step) {
    lines.push({from: t, to: t + step});
  }
  return lines;
}

/** Write the table: the newest first, of each sign the mean and from what to what it went. */
export function writeTable(table, rows, timeline, context) {
  const {t} = context;
  const {locale} = t.words;
  const head = h('tr', h('th', {scope: 'col'}, t('data.time')), rows.map((row) => h('th',
    {scope: 'col'}, row.name, row.style.unit && h('span.muted', ` ${row.style.unit}`))));
  const end = Math.min(timeline.end, timeline.now());
  const body = linesOf(timeline.start, end).map(({from, to}) => h('tr',
    h('th.number', {scope: 'row'}, timeText(from, timeline.span, locale)),
    rows.map((row) => cell(row, row.columns.summary(from, to - 1e-3), t))));
  replace(table, h('caption', t('data.table_caption', {
    from: timeText(timeline.start, timeline.span, locale),
    to: timeText(end, timeline.span, locale)})), h('thead', head), h('tbody', body));
}

function cell(row, found, t) {
  if (!found) {
    return h('td.muted', h('span', {'aria-label': t('data.nothing')}, '–'));
  }
  const isRange = found.high - found.low > 10 ** -row.style.digits / 2;
  return h('td.number', row.number(found.mean), isRange && h('span.muted',
    ` (${row.number(found.low)}–${row.number(found.high)})`));
}

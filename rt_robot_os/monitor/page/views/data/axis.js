// @ts-check
/** Labels of a time axis, in the browser's zone and the reader's locale, always with 24 hours. */

const MINUTE = 60_000;
const DAY = 86_400_000;

/**
 * Return what writes the labels of a time axis.
 *
 * @param {string} locale such as `en-GB` or `de`.
 * @param {string} [zone] the browser's own without it.
 * @return {(splits: number[], step: number) => string[]} the labels of times in ms that are `step`
 *     ms apart; the first one, and the first of each day, have the date below them.
 */
export function timeLabels(locale, zone) {
  const make = (options) => new Intl.DateTimeFormat(locale, {timeZone: zone, ...options});
  const clock = {hour: '2-digit', minute: '2-digit', hourCycle: 'h23'};
  const forms = {
    part: make({...clock, second: '2-digit', fractionalSecondDigits: 2}),
    second: make({...clock, second: '2-digit'}),
    minute: make(clock),
    day: make({day: 'numeric', month: 'short'}),
    month: make({month: 'short'}),
    year: make({year: 'numeric'}),
  };
  const below = {part: forms.day, second: forms.day, minute: forms.day, day: forms.year,
                 month: forms.year, year: null};
  return (splits, step) => {
    const name = formOf(step);
    let before = '';
    return splits.map((time) => {
      const text = forms[name].format(time);
      const under = below[name] ? below[name].format(time) : '';
      const isNew = under && under !== before;
      before = under;
      return isNew ? `${text}\n${under}` : text;
    });
  };
}

/** Return a time as a sentence has it: date and clock, as exact as the range needs. */
export function timeText(time, span, locale, zone) {
  /** @type {Intl.DateTimeFormatOptions} */
  const options = {timeZone: zone, hour: '2-digit', minute: '2-digit'};
  if (span > DAY / 2) {
    Object.assign(options, {day: 'numeric', month: 'short'});
  }
  if (span > 60 * DAY) {
    options.year = 'numeric';
  }
  if (span < 2 * 3_600_000) {
    options.second = '2-digit';
  }
  if (span < MINUTE / 2) {
    options.fractionalSecondDigits = 2;
  }
  return new Intl.DateTimeFormat(locale, options).format(time);
}

function formOf(step) {
  if (step < 1000) {
    return 'part';
  }
  if (step < MINUTE) {
    return 'second';
  }
  if (step < DAY) {
    return 'minute';
  }
  if (step < 27 * DAY) {
    return 'day';
  }
  return step < 360 * DAY ? 'month' : 'year';
}

// @ts-check
/** Numbers with their units, times and ages, as the reader writes them. */

const DAY_S = 86400;
const NO_BREAK = '\u00a0';
/** @type {[Intl.RelativeTimeFormatUnit, number][]} */
const UNITS = [['day', DAY_S], ['hour', 3600], ['minute', 60], ['second', 1]];

export class Format {
  /** @param {string} locale such as 'de-AT' */
  constructor(locale) {
    this.locale = locale;
    this.made = new Map();
  }

  /** A number with so many decimals; what is no number is a dash. */
  number(value, decimals = 0) {
    if (typeof value !== 'number' || !Number.isFinite(value)) {
      return '–';
    }
    const options = {minimumFractionDigits: decimals, maximumFractionDigits: decimals};
    return this.maker('NumberFormat', `number${decimals}`, options).format(value);
  }

  /** A share of 0 to 1 as percent. */
  percent(share, decimals = 0) {
    if (typeof share !== 'number' || !Number.isFinite(share)) {
      return '–';
    }
    return this.maker('NumberFormat', `percent${decimals}`,
      {style: 'percent', maximumFractionDigits: decimals}).format(share);
  }

  /** What stands between a number and its unit: a no-break space; of percent as people write it. */
  gap(unit) {
    return unit === '' || unit === '°' ? '' : unit === '%' ? this.percent(0).slice(1, -1) : NO_BREAK;
  }

  /** A number with its unit, such as 'm/s', '°C' or '%'; what is no number is a dash alone. */
  unit(value, unit, decimals = 0) {
    const isNumber = typeof value === 'number' && Number.isFinite(value);
    return isNumber ? `${this.number(value, decimals)}${this.gap(unit)}${unit}` : '–';
  }

  /** How long, in the largest unit that fits: 12 s, 3 min, 5 hr, 2 days. */
  duration(seconds) {
    if (typeof seconds !== 'number' || !Number.isFinite(seconds)) {
      return '–';
    }
    const [unit, size] = unitOf(Math.max(0, seconds));
    return this.maker('NumberFormat', unit,
      {style: 'unit', unit, unitDisplay: 'short', maximumFractionDigits: 0})
      .format(Math.floor(Math.max(0, seconds) / size));
  }

  /** How long ago: 3 min. ago. */
  ago(seconds) {
    if (typeof seconds !== 'number' || !Number.isFinite(seconds)) {
      return '–';
    }
    const [unit, size] = unitOf(Math.max(0, seconds));
    return this.maker('RelativeTimeFormat', 'ago', {style: 'short', numeric: 'always'})
      .format(-Math.floor(Math.max(0, seconds) / size), unit);
  }

  /** The time of the day; with the date unless it was today. */
  time(ms, withSeconds = true) {
    const when = new Date(ms);
    const clock = {hour: '2-digit', minute: '2-digit', ...(withSeconds && {second: '2-digit'})};
    const isToday = when.toDateString() === new Date().toDateString();
    const date = isToday ? {} : {day: 'numeric', month: 'short'};
    return this.maker('DateTimeFormat', `time${withSeconds}${isToday}`, {...date, ...clock})
      .format(when);
  }

  /** Date and time, whole. */
  dateTime(ms) {
    return this.maker('DateTimeFormat', 'whole', {dateStyle: 'medium', timeStyle: 'medium'})
      .format(new Date(ms));
  }

  maker(kind, key, options) {
    const name = `${kind} ${key}`;
    if (!this.made.has(name)) {
      this.made.set(name, new Intl[kind](this.locale, options));
    }
    return this.made.get(name);
  }
}

/**
 * @param {number} seconds
 * @returns {[Intl.RelativeTimeFormatUnit, number]} the largest unit that fits, and its seconds
 */
function unitOf(seconds) {
  return UNITS.find(([, size]) => seconds >= size) || UNITS[UNITS.length - 1];
}

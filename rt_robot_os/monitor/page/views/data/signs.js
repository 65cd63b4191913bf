// @ts-check
/** The signs that plots know, and the bands of NEWS2 (Royal College of Physicians, 2017). */

const MINUTE = 60_000;
const HOUR = 60 * MINUTE;

/**
 * In the order of the page: the axis without values, unit, digits, the least height of the axis,
 * and how long a value says anything (so far apart values are never joined).
 */
export const SIGNS = {
  pulse_per_min: {usual: [60, 90], unit: '/min', digits: 0, least: 30, staleMs: 2 * MINUTE},
  spo2_percent: {usual: [92, 100], unit: '%', digits: 0, least: 10, staleMs: 2 * MINUTE, most: 100},
  respiration_per_min: {usual: [10, 22], unit: '/min', digits: 0, least: 12, staleMs: 2 * MINUTE},
  systolic_mmhg: {usual: [100, 150], unit: 'mmHg', digits: 0, least: 40, staleMs: HOUR},
  diastolic_mmhg: {usual: [60, 95], unit: 'mmHg', digits: 0, least: 30, staleMs: HOUR},
  body_temperature: {usual: [36, 38], unit: '°C', digits: 1, least: 2, staleMs: 4 * HOUR},
  news2: {usual: [0, 8], unit: '', digits: 0, least: 8,
          staleMs: 2 * MINUTE, lowest: 0, most: 20, steps: true},
  consciousness: {usual: [0, 4], unit: '', digits: 0, least: 4,
                  staleMs: 4 * HOUR, lowest: 0, most: 4,
                  steps: true},
  oxygen_l_per_min: {usual: [0, 4], unit: 'l/min', digits: 1, least: 4,
                     staleMs: 12 * HOUR, lowest: 0},
};

// [up to this value, inclusive; points], as the chart has them: values are rounded first.
const SPO2_1 = [[91, 3], [93, 2], [95, 1], [Infinity, 0]];
const SPO2_2_AIR = [[83, 3], [85, 2], [87, 1], [Infinity, 0]];
const SPO2_2_OXYGEN = [[83, 3], [85, 2], [87, 1], [92, 0], [94, 1], [96, 2], [Infinity, 3]];
const BANDS = {
  respiration_per_min: [[8, 3], [11, 1], [20, 0], [24, 2], [Infinity, 3]],
  systolic_mmhg: [[90, 3], [100, 2], [110, 1], [219, 0], [Infinity, 3]],
  pulse_per_min: [[40, 3], [50, 1], [90, 0], [110, 1], [130, 2], [Infinity, 3]],
  body_temperature: [[35.0, 3], [36.0, 1], [38.0, 0], [39.0, 1], [Infinity, 2]],
  consciousness: [[0, 0], [Infinity, 3]],
};

/**
 * Return the zones of a sign in which the chart gives points.
 *
 * @param {string} sign its name.
 * @param {{scale?: number, oxygen?: boolean}} how of SpO2: the scale, and whether oxygen is given.
 * @return {{low: number, high: number, points: number}[]} in the units of the sign; between the
 *     last value of one band and the first of the next lies half of the step of rounding.
 */
export function newsZones(sign, {scale = 1, oxygen = false} = {}) {
  let bands = BANDS[sign];
  if (sign === 'spo2_percent') {
    const second = oxygen ? SPO2_2_OXYGEN : SPO2_2_AIR;
    bands = scale === 2 ? second : SPO2_1;
  }
  const half = sign === 'body_temperature' ? 0.05 : 0.5;
  let low = -Infinity;
  const zones = [];
  for (const [upTo, points] of bands || []) {
    const high = upTo + half;
    if (points) {
      zones.push({low, high, points});
    }
    low = high;
  }
  return zones;
}

/** Return the signs that there are, in the order of the page; unknown ones at the end. */
export function inOrder(names) {
  const known = Object.keys(SIGNS);
  const place = (name) => (known.includes(name) ? known.indexOf(name) : known.length);
  return [...new Set(names)].sort((a, b) => place(a) - place(b) || a.localeCompare(b));
}

/** Return how to draw a sign, of one that is not known as well. */
export function styleOf(sign) {
  return SIGNS[sign] || {usual: [0, 1], unit: '', digits: 1, least: 1, staleMs: 5 * MINUTE};
}

/**
 * Read a personal limit as the configuration has it: `pulse_per_min > 120 for 60 s level urgent`.
 *
 * @return {{sign: string, low: number, high: number, level: string} | null} the zone beyond it;
 *     null for a trend, and for what cannot be read.
 */
export function limitZone(text) {
  const found = /^\s*(\w+)\s*([<>])\s*([+-]?[\d.]+(?:e[+-]?\d+)?)/.exec(String(text));
  const value = found ? Number(found[3]) : NaN;
  if (!Number.isFinite(value)) {
    return null;
  }
  const level = /\blevel\s+(\w+)/.exec(text);
  const isHigh = found[2] === '>';
  return {sign: found[1], low: isHigh ? value : -Infinity, high: isHigh ? Infinity : value,
          level: level ? level[1] : 'warning'};
}

// @ts-check
/** Live signs of a person: values for the plots, and how good each is. */

const NS_PER_MS = 1e6;
const MARKS_MOST = 400;

/**
 * Read what `health/PERSON/signs` says of each sign.
 *
 * @return {Object<string, {value: ?number, quality: string, ageS: ?number, source: string}>}
 */
export function signsOf(value) {
  /** @type {Object<string, *>} */
  const found = {};
  for (const each of (value && value.status) || []) {
    const name = String(each.name).split('/').pop();
    const said = each.values || {};
    found[name] = {value: numberOf(said.value), quality: said.quality || 'missing',
                   ageS: numberOf(said.age_s), source: said.source || ''};
  }
  return found;
}

function numberOf(value) {
  const found = typeof value === 'string' && value !== '' ? Number(value) : value;
  return typeof found === 'number' && Number.isFinite(found) ? found : null;
}

/** Keep stretches of bad quality: {from, to, quality}; the last one may go on (to is null). */
export class Quality {
  constructor() {
    this.marks = [];
    this.version = 0;
  }

  /** It is so at a time. */
  at(t, quality) {
    const last = this.marks[this.marks.length - 1];
    const isOpen = last && last.to === null;
    if (isOpen && last.quality === quality) {
      return;
    }
    if (isOpen && t >= last.from) {
      last.to = t;
      this.version += 1;
    }
    if (quality !== 'good' && (!last || t >= (last.to ?? last.from))) {
      this.marks.push({from: t, to: null, quality});
      this.marks.splice(0, this.marks.length - MARKS_MOST);
      this.version += 1;
    }
  }

  /** Take what the history has; what is live and newer stays. */
  replace(marks) {
    const found = marks.map((each) => ({...each}));
    const last = found[found.length - 1];
    const end = last ? last.to ?? last.from : -Infinity;
    for (const each of this.marks) {
      const isSame = last && last.to === null && each.quality === last.quality
        && each.from >= last.from;
      if (isSame) {
        last.to = each.to;
      } else if (each.from > end) {
        if (last && last.to === null) {
          last.to = each.from;
        }
        found.push(each);
      } else if ((each.to ?? Infinity) > end && !(last && last.to === null)) {
        found.push({...each, from: Math.max(each.from, end)});
      }
    }
    this.marks = found.slice(-MARKS_MOST);
    this.version += 1;
  }
}

/**
 * Hear the signs of a person.
 *
 * @param {Object} context of the page.
 * @param {string} person
 * @param {(sign: string, t: number, value: number) => void} took each value.
 * @param {(t: number, signs: Object) => void} told how good they are, now and then.
 * @return what ends it.
 */
export function hear(context, person, took, told) {
  const prefix = `health/${person}/`;
  const take = (signals) => {
    for (const [name, [utcNs, value]] of Object.entries(signals)) {
      if (name.startsWith(prefix)) {
        const sign = name.slice(prefix.length);
        if (sign === 'signs') {
          told(utcNs / NS_PER_MS, signsOf(value));
        } else if (typeof value === 'number' && !sign.includes('/')) {
          took(sign, utcNs / NS_PER_MS, value);
        }
      }
    }
  };
  const ends = [
    context.state.on('signals', (kind, {signals}) => take(signals)),
    context.live.watch('data', null, [`${prefix}*`], 20),
  ];
  return () => ends.forEach((end) => end());
}

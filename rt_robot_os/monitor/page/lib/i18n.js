// @ts-check
/**
 * Words in the reader's language: messages/LANGUAGE/NAME.json, keys NAME.key; English where a
 * message is missing. A message may be an object by plural rule: {"one": ..., "other": ...}.
 */

import {asset} from './asset.js';
import {localeOf} from './locale.js';

export const LANGUAGES = {en: 'English', de: 'Deutsch'};
const FALLBACK = 'en';

export class Words {
  constructor() {
    this.language = FALLBACK;
    /** How dates and numbers are written, such as 'en-GB'. */
    this.locale = localeOf(FALLBACK);
    this.messages = new Map();
    /** By name, a promise that ends when the messages are there. */
    this.loaded = new Map();
  }

  /** The language that was chosen, or the browser's, as far as there is one. */
  static preferred() {
    const wanted = [stored('language'), ...(navigator.languages || [])]
      .filter(Boolean).map((each) => each.slice(0, 2).toLowerCase());
    return wanted.find((each) => each in LANGUAGES) || FALLBACK;
  }

  /** Change the language: what was loaded is loaded again. */
  async use(language) {
    this.language = language in LANGUAGES ? language : FALLBACK;
    this.locale = localeOf(this.language);
    this.messages.clear();
    this.plurals = new Intl.PluralRules(this.language);
    document.documentElement.lang = this.language;
    const again = [...this.loaded.keys()];
    this.loaded.clear();
    await this.load(...again);
  }

  /** Load the messages of some views. */
  async load(...names) {
    await Promise.all(names.map((name) => {
      if (!this.loaded.has(name)) {
        this.loaded.set(name, this.fetch(name));
      }
      return this.loaded.get(name);
    }));
  }

  async fetch(name) {
    const files = this.language === FALLBACK ? [FALLBACK] : [FALLBACK, this.language];
    const found = await Promise.all(files.map((each) => fetched(asset(`messages/${each}/${name}.json`))));
    found.forEach((each) => Object.entries(each).forEach(([k, v]) => this.messages.set(k, v)));
  }

  /**
   * Say something.
   * @param {string} key such as 'shell.close'
   * @param {Object} [values] for {name} in the message; n chooses the plural
   */
  say(key, values = {}) {
    let message = this.messages.get(key);
    if (message === undefined) {
      return key;
    }
    if (typeof message === 'object') {
      const n = Number(values.n);
      message = (n === 0 && message.zero) || message[this.plurals.select(n)] || message.other;
    }
    return message.replace(/\{(\w+)\}/g, (all, name) => this.shown(values[name], all));
  }

  shown(value, otherwise) {
    if (value === undefined || value === null) {
      return otherwise;
    }
    return typeof value === 'number' ? value.toLocaleString(this.locale) : String(value);
  }

  /** A word of a family, such as a level or a kind of cause; what is unknown is shown as it is. */
  word(family, name) {
    const found = this.messages.get(`words.${family}.${name}`);
    return found === undefined ? String(name ?? '').replaceAll('_', ' ') : found;
  }

  /** Whether there is such a word. */
  has(family, name) {
    return this.messages.has(`words.${family}.${name}`);
  }
}

/** Make t(key, values), with t.word(family, name) and t.words. */
export function translator(words) {
  const t = (key, values) => words.say(key, values);
  t.word = (family, name) => words.word(family, name);
  t.has = (family, name) => words.has(family, name);
  t.words = words;
  return t;
}

async function fetched(path) {
  try {
    const answer = await fetch(path);
    return answer.ok ? await answer.json() : {};
  } catch (error) {
    return {};
  }
}

/** What this browser remembers, or null. */
export function stored(name) {
  try {
    return localStorage.getItem(name);
  } catch (error) {
    return null;
  }
}

/** Remember something in this browser, if it may; null forgets. */
export function store(name, value) {
  try {
    if (value === null) {
      localStorage.removeItem(name);
    } else {
      localStorage.setItem(name, value);
    }
  } catch (error) {
    // Private windows may not: it holds until the page is closed.
  }
}

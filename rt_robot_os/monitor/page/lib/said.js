// @ts-check
/**
 * Texts of the server and of robots in the reader's words. Each comes with a code and arguments;
 * one without a code, or with a code that this page does not know, is shown as the sender wrote it,
 * in English, and marked as such.
 */

import {attribute, h, write} from './dom.js';

/** The language in which servers and robots write. */
const SENDERS = 'en';
// What an argument of this name is a word of.
const FAMILIES = {kind: 'kind', sign: 'sign', channel: 'channel', level: 'level', node: 'room',
  room: 'room', state: 'state', role: 'role'};

/**
 * Word a text.
 * @param {Object} t the translator
 * @param {string} text as the sender wrote it
 * @param {?{code: string, args: Object}} coded its code, if it has one
 * @returns {{text: string, lang: ?string}} lang: of a text that is not in the reader's words
 */
export function said(t, text, coded) {
  const key = coded && `said.${coded.code}`;
  if (!key || !t.words.messages.has(key)) {
    return {text: String(text ?? ''), lang: text && t.words.language !== SENDERS ? SENDERS : null};
  }
  let lang = null;
  const word = (name, value) => {
    if (Array.isArray(value)) {
      return value.map((each) => word(name.replace(/s$/, ''), each)).join(', ');
    }
    if (value && typeof value === 'object') {
      const inner = said(t, value.text, value.code ? value : null);
      lang = lang || inner.lang;
      return inner.text;
    }
    if (name === 'about') {
      return t.word(t.has('kind', value) ? 'kind' : 'channel', value);
    }
    return name in FAMILIES ? t.word(FAMILIES[name], value) : value;
  };
  const values = Object.fromEntries(Object.entries(coded.args || {}).map(([name, value]) =>
    [name, word(name, value)]));
  return {text: t(key, values), lang};
}

/** Word a text member of a message, such as 'text' or 'why', by the codes beside it. */
export function saidOf(t, message, name) {
  return said(t, message?.[name], message?.codes?.[name]);
}

/** Word a signal of a robot that is a text. */
export function saidSignal({t, state}, robot, name) {
  const found = state.signal(robot, name)?.value;
  const text = found && typeof found === 'object' ? found.data || found.text : found;
  return said(t, text ?? '', state.signal(robot, `codes/${name}`)?.value);
}

/** An element with such a text. */
export function saidElement(found, tag = 'span') {
  return h(tag, {lang: found.lang}, found.text);
}

/** Write such a text into an element if it differs. */
export function writeSaid(element, {text, lang}) {
  attribute(element, 'lang', lang);
  return write(element, text);
}

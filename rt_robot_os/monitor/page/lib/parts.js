// @ts-check
/** Parts that all views are built of: buttons, badges, notices, ages, fields. */

import {attribute, h, replace, tone, write} from './dom.js';
import {icon} from './icons.js';

/**
 * A button with words, and perhaps an icon before them.
 * @param {string} text
 * @param {function(Event): *} onclick while what it returns is pending the button is busy
 * @param {{kind?: string, icon?: string, title?: string, key?: string}} [how] kind: primary, quiet,
 *   danger, critical; key: the shortcut to show
 */
export function button(text, onclick, how = {}) {
  const made = h(`button.button${how.kind ? `.${how.kind}` : ''}`,
    {type: 'button', title: how.title, 'aria-keyshortcuts': how.key},
    how.icon && icon(how.icon), h('span.label', text), how.key && h('kbd', how.key));
  made.onclick = (event) => busy(made, () => onclick(event));
  return made;
}

/** A button that is an icon only; its name is read out and shown as a tip. */
export function iconButton(name, text, onclick, kind = 'quiet') {
  return h(`button.button.icon-only.${kind}`, {type: 'button', 'aria-label': text, title: text,
    onclick}, icon(name));
}

/** Do something that takes a while; meanwhile the button does nothing. */
export async function busy(element, work) {
  if (element.getAttribute('aria-busy') === 'true') {
    return;
  }
  const found = work();
  if (found && typeof found.then === 'function') {
    attribute(element, 'aria-busy', 'true');
    try {
      await found;
    } finally {
      attribute(element, 'aria-busy', null);
    }
  }
}

/** A word on its colour, with an icon so that the colour is not all; kind is a tone of base.css. */
export function badge(kind, text, iconName = '') {
  return h(`span.badge.tone-${kind}`, iconName && icon(iconName), h('span', text));
}

/** Change a badge. */
export function setBadge(element, kind, text, iconName = '') {
  tone(element, 'tone', kind);
  if (element.dataset.icon !== iconName || !element.lastChild) {
    replace(element, iconName && icon(iconName), h('span', text));
    element.dataset.icon = iconName;
  }
  write(element.lastChild, text);
  return element;
}

/** The icon that goes with a level of alarms. */
export function levelIcon(level) {
  return {critical: 'critical', urgent: 'urgent', warning: 'warn'}[level] || 'technical';
}

/**
 * What stands where there is nothing to show: why, and what to do.
 * @param {string} kind empty, loading, error, offline
 * @param {string} title
 * @param {string | Node} [text]
 * @param {?HTMLElement} [action]
 */
export function notice(kind, title, text = '', action = null) {
  const icons = {empty: 'info', loading: 'clock', error: 'warn', offline: 'offline', calm: 'check',
    locked: 'locked'};
  return h(`div.notice.notice-${kind}`, {role: kind === 'error' ? 'alert' : null},
    icon(icons[kind] || 'info'), h('div.notice-words', h('p.notice-title', title),
      text && h('p.notice-text', text), action));
}

/** A section with a heading, and what belongs to it at its right. */
export function section(title, ...children) {
  return h('section.section', h('h2', title), children);
}

let fields = 0;

/** A field of a form with its label, and a line of help under it. */
export function field(label, input, help = '') {
  fields += input.id ? 0 : 1;
  const id = input.id || `field-${fields}`;
  input.id = id;
  if (help) {
    input.setAttribute('aria-describedby', `${id}-help`);
  }
  return h('div.field', h('label', {for: id}, label), input,
    help && h('p.help', {id: `${id}-help`}, help));
}

/** A choice among options {value: text}. */
export function select(options, value, onchange) {
  const made = h('select', Object.entries(options).map(([key, text]) => h('option', {value: key},
    text)));
  made.value = value;
  made.onchange = () => onchange(made.value);
  return made;
}

/** Choices of which one is pressed, side by side. */
export function segments(label, options, value, onchange) {
  const made = h('div.segments', {role: 'group', 'aria-label': label});
  const show = (now) => [...made.children].forEach((each) => attribute(each, 'aria-pressed',
    String(each.getAttribute('data-value') === now)));
  for (const [key, text] of Object.entries(options)) {
    made.append(h('button', {type: 'button', 'data-value': key, onclick: () => {
      show(key);
      onchange(key);
    }}, text));
  }
  show(value);
  return Object.assign(made, {show});
}

/** Write how old something is, and grey what it belongs to when that is too old. */
export function showAge(element, greyed, ageS, staleS, format) {
  const isStale = !(ageS <= staleS);
  write(element, Number.isFinite(ageS) ? format.duration(ageS) : '–');
  greyed.classList.toggle('is-stale', isStale);
  return isStale;
}

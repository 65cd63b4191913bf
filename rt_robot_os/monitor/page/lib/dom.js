// @ts-check
/**
 * Elements made by code: data never becomes markup.
 */

/**
 * The element of a tag with classes.
 * @template {string} T
 * @typedef {T extends keyof HTMLElementTagNameMap ? HTMLElementTagNameMap[T]
 *   : T extends `${infer N}.${string}`
 *     ? N extends keyof HTMLElementTagNameMap ? HTMLElementTagNameMap[N] : HTMLElement
 *     : HTMLElement} ElementOf
 */

const SVG = 'http://www.w3.org/2000/svg';

/**
 * Make an element: h('button.primary', {onclick: f}, 'Save').
 * @template {string} T
 * @param {T} tag name and classes, such as 'div.card.wide'
 * @param {...*} rest properties (a plain object, first), then children; null and false are nothing
 * @returns {ElementOf<T>}
 */
export function h(tag, ...rest) {
  const [name, ...classes] = tag.split('.');
  return fill(document.createElement(name || 'div'), classes, rest);
}

/** Make an SVG element, in the same way. */
export function svg(tag, ...rest) {
  const [name, ...classes] = tag.split('.');
  return fill(document.createElementNS(SVG, name), classes, rest);
}

function fill(element, classes, rest) {
  if (classes.length) {
    element.classList.add(...classes);
  }
  if (isProperties(rest[0])) {
    set(element, rest.shift());
  }
  add(element, rest);
  return element;
}

function isProperties(value) {
  return value !== null && typeof value === 'object' && !(value instanceof Node)
    && !Array.isArray(value);
}

/** Set properties: on..., class, style (an object), attributes; null and false take them away. */
export function set(element, properties) {
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith('on')) {
      element[name] = value;
    } else if (name === 'class') {
      element.classList.add(...String(value).split(' ').filter(Boolean));
    } else if (name === 'style') {
      Object.entries(value).forEach(([key, each]) => element.style.setProperty(key, each));
    } else if (name === 'value' || name === 'checked') {
      element[name] = value;
    } else {
      attribute(element, name, value);
    }
  }
  return element;
}

/** Set an attribute if it differs; null, undefined and false take it away. */
export function attribute(element, name, value) {
  if (value === null || value === undefined || value === false) {
    if (element.hasAttribute(name)) {
      element.removeAttribute(name);
    }
  } else {
    const text = value === true ? '' : String(value);
    if (element.getAttribute(name) !== text) {
      element.setAttribute(name, text);
    }
  }
}

/** Add children; arrays are taken apart, null and false are nothing. */
export function add(element, children) {
  for (const child of children.flat(Infinity)) {
    if (child !== null && child !== undefined && child !== false) {
      element.append(child instanceof Node ? child : String(child));
    }
  }
  return element;
}

/** Put these children in the place of all others. */
export function replace(element, ...children) {
  const focused = element.contains(document.activeElement) && element !== document.activeElement
    ? document.activeElement : null;
  const name = focused && nameOf(focused);
  element.replaceChildren();
  add(element, children);
  if (name) {
    // Who goes by keys stays where they were: on what is called the same.
    [...element.querySelectorAll(focused.tagName)].find((each) => nameOf(each) === name)
      ?.focus({preventScroll: true});
  }
  return element;
}

/** What a link, a button or a field is called. */
function nameOf(element) {
  return element.getAttribute('aria-label') || (element.labels?.[0] || element).textContent;
}

/** Set the text of an element if it differs: nothing is drawn, or read out, for nothing. */
export function write(element, text) {
  const now = text === null || text === undefined ? '' : String(text);
  if (element.textContent !== now) {
    element.textContent = now;
  }
  return element;
}

/** Give an element one class of a family: tone(card, 'tone', 'critical') is class tone-critical. */
export function tone(element, family, value) {
  const wanted = `${family}-${value}`;
  if (element.classList.contains(wanted)) {
    return element;
  }
  for (const each of [...element.classList]) {
    if (each.startsWith(`${family}-`)) {
      element.classList.remove(each);
    }
  }
  element.classList.add(wanted);
  return element;
}

/**
 * Keep one child for each item, made once and then updated, in the order of the items. While the
 * focus or the pointer is in the list its order waits: nothing moves away under a finger.
 * @param {HTMLElement & {kept?: Map<string, HTMLElement>}} parent it has no other children
 * @param {Array} items
 * @param {function(*): string} keyOf
 * @param {function(*): HTMLElement} make
 * @param {function(HTMLElement, *): void} update
 * @param {boolean} [now] order at once
 */
export function keep(parent, items, keyOf, make, update, now = false) {
  const had = parent.kept || new Map();
  const kept = new Map();
  for (const item of items) {
    const key = keyOf(item);
    const element = had.get(key) || make(item);
    kept.set(key, element);
    update(element, item);
  }
  for (const [key, element] of had) {
    if (!kept.has(key)) {
      element.remove();
    }
  }
  parent.kept = kept;
  const isHeld = !now && (parent.contains(document.activeElement) || parent.matches(':hover'));
  arrange(parent, [...kept.values()], isHeld);
}

function arrange(parent, elements, isHeld) {
  if (isHeld) {
    elements.filter((each) => each.parentNode !== parent).forEach((each) => parent.append(each));
    return;
  }
  const focused = parent.contains(document.activeElement) ? document.activeElement : null;
  let place = parent.firstChild;
  for (const element of elements) {
    if (element === place) {
      place = place.nextSibling;
    } else {
      parent.insertBefore(element, place);
    }
  }
  if (focused && document.activeElement !== focused) {
    /** @type {HTMLElement} */ (focused).focus({preventScroll: true});
  }
}

/**
 * Do something at most once a frame, however often it is asked for.
 * @param {function(): void} work
 * @returns {{(): void, stop(): void}} ask for it
 */
export function framed(work) {
  let asked = 0;
  const ask = () => {
    if (!asked) {
      asked = requestAnimationFrame(() => {
        asked = 0;
        work();
      });
    }
  };
  ask.stop = () => {
    cancelAnimationFrame(asked);
    asked = 0;
  };
  return ask;
}

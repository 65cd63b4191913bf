# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What is wrong with the layout of a page of the monitor, found in the browser."""

from __future__ import annotations

from typing import Any

#: What is compared besides place and size.
_LOOKS = ('display position visibility opacity filter clip-path object-fit transform cursor '
          'z-index color background-color background-image border-top-color border-top-style '
          'border-radius box-shadow font-family font-size font-weight text-align '
          'text-decoration-line white-space list-style-type overflow-x overflow-y').split()
#: Compares how the page looks with the style sheets that it has loaded, and with those of all
#: other views before or after them, as after visits to these. Nothing but the sheets differs:
#: it is the same document in the same moment.
_SHEETS = """async ([names, looks]) => {
  const own = document.querySelectorAll('link[rel=stylesheet]');
  const first = own[0];
  const last = own[own.length - 1];
  // At once between two looks: only a sheet can do that, a link would load it again.
  const load = (put) => Promise.all(names.map((name) => new Promise((done, failed) => {
    const link = document.createElement('link');
    link.rel = 'stylesheet';
    link.href = new URL(`style/${name}.css`, first.href.replace(/style.[^/]*$/, '')).href;
    link.onload = () => {
      link.sheet.disabled = true;
      done(link.sheet);
    };
    link.onerror = () => failed(new Error(`no ${link.href}`));
    put(link);
  })));
  const before = await load((link) => last.before(link));
  const after = await load((link) => document.head.append(link));
  const elements = [...document.body.querySelectorAll('*')];
  const look = () => elements.map((each) => {
    const style = getComputedStyle(each);
    const {x, y, width, height} = each.getBoundingClientRect();
    return [`box: ${[x, y, width, height]}`, ...looks.map((name) => `${name}: ${
      style.getPropertyValue(name)}`)];
  });
  const found = [];
  const cold = look();
  for (const [when, sheets] of [['after all other views', before],
    ['before all other views', after]]) {
    sheets.forEach((each) => { each.disabled = false; });
    look().forEach((values, at) => {
      const which = values.findIndex((value, i) => value !== cold[at][i]);
      if (which >= 0) {
        const each = elements[at];
        found.push(`${each.tagName.toLowerCase()}.${each.getAttribute('class') || ''} ${when}: ${
          values[which]}, cold ${cold[at][which]}`);
      }
    });
    sheets.forEach((each) => { each.disabled = true; });
  }
  return [...new Set(found)].slice(0, 12);
}"""

#: Lists what does not fit, cannot be reached, or lies under something else.
_LAYOUT = """({share, keys}) => {
  const found = [];
  const name = (each) => `${each.tagName.toLowerCase()}.${each.className?.baseVal
    ?? each.className}${` "${(each.getAttribute('aria-label') || each.textContent).trim().slice(
    0, 40)}"`}`;
  const say = (what, each) => found.push(`${what}: ${name(each)}`);
  const page = document.documentElement;
  if (page.scrollWidth > innerWidth) {
    found.push(`the page is ${page.scrollWidth} of ${innerWidth} px wide`);
  }
  const main = document.querySelector('.main');
  if (main.scrollWidth > main.clientWidth) {
    found.push(`the view is ${main.scrollWidth} of ${main.clientWidth} px wide`);
  }
  const middle = (each) => {
    const {x, y, width, height} = each.getBoundingClientRect();
    return [x + width / 2, y + height / 2];
  };
  const hit = (each) => {
    const top = document.elementFromPoint(...middle(each));
    return top && (each.contains(top) || top.contains(each) && top.matches('label'))
      ? null : top || page;
  };
  const scrollers = [main, page];
  const scroll = (at) => scrollers.forEach((each) => each.scrollTo({behavior: 'instant',
    top: at * each.scrollHeight}));
  const stop = document.querySelector('.stop');
  for (const at of [0, 0.5, 1]) {
    scroll(at);
    const {x, y, right, bottom} = stop.getBoundingClientRect();
    if (x < 0 || y < 0 || right > innerWidth || bottom > innerHeight || hit(stop)) {
      found.push(`Stop cannot be pressed at ${at}: ${[x, y, right, bottom].map(Math.round)}`);
    }
    if (at === 0.5) {
      let n = 0;
      for (let row = 0; row < 10; row += 1) {
        for (let column = 0; column < 10; column += 1) {
          n += main.contains(document.elementFromPoint((column + 0.5) / 10 * innerWidth,
            (row + 0.5) / 10 * innerHeight)) ? 1 : 0;
        }
      }
      if (n < share) {
        found.push(`the view has ${n} % of the screen`);
      }
    }
  }
  for (const each of document.querySelectorAll('.card, .badge, .button')) {
    if (each.scrollWidth > each.clientWidth + 1 && each.clientWidth) {
      say(`holds ${each.scrollWidth} of ${each.clientWidth} px`, each);
    }
  }
  const isShown = (each) => each.checkVisibility({visibilityProperty: true})
    && each.getClientRects().length && each.getBoundingClientRect().width > 1;
  const scrollsBy = (each) => {
    for (let up = each.parentElement; up && up !== main; up = up.parentElement) {
      if (/auto|scroll/.test(getComputedStyle(up).overflowX)) {
        return true;
      }
    }
    return false;
  };
  const font = getComputedStyle(document.body).fontFamily;
  const controls = [...document.querySelectorAll('button, a[href], input, select, summary')]
    .filter((each) => isShown(each) && !each.matches('.skip'));
  for (const each of controls) {
    const style = getComputedStyle(each);
    if (style.fontFamily !== font || style.borderStyle === 'outset'
        || (each.matches('a, summary') && style.color === 'rgb(0, 0, 238)')) {
      say('has no style', each);
    }
    each.scrollIntoView({block: 'center', behavior: 'instant'});
    const {left, right} = each.getBoundingClientRect();
    if ((left < -1 || right > innerWidth + 1) && !scrollsBy(each)) {
      say(`lies from ${Math.round(left)} to ${Math.round(right)} px`, each);
    } else if (each.getAttribute('aria-hidden') !== 'true' && hit(each)) {
      say(`lies under ${name(hit(each))}`, each);
    }
  }
  scroll(0);
  // Identifiers that are shown on purpose may be equal to the key of a message.
  const shown = [...document.querySelectorAll('[translate=no]')].map((each) => each.innerText);
  const raw = (document.body.innerText.match(/[a-z]+\\.[a-z][a-z_0-9]+/g) || []).find((each) =>
    keys.includes(each) && !shown.includes(each));
  if (raw) {
    found.push(`a message has no words: ${raw}`);
  }
  // What is clipped for screen readers is a pixel wide: it makes the page wider, all the same.
  for (const each of document.body.querySelectorAll('*')) {
    if (isShown(each) && getComputedStyle(each).clipPath === 'inset(50%)'
        && each.offsetWidth > 2 && !each.matches('.skip')) {
      say(`is ${each.offsetWidth} px wide, though nobody sees it`, each);
    }
  }
  return [...new Set(found)].slice(0, 12);
}"""

#: Gives the names of buttons that stand more than once, as a screen reader reads them.
_TWICE = """() => {
  // The same id may stand in many rows of a table.
  const names = [...document.querySelectorAll('button:not(td button)')]
    .filter((each) => each.checkVisibility())
    .map((each) => (each.getAttribute('aria-label') || each.textContent).trim());
  return [...new Set(names.filter((each, at) => names.indexOf(each) !== at))];
}"""


def missing_styles(page: Any, sheets: list[str]) -> list[str]:
    """
    Return which elements look different once the sheets of other views are there.

    :param page: of Playwright, at a view.
    :param sheets: names of all sheets of views.
    """
    found: list[str] = page.evaluate(_SHEETS, [sheets, _LOOKS])
    return found


def misplaced(page: Any, keys: list[str], share: int = 30) -> list[str]:
    """
    Return what is wrong with the layout of a view.

    :param page: of Playwright, at a view with the shell around it.
    :param keys: of all messages; one that is shown has no words.
    :param share: what the view must have of the screen in the middle of the scroll, in percent.
    """
    found: list[str] = page.evaluate(_LAYOUT, {'keys': keys, 'share': share})
    return found


def names_twice(page: Any) -> list[str]:
    """Return the names that more than one button has."""
    found: list[str] = page.evaluate(_TWICE)
    return found

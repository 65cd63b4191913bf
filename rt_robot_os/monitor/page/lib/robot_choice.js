// @ts-check
/** Which robot a view is about: the one of the address, else the first; a choice if there are several. */

import {framed, h, replace} from './dom.js';
import {select} from './parts.js';
import {store, stored} from './i18n.js';

/**
 * Make the choice.
 * @param {Object} context
 * @param {string} wanted the id of a robot, or ''
 * @param {function(string): void} onchange
 * @returns {{element: HTMLElement, robot: ?string, close: function(): void}}
 */
export function robotChoice(context, wanted, onchange) {
  const {t, state} = context;
  const element = h('div.robot-choice');
  const choice = {element, robot: null, close: null};
  let shown = '';
  let isMade = false;
  const draw = () => {
    const robots = [...state.robots.values()];
    const before = choice.robot;
    const known = (id) => id && state.robots.has(id);
    choice.robot = [before, wanted, stored('robot'), robots[0]?.id].find(known) || null;
    const key = robots.map((each) => `${each.id}=${each.name}`).join() + choice.robot;
    if (key !== shown) {
      shown = key;
      replace(element, robots.length > 1 && h('label.choice', h('span.unseen', t('shell.robot')),
        select(Object.fromEntries(robots.map((each) => [each.id, each.name || each.id])),
          choice.robot, (id) => {
            choice.robot = id;
            store('robot', id);
            onchange(id);
          })));
    }
    if (before !== choice.robot && isMade) {
      onchange(choice.robot);
    }
  };
  const later = framed(draw);
  const off = state.on('robots', later);
  choice.close = () => {
    off();
    later.stop();
  };
  draw();
  isMade = true;
  return choice;
}

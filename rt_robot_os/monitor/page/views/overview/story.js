// @ts-check
/** What will happen in the simulated flat of a demonstration, and when. */

import {h, replace, write} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';

/** Show it in an element, which is hidden while there is nothing to say. */
export function showStory(element, {t, state, format}) {
  const found = [...state.robots.values()].find((each) => each.story)?.story;
  element.hidden = !found;
  if (!found) {
    return;
  }
  if (!element.words) {
    element.words = h('span');
    replace(element, icon('clock'), element.words);
  }
  const inS = (found.at_ns - state.nowNs()) / 1e9;
  write(element.words, inS > 0 ? t('overview.story_falls', {person: found.person,
    time: format.duration(Math.ceil(inS))}) : t('overview.story_fallen', {person: found.person}));
}

// @ts-check
/** Everybody at a glance, the worst first: people, then robots. */

import {personCard, updatePerson} from './overview/person_card.js';
import {robotCard, updateRobot} from './overview/robot_card.js';
import {badnessOf} from './overview/robot_words.js';
import {showStory} from './overview/story.js';
import {framed, h, keep, replace, write} from '../lib/dom.js';
import {stateOf} from '../lib/health.js';
import {robotsUp} from '../lib/outage.js';
import {notice} from '../lib/parts.js';
import {Trends} from '../lib/trends.js';

export const view = {
  name: 'overview',
  permission: 'see',
  open(root, context) {
    const {t, state} = context;
    const trends = new Trends(context);
    const parts = {people: h('div.cards'), robots: h('div.cards'), note: h('div.overview-note')};
    const counts = {people: h('p.muted.number'), robots: h('p.muted.number')};
    const story = h('p.overview-story', {hidden: true});
    replace(root, parts.note, story, section(t('overview.people'), counts.people, parts.people),
      section(t('overview.robots'), counts.robots, parts.robots));
    const draw = framed(() => {
      explain(context, parts);
      showStory(story, context);
      showPeople(context, trends, parts.people, counts.people);
      showRobots(context, parts.robots, counts.robots);
    });
    const off = state.on('robots people alarms signals connection tick', draw);
    draw();
    return () => {
      off();
      draw.stop();
      trends.close();
    };
  },
};

function section(title, count, body) {
  return h('section.section', h('div.section-head', h('h2', title), count), body);
}

function showPeople(context, trends, body, count) {
  const {state, t} = context;
  const people = [...state.people.values()].map((each) => ({...each,
    now: stateOf(state, each.person)}));
  people.sort((one, other) => other.now.badness - one.now.badness
    || one.person.localeCompare(other.person));
  keep(body, people, (each) => each.person, (each) => personCard(context, each.person),
    (element, each) => updatePerson(element, each, context, trends));
  body.parentNode.hidden = !people.length;
  write(count, t('overview.people_count', {n: people.length}));
}

function showRobots(context, body, count) {
  const {state, t} = context;
  const robots = [...state.robots.values()];
  robots.sort((one, other) => badnessOf(state, other) - badnessOf(state, one)
    || String(one.name).localeCompare(String(other.name)));
  keep(body, robots, (each) => each.id, (each) => robotCard(context, each),
    (element, each) => updateRobot(element, each, context));
  body.parentNode.hidden = !robots.length;
  const [up, n] = robotsUp(state);
  write(count, t(state.isCurrent ? 'shell.robots_up' : 'overview.robots_unknown', {n, up}));
}

function explain(context, parts) {
  const {t, state, live} = context;
  const isEmpty = !state.people.size && !state.robots.size;
  const key = !state.isKnown ? (live.lostMs ? 'offline' : 'loading') : isEmpty ? 'empty' : '';
  if (parts.note.dataset.key !== key) {
    parts.note.dataset.key = key;
    parts.note.hidden = !key;
    replace(parts.note, key && notice(key, t(`overview.note_${key}`),
      t(`overview.note_${key}_text`)));
  }
}

// @ts-check
/** Driving a robot from afar: its picture in the middle, the stick under the hand. */

import {h} from '../lib/dom.js';
import {button, notice, select} from '../lib/parts.js';
import {Cockpit} from './drive/cockpit.js';

export const view = {name: 'drive', permission: 'drive', open};

function open(root, context, arg) {
  const {state, t} = context;
  let cockpit = null;
  let shown = null;
  const choose = (robot) => {
    cockpit?.close();
    cockpit = null;
    shown = robot ? robot.id : null;
    root.replaceChildren();
    context.shownRobot = robot ? () => robot.id : null;
    if (!robot) {
      root.append(notice('empty', t('drive.none'), t('drive.none_text')));
      return;
    }
    const robots = [...state.robots.values()];
    const names = Object.fromEntries(robots.map((each) => [each.id, each.name || each.id]));
    cockpit = new Cockpit(context, robot, robots.length > 1
      && h('label.drive-robot', h('span', t('drive.robot')),
        select(names, robot.id, (id) => context.go(`#/drive/${encodeURIComponent(id)}`))));
    root.append(cockpit.element);
  };
  const look = () => {
    const robot = state.robots.get(arg) || (!arg && first(state)) || null;
    if (!state.isKnown && !robot) {
      root.replaceChildren(notice('loading', t('drive.waiting')));
    } else if (arg && !robot) {
      root.replaceChildren(notice('empty', t('drive.unknown'), '',
        button(t('drive.others'), () => context.go('#/drive'), {kind: 'primary'})));
    } else if (!cockpit || (robot && robot.id !== shown)) {
      choose(robot);
    } else {
      cockpit.robotChanged(robot);
    }
  };
  const off = state.on('robots', look);
  look();
  return () => {
    off();
    cockpit?.close();
  };
}

/** The robot that one most likely means: one that can be driven now. */
function first(state) {
  const robots = [...state.robots.values()];
  return robots.find((each) => each.connected && each.limits?.linear_m_s)
    || robots.find((each) => each.connected) || robots[0];
}

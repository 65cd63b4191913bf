// @ts-check
/** The button that stops robots, reachable in every view and by its key. */

import {openDialog} from './dialog.js';
import {h} from './dom.js';
import {icon} from './icons.js';
import {hasKeys} from './keys.js';
import {button} from './parts.js';
import {problemText} from './problem.js';
import {announce, toast} from './toast.js';

/** It stops wherever the focus is; no letter, so that nobody types it. */
export const STOP_KEY = 'F8';

/** Make the button; close ends it. */
export function stopButton(context) {
  const {t} = context;
  const element = h('button.stop', {type: 'button', 'aria-keyshortcuts': hasKeys() && STOP_KEY,
    title: hasKeys() ? t('shell.stop_tip', {key: STOP_KEY}) : t('shell.stop_tip_touch'),
    onclick: () => stopOrAsk(context)},
  icon('stop'), h('span.stop-text', t('shell.stop')), h('kbd', {'aria-hidden': 'true'}, STOP_KEY));
  const onkey = (event) => {
    if (event.key === STOP_KEY && !event.repeat) {
      event.preventDefault();
      stopOrAsk(context);
    }
  };
  addEventListener('keydown', onkey, {capture: true});
  return {element, close: () => removeEventListener('keydown', onkey, {capture: true})};
}

/**
 * Stop the only robot at once, or the one that a view is about; of several ask which, all of them
 * first: the key twice stops all.
 */
export async function stopOrAsk(context) {
  const {t, state} = context;
  const robots = [...state.robots.values()];
  const shown = context.shownRobot && state.robots.get(context.shownRobot());
  if (robots.length <= 1 || shown) {
    return stop(context, shown ? [shown] : robots);
  }
  const asked = document.querySelector('dialog.dialog-stop .critical');
  if (asked) {
    // The key once more: all of them.
    /** @type {HTMLElement} */ (asked).click();
    return null;
  }
  const chosen = await openDialog(t('shell.stop_which'), (close) => h('div.choices',
    button(t('shell.stop_all', {n: robots.length}), () => close(robots),
      {kind: 'critical', icon: 'stop', key: hasKeys() && STOP_KEY}),
    robots.map((each) => button(each.name || each.id, () => close([each]), {icon: 'robot'}))), 'stop');
  return chosen ? stop(context, chosen) : null;
}

async function stop(context, robots) {
  const {t} = context;
  if (!robots.length) {
    toast(t('shell.no_robot'), {kind: 'warn'});
  }
  await Promise.all(robots.map(async (robot) => {
    const name = robot.name || robot.id;
    try {
      await context.command(robot.id, 'stop', {});
      announce(t('shell.stopped', {name}), true);
      const free = context.permissions.has('drive') && button(t('shell.release'),
        () => release(context, robot), {kind: 'quiet'});
      toast(t('shell.stopped', {name}), {kind: 'warn', shownMs: 20000, action: free || null});
    } catch (error) {
      const text = t('shell.not_stopped', {name, why: problemText(error, t)});
      announce(text, true);
      toast(text, {kind: 'error', shownMs: 30000});
    }
  }));
}

/** Let a robot move again that was stopped. */
export async function release(context, robot) {
  const {t} = context;
  const name = robot.name || robot.id;
  try {
    await context.command(robot.id, 'release', {});
    toast(t('shell.released', {name}));
  } catch (error) {
    toast(problemText(error, t), {kind: 'error'});
  }
}

// @ts-check
/** The picture of a robot's camera for the one who drives it; its component is the camera view's. */

import {h, replace} from '../../lib/dom.js';
import {icon} from '../../lib/icons.js';

const RATE_HZ = 10;

/**
 * Show the first camera of a robot.
 * @returns {{element: HTMLElement, robotChanged: function(Object): void, close: function(): void}}
 */
export function driverPicture(context, robot) {
  const {t, permissions} = context;
  const element = h('div.drive-picture');
  let name = null;
  let live = null;
  let isClosed = false;
  const show = async (camera) => {
    live?.close();
    live = null;
    name = camera;
    if (!camera || !permissions.has('camera')) {
      replace(element, nothing(t(camera ? 'drive.no_sight' : 'drive.no_camera')));
      return;
    }
    const {pictureOf} = await import('../../lib/picture.js');
    if (!isClosed && name === camera) {
      live = pictureOf(context, {robot: robot.id, camera, rateHz: RATE_HZ});
      replace(element, live.element);
    }
  };
  const robotChanged = ({cameras}) => {
    const camera = nameOf((cameras || [])[0]);
    if (camera !== name) {
      show(camera).catch(() => replace(element,
        nothing(t('drive.no_camera'))));
    }
  };
  name = undefined;
  robotChanged(robot);
  const close = () => {
    isClosed = true;
    live?.close();
  };
  return {element, robotChanged, close};
}

/** What stands where there is no picture. */
function nothing(text) {
  return h('p.drive-nothing.muted', icon('camera'), h('span', text));
}

function nameOf(camera) {
  return camera && typeof camera === 'object' ? camera.name : camera || null;
}

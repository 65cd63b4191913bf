// @ts-check
/** Whether keys are worth a word: devices with nothing but a touch screen have none. */

// The same as in style/shell.css, which hides what is seen of them.
const TOUCH_ONLY = '(hover: none) and (pointer: coarse)';

/** Whether there is more than a touch screen. */
export function hasKeys() {
  return !matchMedia(TOUCH_ONLY).matches;
}

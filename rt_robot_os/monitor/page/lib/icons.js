// @ts-check
/** Drawings of 24 by 24, in the colour of the text beside them. */

import {svg} from './dom.js';

const PATHS = {
  overview: 'M3 11l9-7 9 7M5.5 9.5V20h13V9.5M10 20v-6h4v6',
  alarms: 'M12 3a6 6 0 0 0-6 6v4l-2 4h16l-2-4V9a6 6 0 0 0-6-6zM10 20.5h4',
  data: 'M3 12h4l3-7 4 14 3-7h4',
  position: 'M12 21s7-6.2 7-11a7 7 0 0 0-14 0c0 4.8 7 11 7 11zM12 12.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5z',
  camera: 'M3 8h4l2-3h6l2 3h4v11H3zM12 17a4 4 0 1 0 0-8 4 4 0 0 0 0 8z',
  drive: 'M12 3v18M3 12h18M12 3l-2.5 3M12 3l2.5 3M12 21l-2.5-3M12 21l2.5-3M3 12l3-2.5M3 12l3 2.5M21 12l-3-2.5M21 12l-3 2.5',
  network: 'M12 8.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5zM5 20.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5zM19 20.5a2.5 2.5 0 1 0 0-5 2.5 2.5 0 0 0 0 5zM11 8.3L6.5 15.8M13 8.3l4.5 7.5',
  account: 'M12 12a4 4 0 1 0 0-8 4 4 0 0 0 0 8zM4 21c0-4.5 3.5-7 8-7s8 2.5 8 7',
  admin: 'M16 11a3 3 0 1 0 0-6M8.5 12a4 4 0 1 0 0-8 4 4 0 0 0 0 8zM2 21c0-4.5 2.8-7 6.5-7s6.5 2.5 6.5 7M17.5 14.5c2.5.5 4.5 2.5 4.5 6.5',
  audit: 'M6 3h9l4 4v14H6zM14 3v5h5M9 13h7M9 17h7',
  menu: 'M4 7h16M4 12h16M4 17h16',
  more: 'M5.5 12h.01M12 12h.01M18.5 12h.01',
  stop: 'M8.3 3h7.4L21 8.3v7.4L15.7 21H8.3L3 15.7V8.3zM8.5 12h7',
  check: 'M5 12.5l4.5 4.5L19 7.5',
  warn: 'M12 4L2.5 20h19zM12 10v4.5M12 17.3v.01',
  critical: 'M8.3 3h7.4L21 8.3v7.4L15.7 21H8.3L3 15.7V8.3zM12 7.5v5.5M12 16.3v.01',
  urgent: 'M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18zM12 7.5v5.5M12 16.3v.01',
  technical: 'M14.5 6.5a4 4 0 0 1 5-1L16.8 8.2l1 2 2 1 2-2.5a4 4 0 0 1-5.3 5L9 21.2 5.8 18l7.7-7.5a4 4 0 0 1 1-4z',
  person: 'M12 10a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7zM5.5 21v-3a6.5 6.5 0 0 1 13 0v3',
  robot: 'M5 9h14v10H5zM12 9V5M12 5a1 1 0 1 0 0-2 1 1 0 0 0 0 2zM9 13.5v1M15 13.5v1M2.5 12.5v3M21.5 12.5v3',
  battery: 'M3 8h15v8H3zM18 11h2.5v2H18',
  sound: 'M4 9.5v5h3.5L13 19V5L7.5 9.5zM16.5 9a4 4 0 0 1 0 6M19 6.5a8 8 0 0 1 0 11',
  muted: 'M4 9.5v5h3.5L13 19V5L7.5 9.5zM16.5 9.5l5 5M21.5 9.5l-5 5',
  offline: 'M3 3l18 18M2.5 9.5A14 14 0 0 1 8 6.3M21.5 9.5A14 14 0 0 0 11.5 5.5M6 13.5a9 9 0 0 1 4.5-2.4M18 13.5a9 9 0 0 0-2-1.5M9.5 17.2a4 4 0 0 1 5 0M12 20v.01',
  close: 'M6 6l12 12M18 6L6 18',
  up: 'M12 19V5M6 11l6-6 6 6',
  down: 'M12 5v14M6 13l6 6 6-6',
  sort: 'M8 10l4-4 4 4M8 14l4 4 4-4',
  back: 'M15 5l-7 7 7 7',
  forward: 'M9 5l7 7-7 7',
  note: 'M4 20l1-4L16.5 4.5l3 3L8 19zM14.5 6.5l3 3',
  phone: 'M5 3h4l2 5-2.5 2a12 12 0 0 0 5.5 5.5L16 13l5 2v4a2 2 0 0 1-2 2A16 16 0 0 1 3 5a2 2 0 0 1 2-2z',
  clock: 'M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18zM12 7v5.5l3.5 2',
  picture: 'M3.5 5h17v14h-17zM3.5 16l5-5 4.5 4.5 2.5-2.5 5 5M15.5 9.5h.01',
  talk: 'M12 15a3 3 0 0 0 3-3V6a3 3 0 0 0-6 0v6a3 3 0 0 0 3 3zM5.5 11.5a6.5 6.5 0 0 0 13 0M12 18v3.5',
  leave: 'M14 4h5v16h-5M10 8l-4 4 4 4M6 12h9',
  theme: 'M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18zM12 3v18',
  language: 'M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18zM3 12h18M12 3c3 3 3 15 0 18M12 3c-3 3-3 15 0 18',
  bell: 'M12 3a6 6 0 0 0-6 6v4l-2 4h16l-2-4V9a6 6 0 0 0-6-6zM10 20.5h4',
  keyboard: 'M2.5 6.5h19v11h-19zM6 10h.01M10 10h.01M14 10h.01M18 10h.01M7 14h10',
  search: 'M10.5 17a6.5 6.5 0 1 0 0-13 6.5 6.5 0 0 0 0 13zM15.5 15.5L21 21',
  play: 'M7 4.5v15l12-7.5z',
  pause: 'M7.5 5v14M16.5 5v14',
  clip: 'M3.5 5h17v14h-17zM10 9v6l5-3z',
  hangup: 'M3 14c5-5 13-5 18 0l-2 3-4-1v-2.5a12 12 0 0 0-6 0V16l-4 1z',
  plus: 'M12 5v14M5 12h14',
  locked: 'M6 11h12v9.5H6zM8.5 11V7.5a3.5 3.5 0 0 1 7 0V11M12 15v2',
  info: 'M12 21a9 9 0 1 0 0-18 9 9 0 0 0 0 18zM12 11v5.5M12 7.7v.01',
};

/**
 * Draw an icon; it says nothing to a screen reader, since words stand beside it.
 * @param {string} name one of the table
 * @returns {SVGElement}
 */
export function icon(name) {
  return svg('svg.icon', {viewBox: '0 0 24 24', 'aria-hidden': 'true', focusable: 'false'},
    svg('path', {d: PATHS[name] || PATHS.info}));
}

// @ts-check
/** The colours of the map, from the tokens of the page. */

import {pixelOf} from './map.js';

/** Return the palette as it is now; ask again when the theme changes. */
export function paletteOf(root) {
  const style = getComputedStyle(root);
  const token = (name) => style.getPropertyValue(name).trim();
  const mixed = (name, percent) => `color-mix(in srgb, ${token(name)} ${percent}%, transparent)`;
  const family = token('--font') || 'sans-serif';
  return {
    surface: token('--surface'), text: token('--text'), ground: token('--sunken'),
    stale: token('--stale'), grid: mixed('--line-strong', 18), font: `600 12px ${family}`,
    robot: token('--series-1'), goal: token('--urgent'), track: mixed('--series-1', 35),
    scan: token('--series-6'),
    person: token('--series-4'), personArea: mixed('--series-4', 14),
    oldArea: mixed('--stale', 12),
    levels: {critical: token('--fill-critical'), urgent: token('--fill-urgent'),
             warning: token('--warn'), technical: token('--fill-technical')},
    nodes: {good: token('--ok'), sink: token('--accent'), weak: token('--warn'),
            doubtful: token('--warn'), silent: token('--urgent'), asleep: token('--technical'),
            unheard: token('--stale')},
    links: {good: mixed('--ok', 70), fair: token('--warn'), poor: token('--urgent'),
            unknown: token('--stale')},
    map: {floor: pixelOf(token('--surface')), unknown: pixelOf(token('--sunken')),
          wall: pixelOf(`color-mix(in srgb, ${token('--line-strong')} 82%,
            ${token('--surface')})`)},
  };
}

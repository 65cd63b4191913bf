/** Why the robot stands, as its guard says it, in the reader's words. */

const PATTERNS = [
  [/^(.+?): obstacle ([\d.]+) m before the robot, at (-?[\d.]+) degrees/, 'obstacle',
    ['sensor', 'distance', 'angle']],
  [/^(.+?): something touches the robot, or is too near/, 'near', ['sensor']],
  [/^(.+?): something touches the robot/, 'touch', ['sensor']],
  [/^cliff: an edge is ahead/, 'edge', []],
  [/^a wheel hangs in the air/, 'wheel', []],
  [/^(.+?): nothing is heard/, 'silent', ['sensor']],
  [/^nobody: e-stop, (.*)/, 'estop', ['why']],
];

/**
 * @param {Object} t the translator
 * @param {string} text of stop_reason or steering
 * @returns {string} what is not known stays as it is
 */
export function reasonText(t, text) {
  for (const [pattern, key, names] of PATTERNS) {
    const found = pattern.exec(text || '');
    if (found) {
      const values = Object.fromEntries(names.map((name, at) => [name, asNumber(found[at + 1])]));
      return t(`drive.reason_${key}`, values);
    }
  }
  return text || '';
}

/** Numbers are written as the reader writes them. */
function asNumber(text) {
  return /^-?[\d.]+$/.test(text) ? Number(text) : text;
}

/** Whether the robot is held by its e-stop, by what the multiplexer says. */
export function isStopped(steering) {
  return typeof steering === 'string' && steering.startsWith('nobody: e-stop');
}

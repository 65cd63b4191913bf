// @ts-check
/** The colours and letters of plots, from the tokens of the page: a canvas knows no style sheet. */

/** Return the palette as it is now; ask again when the theme changes. */
export function paletteOf(root) {
  const style = getComputedStyle(root);
  const token = (name) => style.getPropertyValue(name).trim();
  const mixed = (name, percent) => `color-mix(in srgb, ${token(name)} ${percent}%, transparent)`;
  const family = token('--font') || 'sans-serif';
  return {
    text: token('--text'), muted: token('--muted'), surface: token('--surface'),
    grid: mixed('--line', 70), line: token('--series-1'), band: mixed('--series-1', 24),
    gap: token('--line-strong'), stale: token('--stale'),
    limit: mixed('--urgent', 9), limitLine: token('--urgent'), limitText: token('--urgent'),
    news: [null, mixed('--fill-warn', 10), mixed('--fill-warn', 22), mixed('--fill-critical', 15)],
    levels: {critical: token('--fill-critical'), urgent: token('--fill-urgent'),
             warning: token('--warn'), technical: token('--fill-technical')},
    quality: {suspect: token('--fill-warn'), stale: token('--stale'),
              off: token('--fill-technical'), missing: token('--fill-technical')},
    font: `12px ${family}`, small: `600 ${11 * devicePixelRatio}px ${family}`,
  };
}

/** Call when the theme changes. @return what ends it. */
export function onTheme(changed) {
  const dark = matchMedia('(prefers-color-scheme: dark)');
  dark.addEventListener('change', changed);
  addEventListener('themechange', changed);
  return () => {
    dark.removeEventListener('change', changed);
    removeEventListener('themechange', changed);
  };
}

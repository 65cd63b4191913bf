// @ts-check
/**
 * How the reader writes dates and numbers: as the browser is set, in the language of the page.
 */

/** A tag that Intl takes, or null: with LANG=C browsers report tags such as en-US@posix. */
function valid(tag) {
  const plain = String(tag || '').replace(/[@.].*$/, '').replaceAll('_', '-');
  try {
    return Intl.getCanonicalLocales(plain)[0] || null;
  } catch (error) {
    return null;
  }
}

/**
 * The locale of a language: the browser's own where it has that language, else the language with
 * the browser's region; English without a region is that of Britain, as the ISO date order is.
 * @param {string} language such as 'de'
 * @param {readonly string[]} [wanted] of the browser, the most wanted first
 */
export function localeOf(language, wanted = navigator.languages || [navigator.language]) {
  const tags = wanted.map(valid).filter(Boolean);
  const own = tags.find((each) => each.split('-')[0] === language && each !== language);
  const region = tags.map((each) => new Intl.Locale(each).region).find(Boolean);
  return own || valid(region && `${language}-${region}`) || (language === 'en' ? 'en-GB' : language);
}

/** Give libraries that ask the browser for its language a tag that Intl takes. */
export function mendLanguage() {
  const found = valid(navigator.language);
  if (found !== navigator.language) {
    Object.defineProperty(navigator, 'language', {value: found || 'en', configurable: true});
  }
}

mendLanguage();

// @ts-check
/** Addresses of files of the page: those of the same release as the module that asks. */

/** The address of a file, such as 'style/icon.svg'. */
export function asset(path) {
  return new URL(`../${path}`, import.meta.url).href;
}

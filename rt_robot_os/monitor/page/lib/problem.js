// @ts-check
/** Errors of requests in the reader's words. */

import {h} from './dom.js';
import {said} from './said.js';
import {toast} from './toast.js';

/** What happened and what to do, as one text. */
export function problemText(error, t) {
  return problemSaid(error, t).text;
}

/** The same with the language that it is in: {text, lang}. */
export function problemSaid(error, t) {
  if (error.status === 0) {
    return {text: t('shell.no_answer'), lang: null};
  }
  if (error.reason === 'locked') {
    return {text: t('shell.still_locked'), lang: null};
  }
  const code = error.codes?.text?.code || '';
  if (error.status === 403 && (!code || code.endsWith('_permission'))) {
    return {text: t('shell.not_allowed'), lang: null};
  }
  const parts = [said(t, error.message, error.codes?.text),
    said(t, error.remedy, error.codes?.remedy)].filter(({text}) => text);
  return {text: parts.map(({text}) => text).join(' – '),
    lang: parts.find(({lang}) => lang)?.lang || null};
}

/** The same as an element, for where it stands by itself. */
export function problemElement(error, t) {
  const {text, lang} = problemSaid(error, t);
  return h('span', {lang}, text);
}

/** Do something with the server; what goes wrong is shown. Returns what it gave, or null. */
export async function attempt(work, t) {
  try {
    return await work();
  } catch (error) {
    toast(problemElement(error, t), {kind: 'error', shownMs: 12000});
    return null;
  }
}

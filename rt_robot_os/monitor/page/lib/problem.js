/** Errors of requests in the reader's words. */

import {toast} from './toast.js';

/** What happened and what to do, as one text. */
export function problemText(error, t) {
  if (error.status === 0) {
    return t('shell.no_answer');
  }
  if (error.reason === 'locked') {
    return t('shell.still_locked');
  }
  if (error.status === 403) {
    return t('shell.not_allowed');
  }
  return [error.message, error.remedy].filter(Boolean).join(' – ');
}

/** Do something with the server; what goes wrong is told. Returns what it gave, or null. */
export async function attempt(work, t) {
  try {
    return await work();
  } catch (error) {
    toast(problemText(error, t), {kind: 'error', shownMs: 12000});
    return null;
  }
}

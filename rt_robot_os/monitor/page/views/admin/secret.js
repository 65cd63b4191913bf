// @ts-check
/** What is shown once and never again: a link, a token. */

import {openDialog} from '../../lib/dialog.js';
import {h} from '../../lib/dom.js';
import {button} from '../../lib/parts.js';

export function showSecret(context, title, text, secret) {
  const {t, toast} = context;
  return openDialog(title, (close) => {
    const shown = h('textarea.admin-secret', {rows: 3, readonly: true, 'aria-label': title});
    shown.value = secret;
    shown.onfocus = () => shown.select();
    const copy = async () => {
      try {
        await navigator.clipboard.writeText(secret);
        toast(t('admin.copied'));
      } catch (error) {
        shown.focus();
        toast(t('admin.not_copied'), {kind: 'warn'});
      }
    };
    return [h('p', text), shown, h('div.actions', button(t('admin.copy'), copy),
      button(t('shell.close'), () => close(), {kind: 'primary'}))];
  });
}

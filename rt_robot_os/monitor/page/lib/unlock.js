// @ts-check
/** A session that was not used for a while: its password is asked for where it is needed. */

import {openDialog} from './dialog.js';
import {passwordField, passwordForm} from './entrance.js';
import {h} from './dom.js';
import {button, field, notice} from './parts.js';
import {stopOrAsk} from './stop.js';

let asked = null;

/**
 * Ask for the password.
 * @param {Object} context
 * @returns {Promise<boolean>} whether the session is unlocked; false: it was not typed
 */
export function unlock(context) {
  asked = asked || open(context).finally(() => {
    asked = null;
  });
  return asked;
}

async function open(context) {
  const {t, api, state, user} = context;
  await t.words.load('login');
  let off = () => {};
  const found = await openDialog(t('shell.unlock_title'), (close) => {
    // Unlocked in another window: what somebody wanted here was not confirmed by the password.
    let isSending = false;
    off = state.on('session', () => !context.isLocked && !isSending && close(null));
    // While a dialog is open nothing else can be touched.
    const mayStop = context.permissions.has('acknowledge');
    // Password managers look for a name.
    const name = h('input.unseen', {type: 'text', autocomplete: 'username', readonly: true,
      tabindex: '-1', 'aria-hidden': 'true'});
    name.value = user.name;
    const password = passwordField(t, 'current-password');
    password.autofocus = true;
    const form = passwordForm(context, {
      fields: [name, field(t('login.password'), password)],
      yes: t('shell.unlock'),
      actions: [mayStop && button(t('shell.stop'), () => {
        close(null);
        stopOrAsk(context);
      }, {kind: 'critical', icon: 'stop'}),
      button(t('shell.cancel'), () => close(null), {kind: 'quiet'})],
      async send() {
        isSending = true;
        try {
          close(await api.post('/api/session/unlock', {password: password.value}));
        } catch (error) {
          if (error.status !== 401) {
            throw error;
          }
          close(null);
          context.signedOut();
        }
      },
      failed() {
        isSending = false;
        password.value = '';
        password.focus();
      },
    });
    return [h('p', t('shell.unlock_text', {name: user.name})), form];
  }, 'unlock');
  off();
  if (found) {
    context.sessionIs(found);
  }
  return Boolean(found);
}

/** What stands in place of a view that a locked session may not open. */
export function lockedNotice(context) {
  const {t} = context;
  return h('div.view', notice('locked', t('shell.locked_view'), t('shell.locked_view_text'),
    button(t('shell.unlock'), () => unlock(context), {kind: 'primary', icon: 'locked'})));
}

/** To sign in; also with the password alone, when a session was left untouched for a while. */

import {h, replace} from '../lib/dom.js';
import {entrance, passwordField} from '../lib/entrance.js';
import {field, notice} from '../lib/parts.js';

export const view = {
  name: 'login',
  permission: '',
  open(root, context) {
    const {t} = context;
    const name = h('input', {name: 'username', autocomplete: 'username', required: true,
      maxlength: 64, autocapitalize: 'none', spellcheck: 'false'});
    name.value = context.user?.name || '';
    const password = passwordField(t, 'current-password');
    const first = h('div');
    const {element} = entrance(context, {
      title: context.user ? t('login.again') : t('login.title'),
      text: context.user ? t('login.again_text') : '',
      yes: t('login.yes'),
      fields: [field(t('login.name'), name), field(t('login.password'), password)],
      after: first,
      async send() {
        // A session that was locked ends with this: that is no good-bye.
        context.live.stop();
        await context.api.post('/api/session', {name: name.value, password: password.value});
        await context.signedIn();
      },
      failed() {
        if (context.user) {
          context.live.start();
        }
        password.value = '';
        password.focus();
      },
    });
    replace(root, element);
    (name.value ? password : name).focus();
    firstAdministrator(context, first);
  },
};

/** Where there is no administrator yet, say how the first one is made; others may sign in. */
async function firstAdministrator({api, t}, place) {
  try {
    const {needed} = await api.get('/api/setup');
    if (needed) {
      replace(place, notice('empty', t('login.first'), t('login.first_text')));
    }
  } catch (error) {
    // It is told when somebody signs in.
  }
}

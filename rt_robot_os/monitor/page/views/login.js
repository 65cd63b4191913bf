// @ts-check
/** To sign in. */

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
    const password = passwordField(t, 'current-password');
    const first = h('div');
    const {element} = entrance(context, {
      title: t('login.title'),
      yes: t('login.yes'),
      fields: [field(t('login.name'), name), field(t('login.password'), password)],
      after: first,
      async send() {
        await context.api.post('/api/session', {name: name.value, password: password.value});
        await context.signedIn();
      },
      failed() {
        password.value = '';
        password.focus();
      },
    });
    replace(root, element);
    name.focus();
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

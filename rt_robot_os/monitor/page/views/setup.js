// @ts-check
/** A one-time link: for the first account, for a further one, or for a forgotten password. */

import {h, replace} from '../lib/dom.js';
import {entrance, newPassword} from '../lib/entrance.js';
import {button, field, notice, segments} from '../lib/parts.js';

export const view = {
  name: 'setup',
  permission: '',
  open(root, context, arg) {
    let isOpen = true;
    // Whoever looks at the screen, or goes back, does not find the link.
    history.replaceState(null, '', '#/setup');
    begin(root, context, arg, () => isOpen);
    return () => {
      isOpen = false;
    };
  },
};

async function begin(root, context, token, isOpen) {
  const {t} = context;
  await t.words.load('login');
  let found;
  try {
    found = await context.api.post('/api/setup/check', {token});
  } catch (error) {
    if (isOpen()) {
      replace(root, h('div.entrance', notice('error', t('setup.gone'),
        error.status === 0 ? t('login.no_answer') : t('setup.gone_text'),
        button(t('setup.login'), () => context.go('#/login'), {kind: 'primary'}))));
    }
    return;
  }
  if (isOpen()) {
    show(root, context, token, found);
  }
}

function show(root, context, token, found) {
  const {t} = context;
  let role = 'owner';
  const name = h('input', {name: 'username', autocomplete: 'username', required: true,
    maxlength: 64, autocapitalize: 'none', spellcheck: 'false', readonly: !found.first});
  name.value = found.name;
  const password = newPassword(t, field);
  const choice = found.first && h('div.field', h('span.field-label', t('setup.what')),
    segments(t('setup.what'), {owner: t('setup.owner'), admin: t('setup.admin')}, role,
      (value) => {
        role = value;
        replace(help, t(`setup.${value}_text`));
      }));
  const help = found.first && h('p.help', {role: 'status'}, t('setup.owner_text'));
  const {element} = entrance(context, {
    title: found.first ? t('setup.first') : t('setup.title'),
    text: found.first ? t('setup.first_text') : t('setup.text', {name: found.name}),
    yes: t('setup.yes'),
    fields: [field(t('login.name'), name), ...password.fields, choice, help],
    async send() {
      await context.api.post('/api/setup', {token, name: name.value,
        password: password.first.value, ...(found.first && {role})});
      context.go('#/overview');
      await context.signedIn();
    },
  });
  replace(root, element);
  (found.first ? name : password.first).focus();
}

// @ts-check
/** The robots that may call: let one in, let it in no more. */

import {ask, openDialog} from '../../lib/dialog.js';
import {h, replace} from '../../lib/dom.js';
import {passwordForm} from '../../lib/entrance.js';
import {badge, button, field, notice} from '../../lib/parts.js';
import {attempt} from '../../lib/problem.js';
import {residentsCell} from './residents.js';
import {showSecret} from './secret.js';

export async function robots(place, context, isOpen) {
  const {t, api, format} = context;
  await t.words.load('login');
  const found = await attempt(() => api.get('/api/tokens'), t);
  const residents = found && await attempt(() => api.get('/api/residents'), t);
  if (!residents || !isOpen()) {
    return;
  }
  const household = Object.fromEntries(residents.map((each) => [each.id, each]));
  const again = () => robots(place, context, isOpen);
  replace(place, h('div.section-head', h('h2', t('admin.robots')),
    button(t('admin.add_robot'), () => add(context, again), {kind: 'primary', icon: 'plus'})),
  h('p.help', t('admin.robots_text')), found.length
    ? h('div.table-box', {tabindex: '0', role: 'region', 'aria-label': t('admin.robots')},
      h('table.table', h('thead', h('tr', ['name', 'people', 'since', 'state', 'do'].map(
        (each) => h('th', {scope: 'col'}, t(`admin.robot_${each}`))))), h('tbody', found.map((each) => h('tr',
        h('th', {scope: 'row'}, each.name),
        residentsCell(context, household[each.id] || {...each, people: null, suggested: []},
          again),
        h('td', format.time(each.created_ns / 1e6, false)),
        h('td', each.revoked_ns === null ? badge('ok', t('admin.robot_good'), 'check')
          : badge('stale', t('admin.robot_revoked'))),
        h('td', each.revoked_ns === null ? button(t('admin.revoke'),
          () => revoke(context, each, again), {kind: 'quiet'})
          : button(t('admin.renew'), () => admit(context, each.name, again),
            {kind: 'quiet'})))))))
    : notice('empty', t('admin.no_robot')));
}

function add(context, again) {
  const {t} = context;
  return openDialog(t('admin.add_robot'), (close) => {
    const name = h('input', {required: true, maxlength: 64, autocomplete: 'off',
      spellcheck: 'false', pattern: '[A-Za-z0-9][A-Za-z0-9_.\\-]*'});
    return [passwordForm(context, {
      fields: [field(t('admin.robot_name'), name, t('admin.robot_name_help'))],
      yes: t('admin.add'),
      async send() {
        const made = await context.api.post('/api/tokens', {name: name.value});
        close();
        again();
        showToken(context, made);
      },
      actions: button(t('shell.cancel'), () => close(), {kind: 'quiet'}),
    })];
  });
}

async function admit(context, name, again) {
  const made = await attempt(() => context.api.post('/api/tokens', {name}), context.t);
  if (made) {
    again();
    showToken(context, made);
  }
}

function showToken(context, {name, token}) {
  const {t} = context;
  return showSecret(context, t('admin.token_title', {name}), t('admin.token_text'), token);
}

async function revoke(context, {id, name}, again) {
  const {t, api} = context;
  const isSure = await ask({title: t('admin.revoke_title', {name}), text: t('admin.revoke_text'),
    yes: t('admin.revoke'), no: t('shell.cancel'), kind: 'critical'});
  if (isSure !== null) {
    await attempt(() => api.delete(`/api/tokens/${id}`), t);
    await again();
  }
}

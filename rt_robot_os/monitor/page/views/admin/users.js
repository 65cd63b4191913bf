// @ts-check
/** Users: add, change, keep out, give a link, see and end their sessions. */

import {ask, openDialog} from '../../lib/dialog.js';
import {h, replace} from '../../lib/dom.js';
import {passwordForm} from '../../lib/entrance.js';
import {badge, button, field, select} from '../../lib/parts.js';
import {attempt} from '../../lib/problem.js';
import {sessionTable} from '../../lib/sessions.js';
import {showSecret} from './secret.js';

const ROLES = ['viewer', 'carer', 'operator', 'admin', 'owner'];

export async function users(place, context, isOpen) {
  const {t, api} = context;
  await t.words.load('login');
  const found = await attempt(() => api.get('/api/users'), t);
  if (!found || !isOpen()) {
    return;
  }
  const again = () => users(place, context, isOpen);
  replace(place, h('div.section-head', h('h2', t('admin.users')),
    button(t('admin.add_user'), () => edit(context, null, again),
      {kind: 'primary', icon: 'plus'})), h('p.help', t('admin.users_text')),
  h('div.table-box', {tabindex: '0', role: 'region', 'aria-label': t('admin.users')},
    h('table.table.admin-users', h('thead', h('tr', ['name', 'role', 'people', 'state', 'do'].map(
      (each) => h('th', {scope: 'col'}, t(`admin.user_${each}`))))),
    h('tbody', found.map((each) => row(context, each, again))))));
}

function row(context, user, again) {
  const {t} = context;
  const state = user.disabled ? badge('stale', t('admin.state_disabled'))
    : user.has_password ? badge('ok', t('admin.state_active'), 'check')
      : badge('warn', t('admin.state_invited'), 'clock');
  const people = user.people.includes('*') ? t('admin.everybody')
    : user.people.join(', ') || t('admin.nobody');
  const name = (key) => ({'aria-label': `${t(key)}: ${user.name}`});
  const act = (key, work) => {
    const made = button(t(key), work, {kind: 'quiet'});
    made.setAttribute('aria-label', name(key)['aria-label']);
    return made;
  };
  return h('tr', h('th', {scope: 'row'}, user.name), h('td', t.word('role', user.role)),
    h('td.wrap', people), h('td', state), h('td', h('div.admin-acts',
      act('admin.edit', () => edit(context, user, again)),
      act('admin.link', () => link(context, user)),
      act('admin.sessions', () => sessions(context, user)),
      act(user.disabled ? 'admin.enable' : 'admin.disable', () => disable(context, user, again)))));
}

function edit(context, user, again) {
  const {t, api} = context;
  return openDialog(user ? t('admin.edit_title', {name: user.name}) : t('admin.add_user'),
    (close) => {
      let role = user?.role || 'carer';
      const name = h('input', {required: true, maxlength: 64, autocomplete: 'off',
        readonly: Boolean(user)});
      name.value = user?.name || '';
      const about = h('p.help', {role: 'status'}, t(`admin.role_${role}`));
      const roles = select(Object.fromEntries(ROLES.map((each) => [each, t.word('role', each)])),
        role, (value) => {
          role = value;
          replace(about, t(`admin.role_${value}`));
        });
      const people = h('textarea', {rows: 3, spellcheck: 'false'});
      people.value = (user?.people || []).join('\n');
      return [passwordForm(context, {
        fields: [field(t('admin.user_name'), name), field(t('admin.user_role'), roles), about,
          field(t('admin.user_people'), people, t('admin.people_help')),
          user && h('p.help', t('admin.edit_text'))],
        yes: user ? t('admin.save') : t('admin.add'),
        async send() {
          const body = {role, people: namesIn(people.value)};
          const made = user ? await api.patch(`/api/users/${user.id}`, body)
            : await api.post('/api/users', {name: name.value, ...body});
          close();
          again();
          if (!user) {
            showLink(context, made.name, made.token);
          }
        },
        actions: button(t('shell.cancel'), () => close(), {kind: 'quiet'}),
      })];
    });
}

function namesIn(text) {
  return [...new Set(text.split(/[\n,]/).map((each) => each.trim()).filter(Boolean))];
}

async function link(context, user) {
  const {t, api} = context;
  const found = await attempt(() => api.post(`/api/users/${user.id}/invitation`), t);
  if (found) {
    showLink(context, user.name, found.token);
  }
}

function showLink(context, name, token) {
  const {t} = context;
  const url = `${location.origin}${location.pathname}#/setup/${token}`;
  return showSecret(context, t('admin.link_title', {name}), t('admin.link_text'), url);
}

function sessions(context, user) {
  const {t, api} = context;
  return openDialog(t('admin.sessions_title', {name: user.name}), (close) => {
    const place = h('div');
    const list = async () => {
      const found = await attempt(() => api.get(`/api/users/${user.id}/sessions`), t);
      if (found) {
        replace(place, sessionTable(context, found, async (each) => {
          await attempt(() => api.delete(`/api/users/${user.id}/sessions/${each.id}`), t);
          await list();
        }));
      }
    };
    list();
    return [place, h('div.actions', button(t('admin.end_all'), async () => {
      await attempt(() => api.delete(`/api/users/${user.id}/sessions`), t);
      await list();
    }, {kind: 'danger'}), button(t('shell.close'), () => close(), {kind: 'primary'}))];
  });
}

async function disable(context, user, again) {
  const {t, api} = context;
  const isSure = user.disabled ? '' : await ask({title: t('admin.disable_title',
    {name: user.name}), text: t('admin.disable_text'), yes: t('admin.disable'),
  no: t('shell.cancel'), kind: 'critical'});
  if (isSure !== null) {
    await attempt(() => api.patch(`/api/users/${user.id}`, {disabled: !user.disabled}), t);
    await again();
  }
}

// @ts-check
/** One's own account: password, sessions, emergency access, language and appearance. */

import {h, replace} from '../lib/dom.js';
import {ask} from '../lib/dialog.js';
import {newPassword, passwordField, passwordForm} from '../lib/entrance.js';
import {LANGUAGES} from '../lib/i18n.js';
import {badge, button, field, notice, section, segments, select} from '../lib/parts.js';
import {attempt} from '../lib/problem.js';
import {sessionTable} from '../lib/sessions.js';

export const view = {
  name: 'account',
  permission: '',
  open(root, context) {
    let isOpen = true;
    context.t.words.load('login', 'admin').then(() => isOpen && show(root, context, () => isOpen));
    return () => {
      isOpen = false;
    };
  },
};

function show(root, context, isOpen) {
  const {t} = context;
  const sessions = h('div');
  replace(root,
    section(t('account.who'), who(context)),
    section(t('account.appearance'), appearance(context)),
    mayBreak(context.user.role) && section(t('account.emergency'), emergency(context, isOpen)),
    section(t('account.password'), password(context, () => list(sessions, context, isOpen))),
    h('section.section', h('div.section-head', h('h2', t('account.sessions')),
      button(t('account.everywhere'), () => everywhere(context), {kind: 'danger', icon: 'leave'})),
    h('p.help', t('account.sessions_text')), sessions));
  list(sessions, context, isOpen);
}

function who({t, user, people, permissions}) {
  const all = people === null || people?.includes('*');
  return h('dl.facts.card', h('dt', t('account.name')), h('dd', user.name),
    h('dt', t('account.role')), h('dd', t.word('role', user.role)),
    h('dt', t('account.people')), h('dd', all ? t('account.everybody')
      : people?.length ? people.join(', ') : t('account.nobody')),
    h('dt', t('account.may')), h('dd.badges', [...permissions].sort().map((each) => badge(
      'accent', t(`account.may_${each}`)))));
}

function appearance(context) {
  const {t} = context;
  return h('div.card.account-look', field(t('account.language'), select(LANGUAGES,
    t.words.language, (value) => context.setLanguage(value))),
  h('div.field', h('span.field-label', t('account.theme')), segments(t('account.theme'),
    {'': t('account.theme_system'), light: t('account.theme_light'),
      dark: t('account.theme_dark')}, context.settings.theme,
    (value) => context.setTheme(value))));
}

function password(context, done) {
  const {t, api} = context;
  const old = passwordField(t, 'current-password');
  const fresh = newPassword(t, field);
  const name = h('input.unseen', {name: 'username', autocomplete: 'username', tabindex: '-1',
    'aria-hidden': 'true', readonly: true});
  name.value = context.user.name;
  return h('div.card', passwordForm(context, {
    fields: [name, field(t('account.old'), old), ...fresh.fields],
    yes: t('account.change'),
    async send() {
      // All sessions end, and this one begins anew: its connection must not take that for good-bye.
      context.live.stop();
      try {
        const found = await api.post('/api/password', {old: old.value, new: fresh.first.value});
        api.csrf = found.csrf;
      } finally {
        context.live.start();
      }
      old.value = '';
      fresh.clear();
      context.toast(t('account.changed'));
      done();
    },
  }));
}

async function list(place, context, isOpen) {
  const {t, api} = context;
  const found = await attempt(() => api.get('/api/sessions'), t);
  if (found && isOpen()) {
    replace(place, sessionTable(context, found, async (each) => {
      if (await attempt(() => api.delete(`/api/sessions/${each.id}`), t)) {
        await list(place, context, isOpen);
      }
    }));
  }
}

async function everywhere(context) {
  const {t, api} = context;
  const isSure = await ask({title: t('account.everywhere'), text: t('account.everywhere_text'),
    yes: t('account.everywhere_yes'), no: t('shell.cancel'), kind: 'critical'});
  if (isSure !== null && await attempt(() => api.delete('/api/sessions'), t)) {
    await context.signOut();
  }
}

function mayBreak(role) {
  return ['carer', 'operator', 'admin', 'owner'].includes(role);
}

/** Break-glass: to see in an emergency whom one may not see otherwise. */
function emergency(context, isOpen) {
  const {t} = context;
  const place = h('div.card.account-emergency');
  showEmergency(place, context, isOpen);
  return place;
}

async function showEmergency(place, context, isOpen) {
  const {t, api, format} = context;
  const session = await attempt(() => api.get('/api/session'), t);
  if (!session || !isOpen()) {
    return;
  }
  if (session.emergency.length) {
    replace(place, notice('error', t('account.emergency_on', {
      people: session.emergency.map((each) => (each === '*' ? t('account.everybody') : each))
        .join(', ')}), t('account.emergency_until', {
      time: format.time(session.emergency_ends_ns / 1e6, false)}),
    button(t('account.emergency_end'), async () => {
      await attempt(() => api.delete('/api/session/emergency'), t);
      await context.signedIn();
    }, {kind: 'primary'})));
    return;
  }
  const person = h('input', {required: true, maxlength: 128, autocomplete: 'off'});
  const reason = h('textarea', {required: true, minlength: 10, maxlength: 500, rows: 3});
  replace(place, h('p', t('account.emergency_text')), passwordForm(context, {
    fields: [field(t('account.emergency_person'), person, t('account.emergency_person_help')),
      field(t('account.emergency_reason'), reason, t('account.emergency_reason_help'))],
    yes: t('account.emergency_yes'),
    async send() {
      await api.post('/api/session/emergency', {person: person.value, reason: reason.value});
      context.toast(t('account.emergency_begun'), {kind: 'warn'});
      await context.signedIn();
    },
  }));
}

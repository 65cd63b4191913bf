// @ts-check
/** The menu of the account: views of it, language, theme, sound, notifications, keys, sign out. */

import {openDialog} from './dialog.js';
import {h, replace} from './dom.js';
import {LANGUAGES} from './i18n.js';
import {icon} from './icons.js';
import {permission} from './notification.js';
import {button, field, segments, select} from './parts.js';
import {STOP_KEY} from './stop.js';
import {viewsFor} from './views.js';

/** Open the menu. */
export function openMenu(context) {
  const {t} = context;
  return openDialog(context.user.name, (close) => [
    h('p.menu-role', t.word('role', context.user.role)),
    h('nav.menu-links', {'aria-label': t('shell.account')}, [...viewsFor('menu', context.permissions)]
      .map((each) => h('a.menu-link', {href: `#/${each.name}`, onclick: () => close()},
        icon(each.name), t(`shell.view_${each.name}`)))),
    h('div.menu-part', soundPart(context), notifyPart(context)),
    h('div.menu-part', field(t('shell.language'), select(LANGUAGES, t.words.language, (value) => {
      close();
      context.setLanguage(value);
    })), h('div.field', h('span.field-label', t('shell.theme')), segments(t('shell.theme'),
      {'': t('shell.theme_system'), light: t('shell.theme_light'), dark: t('shell.theme_dark')},
      context.settings.theme, (value) => context.setTheme(value)))),
    keys(context),
    h('p.menu-about', t('shell.not_medical')),
    h('div.actions', button(t('shell.sign_out'), () => {
      close();
      return context.signOut();
    }, {icon: 'leave'}), button(t('shell.close'), () => close(), {kind: 'primary'})),
  ], 'sheet');
}

function soundPart(context) {
  const {t, sound} = context;
  const words = h('p.help');
  const show = () => replace(words, t(`shell.sound_${sound.state}`));
  const made = toggle(t('shell.sound'), sound.isWanted, async (isOn) => {
    await context.setSound(isOn);
    show();
  });
  show();
  return h('div.field', made, words);
}

function notifyPart(context) {
  const {t} = context;
  const words = h('p.help');
  let isRefused = false;
  const state = () => {
    const found = permission();
    if (found === 'missing' || found === 'denied') {
      return found;
    }
    return context.settings.notify ? 'on' : isRefused ? 'unable' : 'off';
  };
  const show = () => replace(words, t(`shell.notify_${state()}`));
  const made = toggle(t('shell.notify'), context.settings.notify, async (isOn, box) => {
    box.checked = await context.setNotify(isOn);
    isRefused = isOn && !box.checked;
    show();
  });
  show();
  return h('div.field', made, words);
}

/** A switch with its words. */
export function toggle(text, isOn, onchange) {
  const box = h('input', {type: 'checkbox', role: 'switch', checked: isOn});
  box.onchange = () => onchange(box.checked, box);
  return h('label.toggle', box, h('span', text));
}

function keys({t, permissions}) {
  const rows = [permissions.has('acknowledge') && [STOP_KEY, t('shell.key_stop')],
    ['F9', t('shell.key_alarms')], ['Tab', t('shell.key_tab')], ['Esc', t('shell.key_escape')]];
  return h('div.menu-part.only-keys', h('h3', t('shell.keys')), h('dl.keys', rows.filter(Boolean).map(
    ([key, text]) => [h('dt', h('kbd', key)), h('dd', text)])));
}

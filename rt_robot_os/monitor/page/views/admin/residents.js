// @ts-check
/** Who lives with a robot: what its hello suggests, for an administrator to confirm. */

import {openDialog} from '../../lib/dialog.js';
import {h} from '../../lib/dom.js';
import {passwordForm} from '../../lib/entrance.js';
import {badge, button, field} from '../../lib/parts.js';

/** Return the cell of a robot: the confirmed people, and whether there is something to confirm. */
export function residentsCell(context, robot, again) {
  const {t} = context;
  const {people, suggested} = robot;
  const missing = suggested.filter((each) => !(people || []).includes(each));
  const shown = people === null ? badge('warn', t('admin.people_unknown'), 'clock')
    : h('span', people.join(', ') || t('admin.nobody'));
  const act = button(t(missing.length || people === null ? 'admin.people_confirm' : 'admin.edit'),
    () => edit(context, robot, again), {kind: missing.length ? 'primary' : 'quiet'});
  act.setAttribute('aria-label', `${t('admin.user_people')}: ${robot.name}`);
  return h('td.wrap', shown, missing.length
    ? h('p.help', t('admin.people_suggested', {people: missing.join(', ')})) : '', act);
}

function edit(context, {id, name, people, suggested}, again) {
  const {t, api} = context;
  return openDialog(t('admin.people_title', {name}), (close) => {
    const names = h('textarea', {rows: 4, spellcheck: 'false', autocomplete: 'off'});
    names.value = (people || suggested).join('\n');
    return [h('p.help', t('admin.people_text')), passwordForm(context, {
      fields: [field(t('admin.user_people'), names, suggested.length
        ? t('admin.people_suggested', {people: suggested.join(', ')}) : '')],
      yes: t('admin.people_confirm'),
      async send() {
        await api.put(`/api/residents/${id}`, {people: names.value.split('\n').map(
          (each) => each.trim()).filter(Boolean)});
        close();
        again();
      },
      actions: button(t('shell.cancel'), () => close(), {kind: 'quiet'}),
    })];
  });
}

// @ts-check
/** What to sign in, to begin by a link and to change a password have in common: a form that waits. */

import {asset} from './asset.js';
import {attribute, h, replace, write} from './dom.js';
import {icon} from './icons.js';
import {LANGUAGES} from './i18n.js';
import {busy, select} from './parts.js';
import {problemElement} from './problem.js';

/**
 * A page with nothing but a form.
 * @param {Object} context
 * @param {Object} how title, text, fields, yes, after, send() and failed(error)
 * @returns {{element: HTMLElement, form: HTMLFormElement}}
 */
export function entrance(context, how) {
  const {t} = context;
  const form = passwordForm(context, how);
  const language = select(LANGUAGES, t.words.language, (value) => context.setLanguage(value));
  attribute(language, 'aria-label', t('login.language'));
  const element = h('div.entrance', h('div.entrance-card.card',
    h('header.entrance-head', h('img', {src: asset('style/icon.svg'), alt: '', width: 48, height: 48}),
      h('div', h('h1', how.title), h('p.muted', t('login.about')))),
    how.text && h('p', how.text), form, how.after),
  h('footer.entrance-foot', h('p.small.muted', t('login.not_medical')), language));
  return {element, form};
}

/**
 * A form that sends, says what is wrong, and cannot be sent twice at a time.
 * @param {{t: *}} context
 * @param {{fields: *, yes: string, send: function(): Promise<*>, failed?: function(*): void,
 *   actions?: *}} how
 */
export function passwordForm({t}, {fields, yes, send, failed, actions}) {
  const problem = h('p.entrance-problem', {role: 'alert', hidden: true});
  const submit = h('button.button.primary', {type: 'submit'}, h('span.label', yes));
  const form = h('form.form', fields, problem, h('div.actions', actions, submit));
  form.onsubmit = (event) => {
    event.preventDefault();
    busy(submit, async () => {
      attribute(problem, 'hidden', true);
      try {
        await send();
      } catch (error) {
        replace(problem, icon('warn'), problemIn(error, t));
        attribute(problem, 'hidden', null);
        failed?.(error);
      }
    });
  };
  return form;
}

function problemIn(error, t) {
  if (error.status === 0) {
    return t('login.no_answer');
  }
  if (error.status === 401 || error.reason === 'password') {
    return t('login.wrong');
  }
  if (error.status === 429) {
    return t('login.wait', {n: Math.max(1, Number(/\d+/.exec(error.remedy)?.[0] || 1))});
  }
  return problemElement(error, t);
}

/** A field for a password, which may be looked at. */
export function passwordField(t, autocomplete) {
  return h('input', {type: 'password', autocomplete, required: true, maxlength: 128,
    minlength: autocomplete === 'new-password' ? 12 : null});
}

/** A switch that shows what is in fields for passwords. */
export function shower(t, inputs) {
  const box = h('input', {type: 'checkbox'});
  box.onchange = () => inputs.forEach((each) => {
    each.type = box.checked ? 'text' : 'password';
  });
  return h('label.check', box, h('span', t('login.show')));
}

/** Two fields for a new password, and whether they agree. */
export function newPassword(t, field) {
  const first = passwordField(t, 'new-password');
  const again = passwordField(t, 'new-password');
  const differ = h('p.field-error', {role: 'status'});
  const check = () => {
    const isWrong = again.value !== '' && again.value !== first.value;
    again.setCustomValidity(again.value === first.value ? '' : t('login.differ'));
    write(differ, isWrong ? t('login.differ') : '');
    attribute(again, 'aria-invalid', isWrong ? 'true' : null);
  };
  first.oninput = check;
  again.oninput = check;
  return {
    first,
    fields: [field(t('login.new'), first, t('login.rules')), field(t('login.once_more'), again),
      differ, shower(t, [first, again])],
    clear() {
      first.value = '';
      again.value = '';
    },
  };
}

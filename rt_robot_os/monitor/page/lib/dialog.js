// @ts-check
/** Questions in a dialog: the browser keeps the focus inside, and gives it back. */

import {h} from './dom.js';
import {button} from './parts.js';

let count = 0;

/**
 * Open a dialog with anything in it.
 * @param {string} title
 * @param {(close: (found?: *) => void) => (Node | Array)} build gets close(result), returns the
 *   children
 * @param {string} [kind] sheet: from the right; else in the middle
 * @returns {Promise<*>} what it was closed with; undefined by Escape
 */
export function openDialog(title, build, kind = 'middle') {
  return new Promise((resolve) => {
    let result;
    count += 1;
    const id = `dialog-${count}`;
    const dialog = h(`dialog.dialog.dialog-${kind}`, {'aria-labelledby': id});
    const close = (found) => {
      result = found;
      dialog.close();
    };
    dialog.append(h('h2', {id}, title), ...[build(close)].flat(Infinity).filter(Boolean));
    dialog.onclose = () => {
      dialog.remove();
      resolve(result);
    };
    // Beside it is away, too. No onclick: what that returns, false, would forbid the click.
    dialog.addEventListener('click', (event) => {
      if (event.target === dialog && isOutside(dialog, event)) {
        close();
      }
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

function isOutside(dialog, {clientX, clientY}) {
  const box = dialog.getBoundingClientRect();
  return clientX < box.left || clientX > box.right || clientY < box.top || clientY > box.bottom;
}

/**
 * Ask whether to do something, perhaps with a text.
 * @param {Object} how title, text, yes, no, kind (of the button), label (of a text to give; none:
 *   no text), required, value
 * @returns {Promise<?string>} the text ('' without one); null is no
 */
export async function ask(how) {
  const found = await openDialog(how.title, (close) => {
    const input = how.label ? h('textarea', {rows: 3, maxlength: 120, 'aria-label': how.label,
      placeholder: how.label, required: how.required}) : null;
    if (input) {
      input.value = how.value || '';
    }
    const form = h('form', {method: 'dialog'}, how.text && h('p', how.text), input,
      h('div.actions', button(how.no, () => close(null), {kind: 'quiet'}),
        h(`button.button.${how.kind || 'primary'}`, {type: 'submit'}, how.yes)));
    form.onsubmit = (event) => {
      event.preventDefault();
      close(input ? input.value.trim() : '');
    };
    return form;
  });
  return found === undefined ? null : found;
}

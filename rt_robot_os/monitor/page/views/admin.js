// @ts-check
/** For administrators: users and whom they may see, robots' tokens, emergencies. */

import {h, replace} from '../lib/dom.js';
import {notice, segments} from '../lib/parts.js';
import {emergencies} from './admin/emergencies.js';
import {robots} from './admin/robots.js';
import {users} from './admin/users.js';

const PARTS = {users, robots, emergencies};

export const view = {
  name: 'admin',
  permission: 'admin',
  open(root, context, arg) {
    const {t} = context;
    let shown = 0;
    const place = h('div.section');
    const names = Object.fromEntries(Object.keys(PARTS).map((each) => [each, t(`admin.${each}`)]));
    const choice = segments(t('admin.parts'), names, arg in PARTS ? arg : 'users',
      (name) => show(name));
    const show = (name) => {
      shown += 1;
      const mine = shown;
      replace(place, notice('loading', t('shell.loading')));
      PARTS[name](place, context, () => mine === shown);
    };
    replace(root, h('div.section-head', choice), place);
    show(arg in PARTS ? arg : 'users');
    return () => {
      shown += 1;
    };
  },
};

// @ts-check
/**
 * The views: one line each. A view is views/NAME.js with style/NAME.css and messages/LANGUAGE/
 * NAME.json; its title is shell.view_NAME. permission: who may open it ('' is everybody).
 *
 * views/NAME.js: export const view = {name, permission, open(root, context, arg)}; open returns what
 * ends it. place: rail (the navigation), menu (of the account), or alone (no shell, no session).
 */

export const VIEWS = [
  {name: 'overview', permission: 'see', place: 'rail'},
  {name: 'alarms', permission: 'see', place: 'rail'},
  {name: 'data', permission: 'health', place: 'rail'},
  {name: 'position', permission: 'see', place: 'rail'},
  {name: 'camera', permission: 'camera', place: 'rail'},
  {name: 'drive', permission: 'drive', place: 'rail'},
  {name: 'network', permission: 'see', place: 'rail'},
  {name: 'account', permission: '', place: 'menu'},
  {name: 'admin', permission: 'admin', place: 'menu'},
  {name: 'audit', permission: 'audit', place: 'menu'},
  {name: 'login', permission: '', place: 'alone'},
  {name: 'setup', permission: '', place: 'alone'},
];

/** Find a view by its name; undefined is none. */
export function viewNamed(name) {
  return VIEWS.find((each) => each.name === name);
}

/** The views of a place that somebody with these permissions may open. */
export function viewsFor(place, permissions) {
  return VIEWS.filter((each) => each.place === place && mayOpen(each, permissions));
}

/** Whether somebody with these permissions may open a view. */
export function mayOpen(view, permissions) {
  return !view.permission || permissions.has(view.permission);
}

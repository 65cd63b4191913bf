// @ts-check
/**
 * What is drawn on the map, a function a layer; all in CSS pixels.
 *
 * Each gets a pen: {ctx, view, palette, nowMs, isLost, labels}, with the viewport and what is
 * written at the end.
 */

import {isOld, linkOf, OLD_MS} from './scene.js';
import {alarmShape, nodeShape, personShape, robotShape} from './symbols.js';

const DASHES = {good: [], fair: [8, 5], poor: [2, 5], unknown: [2, 8]};
const GRID_STEPS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const GRID_PX = 56;

/** Draw the map and the lines of a grid in metres. */
export function drawMap({ctx, view, palette}, map, picture) {
  ctx.fillStyle = palette.ground;
  ctx.fillRect(0, 0, view.width, view.height);
  if (map) {
    const [x0, y0, yaw] = map.origin;
    const [px, py] = view.toScreen(x0, y0);
    const cell = map.resolution_m * view.scale;
    ctx.save();
    ctx.translate(px, py);
    ctx.rotate(-yaw);
    ctx.imageSmoothingEnabled = cell < 1;
    ctx.drawImage(picture, 0, -map.height * cell, map.width * cell, map.height * cell);
    ctx.restore();
  }
  const step = GRID_STEPS.find((each) => each * view.scale >= GRID_PX) || 100;
  ctx.strokeStyle = palette.grid;
  ctx.lineWidth = 1;
  ctx.beginPath();
  const [left, top] = view.toWorld(0, 0);
  const [right, bottom] = view.toWorld(view.width, view.height);
  for (let x = Math.ceil(left / step) * step; x < right; x += step) {
    const [px] = view.toScreen(x, 0);
    ctx.moveTo(Math.round(px) + 0.5, 0);
    ctx.lineTo(Math.round(px) + 0.5, view.height);
  }
  for (let y = Math.ceil(bottom / step) * step; y < top; y += step) {
    const [, py] = view.toScreen(0, y);
    ctx.moveTo(0, Math.round(py) + 0.5);
    ctx.lineTo(view.width, Math.round(py) + 0.5);
  }
  ctx.stroke();
  return step;
}

/** Draw how many metres are how long. */
export function drawScale({ctx, view, palette, labels}, step, words) {
  const length = step * view.scale;
  const [x, y] = [16, view.height - 16];
  ctx.strokeStyle = palette.text;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(x, y - 5);
  ctx.lineTo(x, y);
  ctx.lineTo(x + length, y);
  ctx.lineTo(x + length, y - 5);
  ctx.stroke();
  labels.add(words, x + length / 2, y - 8, 0);
}

/** Draw what the scanner sees, from where the robot is. */
export function drawScan(pen, scene) {
  const {ctx, view, palette, nowMs} = pen;
  const {scan, pose} = scene;
  if (!scan || !pose || nowMs - scan.t > OLD_MS.scan * 5) {
    return;
  }
  ctx.globalAlpha = isOld(pen, scan.t, 'scan') ? 0.35 : 1;
  ctx.fillStyle = palette.scan;
  scan.ranges.forEach((range, index) => {
    if (Number.isFinite(range)) {
      const angle = pose.yaw + scan.angle_min + index * scan.angle_increment;
      const [px, py] = view.toScreen(pose.x + range * Math.cos(angle),
        pose.y + range * Math.sin(angle));
      ctx.fillRect(px - 1.5, py - 1.5, 3, 3);
    }
  });
  ctx.globalAlpha = 1;
}

/** Draw where the robot was in the last minutes. */
export function drawTrack({ctx, view, palette, nowMs}, scene) {
  ctx.strokeStyle = palette.track;
  ctx.lineWidth = 3;
  ctx.lineJoin = 'round';
  ctx.beginPath();
  scene.eachTrack(nowMs, (x, y, isNew) => {
    const [px, py] = view.toScreen(x, y);
    ctx[isNew ? 'moveTo' : 'lineTo'](px, py);
  });
  ctx.stroke();
}

/** Draw where it means to drive. */
export function drawPlan(pen, scene) {
  const {ctx, view, palette} = pen;
  const points = scene.plan?.points || [];
  if (points.length < 2) {
    return;
  }
  ctx.globalAlpha = isOld(pen, scene.plan.t, 'plan') ? 0.5 : 1;
  ctx.strokeStyle = palette.robot;
  ctx.lineWidth = 2;
  ctx.setLineDash([9, 6]);
  ctx.beginPath();
  points.forEach(([x, y], index) => {
    const [px, py] = view.toScreen(x, y);
    ctx[index ? 'lineTo' : 'moveTo'](px, py);
  });
  ctx.stroke();
  ctx.setLineDash([]);
  const [px, py] = view.toScreen(...points[points.length - 1]);
  ctx.beginPath();
  ctx.arc(px, py, 6, 0, 2 * Math.PI);
  ctx.stroke();
  ctx.globalAlpha = 1;
}

/** Draw the nodes of the network where they hang, and over which other each is heard. */
export function drawNodes(pen, scene, words) {
  if (!scene.nodes) {
    return;
  }
  const {ctx, view, palette, labels} = pen;
  const {nodes, t} = scene.nodes;
  const areOld = isOld(pen, t, 'nodes');
  const places = new Map();
  for (const node of nodes) {
    const place = placeOf(node, scene);
    if (place) {
      places.set(node.id, view.toScreen(...place));
    }
  }
  ctx.globalAlpha = areOld ? 0.45 : 1;
  for (const node of nodes) {
    drawLink(pen, places.get(node.id), places.get(node.parent), node, words, areOld);
  }
  for (const node of nodes) {
    const at = places.get(node.id);
    if (at) {
      nodeShape(ctx, at[0], at[1], areOld ? 'unheard' : node.state, palette);
      labels.add(node.name || String(node.id), at[0], at[1] + 22, 2, at[1] - 14);
    }
  }
  ctx.globalAlpha = 1;
}

/** @return where a node is; the sink is on the robot when it has no place of its own. */
function placeOf(node, {pose}) {
  if (Number.isFinite(node.x) && Number.isFinite(node.y)) {
    return [node.x, node.y];
  }
  return node.state === 'sink' && pose ? [pose.x, pose.y] : null;
}

function drawLink({ctx, palette, labels}, from, to, node, words, areOld) {
  if (!from || !to) {
    return;
  }
  const quality = areOld ? 'unknown' : linkOf(node);
  ctx.strokeStyle = palette.links[quality];
  ctx.lineWidth = quality === 'good' ? 2 : 2.5;
  ctx.setLineDash(DASHES[quality]);
  ctx.beginPath();
  ctx.moveTo(...from);
  ctx.lineTo(...to);
  ctx.stroke();
  ctx.setLineDash([]);
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  if ((quality === 'fair' || quality === 'poor') && length > 90) {
    labels.add(words(node), (from[0] + to[0]) / 2, (from[1] + to[1]) / 2 - 4, 3);
  }
}

/** Draw people, with how uncertain their place is. */
export function drawPeople(pen, scene, words) {
  const {ctx, view, palette, labels} = pen;
  for (const person of scene.people.values()) {
    if (!Number.isFinite(person.x)) {
      continue;
    }
    const [px, py] = view.toScreen(person.x, person.y);
    const wasThere = isOld(pen, person.t, 'person');
    const radius = (person.uncertaintyM || person.stddevM || 0) * view.scale;
    if (radius > 10) {
      ctx.fillStyle = wasThere ? palette.oldArea : palette.personArea;
      ctx.strokeStyle = wasThere ? palette.stale : palette.person;
      ctx.lineWidth = 1;
      ctx.setLineDash(wasThere ? [4, 4] : []);
      ctx.beginPath();
      ctx.arc(px, py, Math.min(radius, 4000), 0, 2 * Math.PI);
      ctx.fill();
      ctx.stroke();
      ctx.setLineDash([]);
    }
    personShape(ctx, px, py, wasThere ? palette.stale : palette.person, palette);
    labels.add(words(person), px, py + 30, 1, py - 20);
  }
}

/** Draw the robot, and how sure it is of its place. */
export function drawRobot(pen, scene, words) {
  const {ctx, view, palette, labels} = pen;
  const {pose} = scene;
  if (!pose) {
    return;
  }
  const [px, py] = view.toScreen(pose.x, pose.y);
  const wasThere = isOld(pen, pose.t, 'robot');
  const radius = (pose.stddevM || 0) * 2 * view.scale;
  if (radius > 16) {
    ctx.strokeStyle = wasThere ? palette.stale : palette.robot;
    ctx.lineWidth = 1;
    ctx.beginPath();
    ctx.arc(px, py, radius, 0, 2 * Math.PI);
    ctx.stroke();
  }
  robotShape(ctx, px, py, pose.yaw, Math.max(13, 0.22 * view.scale),
    wasThere ? palette.stale : palette.robot, palette, wasThere);
  const below = Math.max(13, 0.22 * view.scale) * 1.5;
  labels.add(words, px, py - below - 4, 1, py + below + 14);
}

/** Draw where alarms are. */
export function drawAlarms({ctx, view, palette}, alarms) {
  for (const {x, y, level} of alarms) {
    const [px, py] = view.toScreen(x, y);
    alarmShape(ctx, px, py, palette.levels[level] || palette.levels.warning, palette);
  }
}

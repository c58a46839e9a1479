// What lies below a click, found by projecting everything once.

import { project } from './vectors.js';

const kSlack = 7;  // CSS pixels

// `screen`: { viewProjection, width, height, x, y } of the click, CSS pixels.
// Returns [distance in pixels, depth] of a place; depth <= 0: behind the eye.
function distanceTo(screen, place) {
  const [x, y, depth] = project(screen.viewProjection, ...place);
  const dx = (x / depth + 1) / 2 * screen.width - screen.x;
  const dy = (1 - y / depth) / 2 * screen.height - screen.y;
  return [Math.hypot(dx, dy), depth];
}

// The nearest to the eye of the points below the click: { index, depth }.
export function pickPoint(xyz, screen) {
  let best = null;
  for (let i = 0; i < xyz.length / 3; ++i) {
    const [distance, depth] =
      distanceTo(screen, [xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]]);
    if (depth > 0 && distance < kSlack && !(best?.depth <= depth)) {
      best = { index: i, depth };
    }
  }
  return best;
}

// The same for wire frames; `lines`: end points of segments, coordinates one
// after another; `perItem`: how many vertices make up one of them.
export function pickLines(lines, perItem, screen) {
  let best = null;
  for (let vertex = 0; vertex < lines.length / 3; vertex += 2) {
    const from = [...lines.slice(3 * vertex, 3 * vertex + 3)];
    const to = [...lines.slice(3 * vertex + 3, 3 * vertex + 6)];
    for (let step = 0; step <= 8; ++step) {
      const place = from.map((value, i) => value + (to[i] - value) * step / 8);
      const [distance, depth] = distanceTo(screen, place);
      if (depth > 0 && distance < kSlack && !(best?.depth <= depth)) {
        best = { index: Math.floor(vertex / perItem), depth };
      }
    }
  }
  return best;
}

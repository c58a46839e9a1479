// Photos of what was removed, and what its track sees elsewhere.

import { html, svg } from './dom.js';
import { count, fixed, lowerBound, pixels } from './format.js';

// Drawn in the photo's pixels: a cross where the point was observed, a ring
// where it projects.
function marks({ size, observed, projected }) {
  const [x, y] = observed;
  const arm = size / 12;
  const root = svg('svg', {
    viewBox: `0 0 ${size} ${size}`, 'aria-hidden': 'true',
  });
  root.append(svg('path', {
    class: 'observed',
    d: `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}`,
  }));
  if (projected) {
    root.append(svg('circle', {
      class: 'projected', cx: projected[0], cy: projected[1], r: arm / 2,
    }));
  }
  return root;
}

function view({ image_name: name, point2D_idx: index, crop }) {
  const picture = crop ? html('div', { class: 'crop' },
    html('img', {
      src: `data:image/jpeg;base64,${crop.jpeg}`,
      alt: `${name} around 2D point ${index}`,
    }), marks(crop)) : html('div', { class: 'crop none' }, 'no photo');
  return html('figure', {}, picture,
    html('figcaption', {}, `${name}, ${index}`));
}

// One row per suspect, the removed observation first; choosing it shows camera
// and point in the scene.
export function suspectRows(suspects, onSelect) {
  return suspects.map((suspect) => html('div', { class: 'suspect' },
    html('button', {
      type: 'button',
      onclick: () => onSelect({
        imageName: suspect.image_name, pointId: suspect.point3D_id,
      }),
    }, `${suspect.image_name}, point ${suspect.point3D_id}`),
    html('div', { class: 'views' }, ...suspect.views.map(view))));
}

// What speaks against an image's rotation, which is taken as known.
export function rotationSentence(suspect) {
  const share = `${count(suspect.num_conflicts)} conflicts (${
    fixed(100 * suspect.conflict_share, 0)} %)`;
  return `${share} have ${suspect.image_name} in common: its rotation may be ` +
    `wrong. A turn by ${fixed(suspect.angle_deg, 2)} degrees leaves ${
      count(suspect.num_above_turned)} of its ${
      count(suspect.num_observations)} observations above the bound instead ` +
    `of ${count(suspect.num_above)}. With this image the largest error is at ` +
    `least ${lowerBound(suspect.lower_bound_with)} px (proved), without it ${
      pixels(suspect.max_error_without)} px.`;
}

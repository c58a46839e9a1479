// What verified matches say of the poses: a matrix of the pairs of images, and
// the photos of the pair that is chosen, with their matches.

import { html, svg } from './dom.js';
import { count, counted } from './format.js';
import { longTable } from './lists.js';

const kStates = ['kept', 'undecided', 'contradictory'];
const kGap = 12;  // between two photos

export function pairsNote({ pairs, tolerance_px: tolerance }) {
  const number = (state) => count(pairs.filter((pair) =>
    pair.state === state).length);
  return `Of the ${counted(pairs.length, 'pair')} of images ${
    number('kept')} agree with the poses (green), ${
    number('contradictory')} contradict them (red), ${
    number('undecided')} are undecided (amber). ` +
    `A match agrees within ${tolerance.toFixed(2)} px of its epipolar lines. ` +
    'Click a square to see its photos and some of its matches.';
}

// Indices of both images by the place of the pair, whichever comes first.
function pairPlaces({ images, pairs }) {
  const index = new Map(images.map((image, i) => [image.image_name, i]));
  return pairs.map((pair) => [index.get(pair.image1), index.get(pair.image2)]);
}

// A square for each pair, on both sides of the diagonal.
function matrix(database, onSelect) {
  const places = pairPlaces(database);
  const size = database.images.length;
  const root = svg('svg', {
    viewBox: `0 0 ${size} ${size}`, class: 'matrix', role: 'img',
    'aria-label': 'Pairs of images; the table has those that contradict',
  });
  for (const state of kStates) {
    const squares = places.filter((_, p) => database.pairs[p].state === state)
      .map(([i, j]) => `M${i} ${j}h1v1h-1zM${j} ${i}h1v1h-1z`);
    root.append(svg('path', { class: state, d: squares.join('') }));
  }
  const ring = svg('path', { class: 'ring', d: '' });
  root.append(ring);
  const pairAt = new Map(places.flatMap(([i, j], p) =>
    [[i * size + j, p], [j * size + i, p]]));
  root.addEventListener('click', (event) => {
    const box = root.getBoundingClientRect();
    const x = Math.floor((event.clientX - box.left) / box.width * size);
    const y = Math.floor((event.clientY - box.top) / box.height * size);
    const p = pairAt.get(x * size + y);
    if (p === undefined) return;
    ring.setAttribute('d', `M${x} ${y}h1v1h-1z`);
    onSelect(p);
  });
  return root;
}

// The two side by side, with a line for each match.
function pictures(images, matches) {
  const [first, second] = images;
  const shift = first.width + kGap;
  const root = svg('svg', {
    class: 'pair',
    viewBox: `0 0 ${shift + second.width} ${
      Math.max(first.height, second.height)}`,
  });
  images.forEach(({ width, height, jpeg }, n) => {
    const place = { x: n * shift, y: 0, width, height };
    root.append(jpeg ?
      svg('image', { ...place, href: `data:image/jpeg;base64,${jpeg}` }) :
      svg('rect', { ...place, class: 'none' }));
  });
  for (const [x1, y1, x2, y2, agrees] of matches) {
    root.append(svg('line', {
      class: agrees ? 'kept' : 'contradictory',
      x1, y1, x2: x2 + shift, y2,
    }));
  }
  return root;
}

// `view` holds images and matches in the order of the report.
export function pairsFigure(database, view, show) {
  const places = pairPlaces(database);
  const chosen = html('figure', { 'aria-live': 'polite' });
  const select = (p) => {
    const pair = database.pairs[p];
    const button = (imageName) => html('button',
      { type: 'button', onclick: () => show({ imageName }) }, imageName);
    chosen.replaceChildren(
      html('figcaption', {}, button(pair.image1), ' ', button(pair.image2),
        ` ${pair.state}: ${count(pair.num_agreeing)} of ${
          counted(pair.num_matches, 'match', 'matches')} agree with the poses`),
      pictures(places[p].map((i) => view.images[i]), view.matches[p]));
  };
  const contradictory = database.pairs.map((pair, p) => ({ pair, p }))
    .filter(({ pair }) => pair.state === 'contradictory')
    .sort((a, b) => b.pair.num_matches - a.pair.num_matches);
  const list = contradictory.length === 0 ? '' : longTable(
    ['Image', 'And image', 'Matches', 'Agree', 'With the best baseline'],
    contradictory.map(({ pair }) => [pair.image1, pair.image2,
      count(pair.num_matches), count(pair.num_agreeing),
      count(pair.num_explained)]),
    contradictory.map(({ p }) => p), select);
  return html('div', { class: 'figures' }, matrix(database, select),
    html('div', {}, chosen, html('div', { class: 'scroll' }, list)));
}

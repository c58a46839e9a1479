import { html, makeSelectable, table } from './dom.js';
import { count, pixels, significant } from './format.js';

const kShownRows = 12;

// The first rows, the others on demand. Choosing row i gives selections[i], which
// the scene can show, to onSelect.
export function longTable(head, rows, selections, onSelect) {
  const element = table(head, rows);
  const all = [...element.querySelectorAll('tbody tr')];
  all.forEach((row, i) => {
    row.firstChild.className = 'name';
    makeSelectable(row, () => onSelect(selections[i]));
    row.hidden = i >= kShownRows;
  });
  const container = html('div', {}, element);
  if (all.length > kShownRows) {
    const button = html('button', { type: 'button' },
      `Show all ${count(all.length)}`);
    button.addEventListener('click', () => {
      all.forEach((row) => { row.hidden = false; });
      button.remove();
    });
    container.append(html('p', {}, button));
  }
  return container;
}

// The observations that set the maximum.
export function supportTable(support, onSelect) {
  return longTable(
    ['Image', 'Point', '2D point', 'Multiplier', 'Error, px'],
    support.map((observation) => [
      observation.image_name,
      String(observation.point3D_id),
      String(observation.point2D_idx),
      significant(observation.multiplier, 4),
      pixels(observation.error_px),
    ]),
    support.map(({ image_name: imageName, point3D_id: pointId }) =>
      ({ imageName, pointId })), onSelect);
}

// The images of both models by name, the largest error of the second first.
export function pairImages(models) {
  const before = new Map(models[0].images.map((image) => [image.name, image]));
  const largest = ({ after }) => after.pixel_error.max ?? -1;
  return models[1].images
    .map((after) => ({ before: before.get(after.name), after }))
    .sort((a, b) => largest(b) - largest(a));
}

// Largest errors by image, the worst first.
export function imagesTable(models, labels, onSelect) {
  const [first, second] = labels.map((label) => label.toLowerCase());
  const pairs = pairImages(models);
  return longTable(['Image', 'Observations', `Max ${first}`, `Max ${second}`,
    `RMS ${first}`, `RMS ${second}`],
  pairs.map(({ before, after }) => [after.name, count(after.pixel_error.count),
    pixels(before?.pixel_error.max), pixels(after.pixel_error.max),
    pixels(before?.pixel_error.rms), pixels(after.pixel_error.rms)]),
  pairs.map(({ after }) => ({ imageName: after.name })), onSelect);
}

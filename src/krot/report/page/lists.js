import { html, makeSelectable, table } from './dom.js';
import { count, pixels, significant } from './format.js';

const kShownImages = 12;

// The observations that set the maximum; choosing one shows it in the scene.
export function supportTable(support, onSelect) {
  const element = table(
    ['Image', 'Point', '2D point', 'Multiplier', 'Error, px'],
    support.map((observation) => [
      observation.image_name,
      String(observation.point3D_id),
      String(observation.point2D_idx),
      significant(observation.multiplier, 4),
      pixels(observation.error_px),
    ]));
  element.querySelectorAll('tbody tr').forEach((row, i) => {
    row.firstChild.className = 'name';
    makeSelectable(row, () => onSelect(support[i]));
  });
  return element;
}

// The images of both models by name, the largest error of the second first.
export function pairImages(models) {
  const before = new Map(models[0].images.map((image) => [image.name, image]));
  const largest = ({ after }) => after.pixel_error.max ?? -1;
  return models[1].images
    .map((after) => ({ before: before.get(after.name), after }))
    .sort((a, b) => largest(b) - largest(a));
}

function imageRows(pairs, onSelect) {
  return pairs.map(({ before, after }) => {
    const texts = [after.name, count(after.pixel_error.count),
      pixels(before?.pixel_error.max), pixels(after.pixel_error.max),
      pixels(before?.pixel_error.rms), pixels(after.pixel_error.rms)];
    const row = html('tr', {}, ...texts.map((text) => html('td', {}, text)));
    row.firstChild.className = 'name';
    makeSelectable(row, () => onSelect(after.name));
    return row;
  });
}

// Largest errors by image, the worst first; the others on demand.
export function imagesTable(models, labels, onSelect) {
  const pairs = pairImages(models);
  const [first, second] = labels.map((label) => label.toLowerCase());
  const element = table(['Image', 'Observations', `Max ${first}`,
    `Max ${second}`, `RMS ${first}`, `RMS ${second}`], []);
  const body = element.querySelector('tbody');
  body.append(...imageRows(pairs.slice(0, kShownImages), onSelect));
  const container = html('div', {}, element);
  if (pairs.length > kShownImages) {
    const button = html('button', { type: 'button' },
      `Show all ${count(pairs.length)} images`);
    button.addEventListener('click', () => {
      body.append(...imageRows(pairs.slice(kShownImages), onSelect));
      button.remove();
    });
    container.append(html('p', {}, button));
  }
  return container;
}

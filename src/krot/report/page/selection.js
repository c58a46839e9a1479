// The numbers of one camera or point, in both models.

import { html, table } from './dom.js';
import { count, pixels, significant } from './format.js';

function coordinates(place) {
  return place ? place.map((value) => significant(value, 7)).join(' ') : '–';
}

function distance(a, b) {
  return a && b ?
    significant(Math.hypot(...a.map((value, i) => value - b[i])), 4) : '–';
}

// [name, number before, number after] for every row.
function panel(title, labels, rows, close) {
  return html('div', { class: 'info', role: 'status' },
    html('h3', {}, title),
    html('button', {
      type: 'button', class: 'close', 'aria-label': 'Close', onclick: close,
    }, '×'),
    html('div', { class: 'scroll' }, table(['', ...labels], rows)));
}

export function imagePanel(imageId, models, labels, close) {
  const images = models.map((model) =>
    model.images.find((image) => image.image_id === imageId));
  const known = images[1] ?? images[0];
  const error = (key) => images.map((image) => pixels(image?.pixel_error[key]));
  const rows = [
    ['Maximum, px', ...error('max')],
    ['P99, px', ...error('p99')],
    ['Mean, px', ...error('mean')],
    ['RMS, px', ...error('rms')],
    ['Observations', ...images.map((image) => count(image?.pixel_error.count))],
  ];
  const element = panel(known.name, labels, rows, close);
  const centers = images.map((image) => image?.center);
  element.append(html('div', { class: 'note' },
    `image ${imageId}, camera ${known.camera_id} (${known.camera_model}), ` +
    `centre ${coordinates(centers[1] ?? centers[0])}, ` +
    `moved by ${distance(...centers)}`));
  return element;
}

// Its index among the points that the page holds; -1 if it is not one of them.
export function pointIndex(model, pointId) {
  return model.points.ids.indexOf(BigInt(pointId));
}

// Relative to the page's origin.
export function pointPlace(model, index) {
  return [...model.points.xyz.slice(3 * index, 3 * index + 3)];
}

export function pointPanel(pointId, models, labels, close) {
  const indices = models.map((model) => pointIndex(model, pointId));
  const of = (key, format) => models.map((model, i) =>
    indices[i] < 0 ? '–' : format(model.points[key][indices[i]]));
  const rows = [
    ['Maximum, px', ...of('maxError', pixels)],
    ['Mean, px', ...of('meanError', pixels)],
    ['Observations', ...of('trackLength', count)],
  ];
  const element = panel(`Point ${pointId}`, labels, rows, close);
  const places = models.map((model, i) => indices[i] < 0 ? null :
    pointPlace(model, indices[i]).map((value, k) => value + model.origin[k]));
  element.append(html('div', { class: 'note' },
    `at ${coordinates(places[1] ?? places[0])}, moved by ` +
    distance(...places)));
  return element;
}

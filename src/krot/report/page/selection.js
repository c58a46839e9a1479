// The numbers of one camera or point, in both models.

import { findImage, pointIndex, pointPlace } from './data.js';
import { html, table } from './dom.js';
import { count, pixels, significant } from './format.js';

function coordinates(place) {
  return place ? place.map((value) => significant(value, 7)).join(' ') : '–';
}

// Where it is, and how far that is from where it was.
function position(places) {
  const [a, b] = places;
  const moved = a && b ? `, moved by ${
    significant(Math.hypot(...a.map((value, i) => value - b[i])), 4)}` : '';
  return coordinates(b ?? a) + moved;
}

// [name, number in every model] for every row.
function panel(title, labels, rows, close) {
  return html('div', { class: 'info', role: 'status' },
    html('h3', {}, title),
    html('button', {
      type: 'button', class: 'close', 'aria-label': 'Close', onclick: close,
    }, '×'),
    html('div', { class: 'scroll' }, table(['', ...labels], rows)));
}

export function imagePanel(name, models, labels, close) {
  const images = models.map((model) => findImage(model, name));
  const known = images[1] ?? images[0];
  const error = (key) => images.map((image) => pixels(image?.pixel_error[key]));
  const rows = [
    ['Maximum, px', ...error('max')],
    ['P99, px', ...error('p99')],
    ['Mean, px', ...error('mean')],
    ['RMS, px', ...error('rms')],
    ['Observations', ...images.map((image) => count(image?.pixel_error.count))],
  ];
  const element = panel(name, labels, rows, close);
  element.append(html('div', { class: 'note' },
    `image ${known.image_id}, camera ${known.camera_id} ` +
    `(${known.camera_model}), centre ` +
    position(images.map((image) => image?.center))));
  return element;
}

// `models`: those whose points the id is one of, one or two.
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
  element.append(html('div', { class: 'note' }, places.some(Boolean) ?
    `at ${position(places)}` : 'not among the points that this page holds'));
  return element;
}

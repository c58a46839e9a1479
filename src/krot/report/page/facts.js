import { modelErrors } from './data.js';
import { html, table } from './dom.js';
import {
  count, lowerBound, percent, pixels, seconds, significant,
} from './format.js';

function card(name, id, value) {
  return html('div', { class: 'card' },
    html('div', { class: 'value', id }, value),
    html('div', { class: 'name' }, name));
}

// The handful of numbers to see first.
export function cards(report, labels) {
  const [before, after] = modelErrors(report);
  const largest = (i) => `largest error, ${labels[i].toLowerCase()}, px`;
  const shown = [
    card(largest(0), 'card-before', pixels(before.max)),
    card(largest(1), 'card-after', pixels(after.max)),
  ];
  if (report.certified) {
    shown.push(
      card('proved lower bound, px', 'card-bound',
        lowerBound(report.lower_bound)),
      card('relative gap', 'card-gap', percent(report.relative_gap)));
  }
  if (Number.isInteger(report.num_observations)) {
    shown.push(card('observations', 'card-observations',
      count(report.num_observations)));
  }
  return shown;
}

// Of two models, those that both have in common; after the alignment.
export function differencesTable(report) {
  const rows = [['Rotation, degrees', report.rotation_deg],
    ['Camera centre, scene units', report.center],
    ['Point, scene units', report.point]];
  return table(['', 'Shared', 'Maximum', 'Median', 'Mean', 'RMS'],
    rows.map(([name, { count: shared, max, median, mean, rms }]) =>
      [name, count(shared),
        ...[max, median, mean, rms].map((value) => significant(value, 4))]));
}

// Of one model, or of both and what they share.
function counts(value) {
  return typeof value === 'object' ?
    listed(Object.entries(value), count) : count(value);
}

function listed(entries, format) {
  return entries.filter(([, value]) => value !== null && value !== 0)
    .map(([name, value]) => `${name} ${format(value)}`).join(', ');
}

// How many, and the first few by name.
function notHeld(images) {
  if (!images?.length) return undefined;
  const names = images.slice(0, 10).map((image) => image.image_name);
  return `${count(images.length)}: ${names.join(', ')}${
    images.length > names.length ? ', …' : ''}`;
}

// How the run went; a row for every figure that the report holds.
export function factsTable(report) {
  const loose = report.not_held ?? report.solve?.not_held;
  const facts = [
    ['Command', report.command],
    ['Method', report.method],
    ['Norm, p', report.norm],
    ['Ended because', report.termination],
    ['Frames', counts(report.num_frames)],
    ['Images', counts(report.num_images)],
    ['Points', counts(report.num_points)],
    ['Observations', counts(report.num_observations)],
    ['Parameters', counts(report.num_parameters)],
    ['Iterations', counts(report.num_iterations)],
    ['Rounds', counts(report.rounds?.length)],
    ['Linear solver', report.linear_solver],
    ['Redundancy', counts(report.precision?.redundancy)],
    ['Sigma0 a posteriori, px', significant(report.precision?.sigma0, 4)],
    ['Cap on every error, px', report.max_error],
    ['Left out', report.left_out &&
      (listed(Object.entries(report.left_out), count) || 'none')],
    ['Images that are not held', notHeld(loose?.images)],
    ['Points that are not determined', counts(loose?.points.length)],
    ['Alignment', report.alignment?.kind],
    ['Time', report.seconds && listed(Object.entries(report.seconds), seconds)],
    ['Memory', report.peak_memory_bytes === undefined ? undefined :
      `${(report.peak_memory_bytes / 1e6).toFixed(1)} MB at most`],
    ['Threads', report.threads],
  ];
  return table(['', ''], facts
    .filter(([, value]) => (value ?? '–') !== '–')
    .map(([name, value]) => [name, String(value)]));
}

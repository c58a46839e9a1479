import { html, table } from './dom.js';
import { count, lowerBound, percent, pixels, seconds } from './format.js';

function card(name, id, value) {
  return html('div', { class: 'card' },
    html('div', { class: 'value', id }, value),
    html('div', { class: 'name' }, name));
}

// The handful of numbers to see first.
export function cards(report, labels) {
  const { before, after } = report.pixel_error;
  const shown = [
    card(`${labels[0]}: largest error, px`, 'card-before', pixels(before.max)),
    card(`${labels[1]}: largest error, px`, 'card-after', pixels(after.max)),
  ];
  if (report.certified) {
    shown.push(
      card('Proved lower bound, px', 'card-bound',
        lowerBound(report.lower_bound)),
      card('Relative gap', 'card-gap', percent(report.relative_gap)));
  }
  if ('num_observations' in report) {
    shown.push(card('Observations', 'card-observations',
      count(report.num_observations)));
  }
  return shown;
}

function listed(entries, format) {
  return entries.filter(([, value]) => value !== null && value !== 0)
    .map(([name, value]) => `${name} ${format(value)}`).join(', ');
}

// How the run went; a row for what the report knows.
export function factsTable(report) {
  const facts = [
    ['Command', report.command],
    ['Method', report.method],
    ['Norm, p', report.norm],
    ['Ended because', report.termination],
    ['Frames', count(report.num_frames)],
    ['Images', count(report.num_images)],
    ['Points', count(report.num_points)],
    ['Observations', count(report.num_observations)],
    ['Left out', listed(Object.entries(report.left_out ?? {}), count) ||
      'none'],
    ['Seconds', listed(Object.entries(report.seconds ?? {}), seconds)],
    ['Memory', report.peak_memory_bytes === undefined ? undefined :
      `${(report.peak_memory_bytes / 1e6).toFixed(1)} MB at most`],
    ['Threads', report.threads],
  ];
  return table(['', ''], facts
    .filter(([, value]) => value !== undefined && value !== '–')
    .map(([name, value]) => [name, String(value)]));
}

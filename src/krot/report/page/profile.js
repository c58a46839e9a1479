// How low the largest error can be without some of the observations.

import { chart, linear, logarithmic, polyline } from './axes.js';
import { html, svg, table } from './dom.js';
import { count, counted, lowerBound, pixels } from './format.js';

// The fewest that do lie between what was proved and what was removed.
export function profileChart({ levels, elbow }) {
  const [high, low] = [levels[0].max_error, levels.at(-1).max_error];
  const { figure, at, add } = chart({
    caption: 'Largest error against the observations removed' +
      (elbow === null ? '; there is no elbow' : '; the ring is the elbow'),
    legend: [['after', 'removed'], ['bound', 'must go, proved']],
    x: linear(0, levels.at(-1).num_removed),
    y: high > 10 * low ? logarithmic(low * 0.9, high * 1.1) :
      linear(low * 0.9, high * 1.02),
    xName: 'observations',
    yName: 'px',
    width: 900,
    height: 280,
  });
  const curve = (name, key) => {
    const places = levels.map((level) => at(level[key], level.max_error));
    add(svg('path', { class: `${name} line`, d: polyline(places) }),
      ...places.map(([cx, cy], i) =>
        svg('circle', { class: `${name} step`, cx, cy, r: 3 },
          svg('title', {}, `${counted(levels[i][key], 'observation')}: ${
            pixels(levels[i].max_error)} px`))));
  };
  curve('bound', 'num_must_go');
  curve('after', 'num_removed');
  if (elbow !== null) {
    const [cx, cy] = at(levels[elbow].num_removed, levels[elbow].max_error);
    add(svg('circle', { class: 'ring', cx, cy, r: 8 }));
  }
  return figure;
}

export function profileTable({ levels, elbow }) {
  return table(['Removed', 'Must go', 'Largest error, px', 'Lower bound, px',
    ''], levels.map((level, i) => [
    count(level.num_removed), count(level.num_must_go),
    pixels(level.max_error), lowerBound(level.lower_bound),
    i === elbow ? html('b', {}, 'elbow') : '']));
}

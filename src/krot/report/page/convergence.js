// How the cost fell and the bound rose, step by step.

import { chart, linear, logarithmic, polyline } from './axes.js';
import { isMinimax } from './data.js';
import { svg } from './dom.js';
import { counted } from './format.js';

// All but those on the way to a start, which have no cost.
function iterationsOf(report) {
  return report.iterations.filter(({ method }) => method !== 'feasible_start');
}

// Sweeps and iterations in the order in which they ended.
export function courseOf(report) {
  const steps = [
    ...(report.sweeps ?? []),
    ...iterationsOf(report),
  ].map((step) => ({ lower_bound: null, ...step }));
  return steps.sort((a, b) => a.seconds - b.seconds);
}

function curve(name, places) {
  return [svg('path', { class: `${name} line`, d: polyline(places) }),
    ...places.map(([cx, cy]) =>
      svg('circle', { class: `${name} step`, cx, cy, r: 2.5 }))];
}

function stepsText(report) {
  return isMinimax(report) ?
    `${counted(report.sweeps.length, 'sweep')} and ` +
      `${counted(iterationsOf(report).length, 'joint iteration')}, in turn` :
    counted(report.iterations.length, 'iteration');
}

export function convergenceChart(report) {
  const steps = courseOf(report);
  const costs = [report.cost_initial, ...steps.map(({ cost }) => cost)];
  const bounds = steps
    .map((step, i) => [i + 1, step.lower_bound])
    .filter(([, bound]) => bound !== null && bound > 0);
  const values = [...costs, ...bounds.map(([, bound]) => bound)]
    .filter((value) => value > 0);
  if (values.length === 0) return null;
  const low = values.reduce((a, b) => Math.min(a, b));
  const high = values.reduce((a, b) => Math.max(a, b));
  const { figure, at, add } = chart({
    caption: isMinimax(report) ?
      `Cost and lower bound${report.rounds?.length > 1 ?
        ' of the round’s linear problem' : ''}, after every step` :
      'Cost, half the sum of the squared errors, after every step',
    legend: [['after', 'cost'], ...(bounds.length ? [['bound', 'bound']] : [])],
    x: linear(0, steps.length),
    y: logarithmic(low / 1.05, high * 1.05),
    xName: stepsText(report),
    yName: isMinimax(report) ? 'px' : 'px²',
    width: 900,
    height: 260,
  });
  add(...curve('after', costs.map((cost, i) => at(i, cost))));
  if (bounds.length) {
    add(...curve('bound', bounds.map(([i, bound]) => at(i, bound))));
  }
  return figure;
}

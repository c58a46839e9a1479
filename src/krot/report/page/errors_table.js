import { costIsLargestError, isMinimax, modelErrors } from './data.js';
import { html, table } from './dom.js';
import { pixels } from './format.js';

const kRows = [
  ['max', 'Maximum'], ['p99', '99th percentile'], ['mean', 'Mean'],
  ['rms', 'Root mean square'],
];

function change(before, after) {
  if (before === null || after === null || !(before > 0)) return '–';
  const percent = 100 * (after / before - 1);
  return `${percent > 0 ? '+' : percent < 0 ? '−' : ''}` +
    `${Math.abs(percent).toFixed(1)} %`;
}

function row(name, id, before, after) {
  const cell = (value, end) =>
    html('span', { id: `error-${id}-${end}` }, pixels(value));
  return [name, cell(before, 'before'), cell(after, 'after'),
    change(before, after)];
}

// The errors of all observations, and the cost that was minimised if it is no
// maximum of theirs.
export function errorsTable(report, labels) {
  const [before, after] = modelErrors(report);
  const rows = kRows.map(([key, name]) =>
    row(name, key, before[key], after[key]));
  if (isMinimax(report) && !report.is_given_back &&
    !costIsLargestError(report)) {
    rows.push(row(`Cost: maximum optimised, p = ${report.norm}`, 'cost',
      report.cost_initial, report.cost_final));
  }
  return table(['Pixels', ...labels, 'Change'], rows);
}

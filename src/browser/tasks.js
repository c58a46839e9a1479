// What the page can do, as commands of krot: `model` are files below model/. Each
// writes report.json, of which `verdict` makes one sentence.

import { counted, lowerBound, pixels } from '../krot/report/page/format.js';
import { verdict } from '../krot/report/page/verdict.js';

const kReports = ['report.json', 'page.html'];
const kPaths = ['--report_path', 'report.json', '--html_path', 'page.html'];
const kModels = ['--input_path', 'model', '--output_path', 'result'];

function checkVerdict({ certificate, conflicts }) {
  if (conflicts) {
    return 'The conflicts hold: whatever the translations and points, at least ' +
      `${counted(conflicts.num_conflicts, 'observation')} must go for all ` +
      `others to be within ${pixels(conflicts.max_error)} px.`;
  }
  const { lower_bound: bound, cost } = certificate;
  const given = certificate.num_fixed_frames + certificate.num_fixed_points +
    certificate.num_positions > 0 ? 'with what it takes as known, ' : '';
  return `The certificate holds: ${given}whatever the translations and ` +
    `points, the largest error is at least ${lowerBound(bound)} px; ` +
    (cost === null ? 'this model has observations behind their cameras.' :
      `this model has ${pixels(cost)} px.`);
}

export function analyze(model) {
  return {
    files: model,
    args: ['model_analyzer', '--path', 'model', '--report_path', 'report.json'],
    outputs: ['report.json'],
  };
}

export function judge(model) {
  return {
    title: 'Looking for what is wrong',
    verdict,
    files: model,
    args: ['model_checker', ...kModels, ...kPaths],
    outputs: ['result', ...kReports],
  };
}

export function solve(model) {
  return {
    title: 'Lowering the largest error',
    verdict,
    files: model,
    args: ['solver', ...kModels, ...kPaths,
      '--certificate_path', 'certificate.json'],
    outputs: ['result', 'certificate.json', ...kReports],
  };
}

// Without a bound the model's noise chooses one, and the error profile shows
// what others cost.
export function filter(model, bound) {
  const chosen = bound === null ?
    ['--OutlierFilter.profile_path', 'profile.json'] :
    ['--OutlierFilter.max_error', String(bound)];
  return {
    title: 'Looking for wrong observations',
    verdict,
    files: model,
    args: ['outlier_filter', ...kModels, ...kPaths, ...chosen,
      '--conflicts_path', 'conflicts.json', '--outliers_path', 'outliers.csv'],
    outputs: ['result', 'profile.json', 'conflicts.json', 'outliers.csv',
      ...kReports],
  };
}

export function check(model, certificate) {
  return {
    title: 'Checking the proof',
    verdict: checkVerdict,
    files: [...model, { path: 'proof/certificate.json', bytes: certificate }],
    args: ['certificate_checker', '--input_path', 'model',
      '--certificate_path', 'proof/certificate.json',
      '--report_path', 'report.json'],
    outputs: ['report.json'],
  };
}

export function compare(model, other) {
  return {
    title: 'Comparing the models',
    verdict,
    files: [...model, ...other],
    args: ['model_comparer', '--input_path1', 'model', '--input_path2', 'other',
      ...kPaths],
    outputs: kReports,
  };
}

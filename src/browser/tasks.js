// What the page can do, as commands of krot: `model` are files below model/, and
// `verdict` makes one sentence of what is printed.

const kReports = ['report.json', 'page.html'];
const kPaths = ['--report_path', 'report.json', '--html_path', 'page.html'];
const kModels = ['--input_path', 'model', '--output_path', 'result'];

function sentenceAt(pattern) {
  return (text) => text.match(pattern)[0].replace(/\s+/g, ' ');
}

export function analyze(model) {
  return {
    files: model,
    args: ['model_analyzer', '--path', 'model', '--report_path', 'report.json'],
    outputs: ['report.json'],
  };
}

export function solve(model) {
  return {
    title: 'Lowering the largest error',
    verdict: sentenceAt(/^Maximum .*$/m),
    files: model,
    args: ['solver', ...kModels, ...kPaths,
      '--certificate_path', 'certificate.json'],
    outputs: ['result', 'certificate.json', ...kReports],
  };
}

// Without a bound, the one that the error profile recommends; with it the
// profile is not made.
export function filter(model, bound) {
  const chosen = bound === null ?
    ['--OutlierFilter.profile_path', 'profile.json'] :
    ['--OutlierFilter.max_error', String(bound)];
  return {
    title: 'Looking for wrong observations',
    verdict: sentenceAt(/^removed .*$/m),
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
    verdict: sentenceAt(/^The .*?\.$/ms),
    files: [...model, { path: 'proof/certificate.json', bytes: certificate }],
    args: ['certificate_checker', '--input_path', 'model',
      '--certificate_path', 'proof/certificate.json'],
  };
}

export function compare(model, other) {
  return {
    title: 'Comparing the models',
    verdict: () => 'How the two differ stands in the report.',
    files: [...model, ...other],
    args: ['model_comparer', '--input_path1', 'model', '--input_path2', 'other',
      ...kPaths],
    outputs: kReports,
  };
}

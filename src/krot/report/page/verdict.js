import { isComparison, isMinimax, modelErrors } from './data.js';
import { lowerBound, pixels } from './format.js';

function movement(before, after, decimals) {
  const from = before.toFixed(decimals);
  const to = after.toFixed(decimals);
  if (from === to) return `stayed at ${to} px`;
  return `${after < before ? 'fell' : 'rose'} from ${from} px to ${to} px`;
}

// Whether the cost is, to the digits shown, the largest true error.
function costIsLargestError(report) {
  return report.norm === '2' &&
    pixels(report.cost_final) === pixels(report.pixel_error.after.max);
}

function proof(report) {
  const bound = `no camera translations and points can lower it below ` +
    `${lowerBound(report.lower_bound)} px (proved)`;
  if (costIsLargestError(report)) return `; ${bound}.`;
  return `. The cost, which is the largest residual linearised at the ` +
    `observations (p = ${report.norm}), ` +
    `${movement(report.cost_initial, report.cost_final, 4)}; ${bound}.`;
}

// Least squares lower the mean error; the largest may go either way.
function adjustmentVerdict(report, before, after) {
  const cap = report.max_error ?
    `, below the cap of ${report.max_error.toFixed(2)} px` : '';
  return `The root mean square error ${movement(before.rms, after.rms, 4)}; ` +
    `the largest error ${movement(before.max, after.max, 2)}${cap}.`;
}

// What least squares made of the solve's result.
function polishSentence(report) {
  if (!report.polish) return '';
  return ` Then the polish by least squares: the largest error ${movement(
    report.pixel_error.after.max, report.polish.pixel_error.max, 2)}.`;
}

// What came of it, in a sentence or two, without more than is known.
export function verdict(report) {
  const [before, after] = isMinimax(report) ?
    [report.pixel_error.before, report.pixel_error.after] :
    modelErrors(report);
  if (before.max === null || after.max === null) {
    return 'There is no observation with an error to compare.';
  }
  if (isComparison(report)) {
    return `The largest error of model 1 is ${before.max.toFixed(2)} px, ` +
      `of model 2 ${after.max.toFixed(2)} px.`;
  }
  if (!isMinimax(report)) return adjustmentVerdict(report, before, after);
  const sentence = `The largest error ${movement(before.max, after.max, 2)}`;
  return sentence + (report.certified ? proof(report) :
    '; whether it can be lower was not proved.') + polishSentence(report);
}

// What the verdict holds for.
export function scope(report) {
  return report.certified ?
    'The proof is for the rotations, intrinsics and observations as given, ' +
    'of the observations that took part in the optimisation.' : '';
}

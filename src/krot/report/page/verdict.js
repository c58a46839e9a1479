import { boxesVerdict } from './boxes.js';
import {
  costIsLargestError, isComparison, isFilter, isMinimax, modelErrors,
} from './data.js';
import { count, counted, lowerBound } from './format.js';

function movement(before, after, decimals) {
  const from = before.toFixed(decimals);
  const to = after.toFixed(decimals);
  if (from === to) return `stayed at ${to} px`;
  return `${after < before ? 'fell' : 'rose'} from ${from} px to ${to} px`;
}

function proof(report) {
  const bound = `no translations and points can lower it below ` +
    `${lowerBound(report.lower_bound)} px (proved)`;
  if (costIsLargestError(report)) return `; ${bound}.`;
  return `. The cost, which is the largest error of the observations that ` +
    `took part in the optimisation (p = ${report.norm}), ` +
    `${movement(report.cost_initial, report.cost_final, 4)}; ${bound}.`;
}

// A bracket for the fewest that do.
function filterVerdict(report) {
  const removed = `Without ${count(report.num_removed)} of ${
    counted(report.num_observations, 'observation')} all others are within ${
    report.max_error.toFixed(2)} px`;
  return report.num_must_go === null ? `${removed}.` :
    `${removed}; at least ${count(report.num_must_go)} must go (proved).`;
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
  if (isFilter(report)) return filterVerdict(report);
  if (report.boxes) return boxesVerdict(report);
  if (!isMinimax(report)) return adjustmentVerdict(report, before, after);
  if (report.is_given_back) {
    return 'No better estimate was found: the model is the one that was read.' +
      polishSentence(report);
  }
  if (report.termination === 'zero_cost') {
    return 'Every error is zero up to rounding; nothing is left to lower.' +
      polishSentence(report);
  }
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

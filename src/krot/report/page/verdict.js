import { boxesVerdict } from './boxes.js';
import { isComparison, isFilter, isMinimax, modelErrors } from './data.js';
import { count, counted, pixels } from './format.js';

function movement(before, after, decimals) {
  const from = before.toFixed(decimals);
  const to = after.toFixed(decimals);
  if (from === to) return `stayed at ${to} px`;
  return `${after < before ? 'fell' : 'rose'} from ${from} px to ${to} px`;
}

// What noise does not explain.
function snoopingVerdict({ snooping, num_removed: removed, num_observations,
  num_must_go: proved, pixel_error: { after } }) {
  const noise = `noise of ${snooping.sigma_px.toFixed(3)} px explains`;
  if (removed === 0) return `No observation is more than ${noise}.`;
  return `${count(removed)} of ${counted(num_observations, 'observation')} are ` +
    `more than ${noise}${proved ?
      `; at least ${count(proved)} must go (proved)` : ''}. ` +
    'Without them the root mean square error of the ' +
    `others ${movement(snooping.kept_error_before.rms, after.rms, 4)}.`;
}

// A bracket for the fewest that do, or why none is called wrong.
function filterVerdict(report) {
  if (report.snooping) return snoopingVerdict(report);
  if (report.max_error === null) {
    const { sigma, max_error: explained, lowest_max_error: lowest } =
      report.noise;
    return 'No observation is called wrong, and the model is the one that ' +
      `was read: noise of ${pixels(sigma)} px explains errors up to ${
        pixels(explained)} px, and ` + (lowest <= explained ?
        `translations and points bring all down to ${pixels(lowest)} px.` :
        'it was not proved that some errors stay above that.');
  }
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
  if (report.command === 'model_checker') return report.verdict;
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
  const fall = report.is_given_back ? '' :
    `The largest error ${movement(before.max, after.max, 2)}. `;
  return fall + report.verdict + polishSentence(report);
}

// What the verdict holds for.
export function scope(report) {
  if (report.command === 'model_checker') return report.parts_sentence;
  return report.certified ?
    'The proof is for the rotations, intrinsics and observations as given, ' +
    'of the observations that took part in the optimisation.' : '';
}

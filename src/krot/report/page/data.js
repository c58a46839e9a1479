// What the page was given: the report as --report_path writes it, and what is
// drawn of the two models.

import { byId } from './dom.js';
import { pixels } from './format.js';

export function readJson(id) {
  return JSON.parse(byId(id).textContent);
}

function decode(base64, ArrayType) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return new ArrayType(bytes.buffer);
}

// Replaces the base64 texts of a model's points by the arrays they stand for.
export function decodeModel(model) {
  const points = model.points;
  return {
    ...model,
    points: {
      num: points.num,
      ids: decode(points.ids, BigUint64Array),
      xyz: decode(points.xyz, Float32Array),
      rgb: decode(points.rgb, Uint8Array),
      maxError: decode(points.max_error, Float32Array),
      meanError: decode(points.mean_error, Float32Array),
      trackLength: decode(points.track_length, Uint32Array),
    },
  };
}

// The largest error of a model; null if it has none.
export function largestError(model) {
  return model.tail.length > 0 ? model.tail[0][1] : null;
}

// Whether the two models came from different hands, so that equal point ids do
// not mean equal points; images are the same where their names are.
export function isComparison(report) {
  return report.command === 'model_comparer';
}

// Whether observations were removed.
export function isFilter(report) {
  return report.command === 'outlier_filter';
}

// Whether the cost is a largest error in pixels, and may have a proof.
export function isMinimax(report) {
  return 'certified' in report;
}

// Whether that cost is, to the digits shown, the maximum over all observations.
export function costIsLargestError(report) {
  return report.norm === '2' &&
    pixels(report.cost_final) === pixels(report.pixel_error.after.max);
}

// How the two models of a report are called.
export function modelLabels(report) {
  if (isComparison(report)) return ['Model 1', 'Model 2'];
  return ['Before', report.polish ? 'Polished' : 'After'];
}

// The statistics of the errors of both. What is written after a solve is
// the polished model, if there was a polish.
export function modelErrors(report) {
  const errors = report.pixel_error;
  return isComparison(report) ?
    [errors.model1, errors.model2] :
    [errors.before, report.polish?.pixel_error ?? errors.after];
}

export function findImage(model, name) {
  return model.images.find((image) => image.name === name);
}

// Among the points that the page holds; -1 if it is not one of them.
export function pointIndex(model, pointId) {
  model.pointIndices ??=
    new Map(Array.from(model.points.ids, (id, index) => [id, index]));
  return model.pointIndices.get(BigInt(pointId)) ?? -1;
}

// Relative to the page's origin.
export function pointPlace(model, index) {
  return [...model.points.xyz.slice(3 * index, 3 * index + 3)];
}

// What the page was given: the report as --report_path writes it, and what is
// drawn of the two models.

import { byId } from './dom.js';

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

// How the two models of a report are called.
export function modelLabels(report) {
  return report.command === 'model_comparer' ?
    ['Model 1', 'Model 2'] : ['Before', 'After'];
}

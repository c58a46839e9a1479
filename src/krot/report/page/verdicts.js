// What model_checker found: images by verdict and wrong observations, as lists and
// as colours.

import { styleColor } from './colors.js';
import { count, counted, significant } from './format.js';
import { longTable } from './lists.js';

const kVerdictStyles = { wrong: '--wrong', 'weakly held': '--weak', fine: '--after' };

// From names to verdicts; null if the command gives none.
export function verdictsByName(report) {
  if (report.command !== 'model_checker') return null;
  return new Map(report.images.map((image) =>
    [image.image_name, image.verdict]));
}

export function verdictColor(verdict) {
  return styleColor(kVerdictStyles[verdict] ?? '--after');
}

export function badImagesTable({ images }, onSelect) {
  const bad = images.filter(({ verdict }) => verdict !== 'fine')
    .sort((a, b) => (a.verdict < b.verdict) - (a.verdict > b.verdict) ||
      b.num_wrong - a.num_wrong);
  if (bad.length === 0) return '';
  return longTable(['Image', 'Verdict', 'Observations', 'Of these wrong', 'Why'],
    bad.map((image) => [image.image_name, image.verdict,
      count(image.num_observations), count(image.num_wrong), image.reason]),
    bad.map(({ image_name: imageName }) => ({ imageName })), onSelect);
}

export function wrongObservationsTable({ observations }, onSelect) {
  if (observations.length === 0) return '';
  return longTable(['Image', '2D point', 'Point', 'w', 'Error, px'],
    observations.map((one) => [one.image_name, String(one.point2D_idx),
      String(one.point3D_id), significant(one.w, 3),
      significant(one.error_px, 3)]),
    observations.map((one) => ({
      imageName: one.image_name, pointId: one.point3D_id,
    })), onSelect);
}

export function verdictsNote({ images, observations }) {
  const number = (verdict) =>
    images.filter((image) => image.verdict === verdict).length;
  return `${counted(number('wrong'), 'image')} wrong (red in the 3D view), ${
    count(number('weakly held'))} weakly held (amber), ${
    count(number('fine'))} fine${
    number('not judged') > 0 ? `, ${count(number('not judged'))} not judged` : ''}; ${
    counted(observations.length, 'wrong observation')} in images that are not ` +
    'wrong (their points are marked). Click a row to see it in the 3D view.';
}

// What the data allow: everywhere that cameras and points may be.

import { html, makeSelectable, table } from './dom.js';
import { count, counted, significant } from './format.js';
import { subtract } from './vectors.js';

const kAxes = [0, 1, 2];

// Corners by their bits: 1 for high x, 2 for high y, 4 for high z.
const kBoxEdges = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6],
  [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

// The line segments of a box, as coordinates relative to `origin`. Where a side
// has no end, as far as an estimate was met.
export function boxLines({ low, high }, origin) {
  const ends = [low, high].map(({ proved, reached }) => subtract(
    kAxes.map((axis) => proved[axis] ?? reached[axis]), origin));
  const corner = (bits) => kAxes.map((axis) => ends[(bits >> axis) & 1][axis]);
  return kBoxEdges.flatMap(([from, to]) => [...corner(from), ...corner(to)]);
}

function widths({ low, high }) {
  return kAxes.map((axis) => significant(
    low.proved[axis] === null || high.proved[axis] === null ? null :
      high.proved[axis] - low.proved[axis], 4));
}

// How wide each box is; choosing it shows it in the scene.
export function boxesTable(boxes, onSelect) {
  const element = table(
    ['Position', 'Width in x', 'Width in y', 'Width in z'],
    boxes.map((box) =>
      [box.image_name ?? `point ${box.point3D_id}`, ...widths(box)]));
  element.querySelectorAll('tbody tr').forEach((row, i) => {
    row.firstChild.className = 'name';
    makeSelectable(row, () => onSelect({
      imageName: boxes[i].image_name, pointId: boxes[i].point3D_id,
    }));
  });
  return element;
}

export function boxesNote({ gauge, boxes, max_error: bound }) {
  const [first, second] = gauge.images;
  const held = first === undefined ? 'What is fixed holds place and scale.' :
    `${first} stands still${second === undefined ? '.' :
      `; ${second} keeps its distance along the line between the two.`}`;
  return `Every estimate within ${bound.toFixed(2)} px has ${
    counted(boxes.length, 'position')} inside of these boxes (proved), scene ` +
    `units. ${held}`;
}

// How many of the ends that were asked for there are.
export function boxesVerdict({ boxes, max_error: bound }) {
  const ends = boxes.flatMap(({ low, high }) =>
    [...low.proved, ...high.proved]);
  const proved = ends.filter((end) => end !== null).length;
  return `Of ${counted(ends.length, 'end')} of what all estimates within ${
    bound.toFixed(2)} px allow, ${count(proved)} are proved.`;
}

// Cameras as wire frames: an apex, four corners and a notch that shows what is
// up in the image.

import { add, rotate, scale, subtract } from './vectors.js';

const kEdges = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1],
  [1, 5], [5, 2]];
export const kVerticesPerImage = 2 * kEdges.length;

// Corners of the wire frame, relative to `origin`. Requires a pose.
function cornersOf(image, origin, size) {
  const [w, h] = image.half_extent;
  const apex = subtract(image.center, origin);
  const inCamera = [[-w, -h, 1], [w, -h, 1], [w, h, 1], [-w, h, 1],
    [0, -1.4 * h, 1]];
  return [apex, ...inCamera.map((corner) =>
    add(apex, scale(rotate(image.world_from_cam, corner), size)))];
}

// The line segments of one camera, as coordinates one after another.
export function frustumLines(image, origin, size) {
  const corners = cornersOf(image, origin, size);
  return kEdges.flatMap(([from, to]) => [...corners[from], ...corners[to]]);
}

export function posedImages(model) {
  return model.images.filter((image) => image.center !== null);
}

// Where to look from, and how large to draw a camera.

import { frustumLines, posedImages } from './frusta.js';
import { add, median, norm, normalized, scale, subtract } from './vectors.js';

function columns(xyz, stride) {
  const axes = [[], [], []];
  for (let i = 0; i < xyz.length; i += 3 * stride) {
    axes.forEach((axis, k) => axis.push(xyz[i + k]));
  }
  return axes;
}

// The distance from `target` that a share of the places, three lists of
// coordinates, does not exceed.
function reach(places, target, share) {
  const distances = places[0].map((_, i) =>
    norm(subtract(places.map((axis) => axis[i]), target)));
  distances.sort((a, b) => a - b);
  return distances[Math.floor(share * (distances.length - 1))] ?? 0;
}

// A ball around most of what is drawn, without the stragglers; `front` points
// from its centre to where most cameras are.
export function frame(model) {
  const stride = Math.max(1, Math.floor(model.points.num / 5000));
  const points = columns(model.points.xyz, stride);
  const cameras = columns(posedImages(model).flatMap(({ center }) =>
    subtract(center, model.origin)), 1);
  const kinds = [points, cameras].filter(([axis]) => axis.length > 0);
  if (kinds.length === 0) {
    return { target: [0, 0, 0], radius: 1, front: [0, 0, 1] };
  }
  const target = scale(
    kinds.map((places) => places.map(median)).reduce(add), 1 / kinds.length);
  const radius = Math.max(
    reach(points, target, 0.9), reach(cameras, target, 0.95));
  const front = cameras[0].length > 0 ?
    subtract(cameras.map(median), target) : [0, 0, 1];
  return { target, radius: radius || 1, front };
}

// Against the mean of the images' y axes, which point downwards.
export function upDirection(model) {
  const down = posedImages(model)
    .map(({ world_from_cam: r }) => [r[1], r[4], r[7]])
    .reduce(add, [0, 0, 0]);
  return norm(down) > 0 ? normalized(scale(down, -1)) : [0, 0, 1];
}

// Half of what is usual between a camera and the nearest other one.
export function cameraSize(model, radius) {
  const centers = posedImages(model).map(({ center }) => center);
  const some = centers.slice(0, 400);
  const nearest = some.map((a) => centers.reduce((least, b) =>
    b === a ? least : Math.min(least, norm(subtract(a, b))), Infinity));
  const spacing = some.length > 1 ? median(nearest) : radius;
  return Math.min(0.12 * radius, Math.max(0.02 * radius, 0.5 * spacing));
}

export function allFrusta(model, size) {
  const images = posedImages(model);
  return new Float32Array(images.flatMap((image) =>
    frustumLines(image, model.origin, size)));
}

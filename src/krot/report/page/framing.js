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

// Of what is drawn, without the stragglers.
export function frame(model) {
  const { xyz } = model.points;
  const stride = Math.max(1, Math.floor(model.points.num / 5000));
  const centers = posedImages(model)
    .map(({ center }) => subtract(center, model.origin));
  const axes = columns(xyz, stride);
  centers.forEach((center) => axes.forEach((axis, k) => axis.push(center[k])));
  if (axes[0].length === 0) return { target: [0, 0, 0], radius: 1 };
  const target = axes.map(median);
  const distances = axes[0].map((_, i) =>
    norm(subtract(axes.map((axis) => axis[i]), target)))
    .sort((a, b) => a - b);
  const radius = distances[Math.floor(0.9 * (distances.length - 1))];
  return { target, radius: radius || 1 };
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

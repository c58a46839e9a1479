// Colours as bytes: of errors, and of the style sheet.

// Low to high; dark enough for a light page and light enough for a dark one.
const kStops = [
  [58, 110, 165], [53, 151, 143], [127, 188, 65], [244, 180, 26],
  [230, 85, 13], [190, 0, 60],
];
const kUnknown = [128, 128, 128];

// `share`: 0 to 1, more being as 1; NaN: unknown.
export function errorColor(share) {
  if (Number.isNaN(share)) return kUnknown;
  const place = Math.min(1, Math.max(0, share)) * (kStops.length - 1);
  const stop = Math.min(kStops.length - 2, Math.floor(place));
  const weight = place - stop;
  return kStops[stop].map((low, i) =>
    Math.round(low + weight * (kStops[stop + 1][i] - low)));
}

// Three bytes per error.
export function errorColors(errors, top) {
  const colors = new Uint8Array(3 * errors.length);
  errors.forEach((error, i) => colors.set(errorColor(error / top), 3 * i));
  return colors;
}

export function uniformColors(color, count) {
  const colors = new Uint8Array(3 * count);
  for (let i = 0; i < count; ++i) colors.set(color, 3 * i);
  return colors;
}

export function errorGradient() {
  return `linear-gradient(90deg, ${
    kStops.map((color) => `rgb(${color})`).join(', ')})`;
}

// The value of a custom property such as --after: #1f6fd0.
export function styleColor(name) {
  const text = getComputedStyle(document.documentElement)
    .getPropertyValue(name).trim();
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
}

// The two models on the graphics card, in the colours asked for.

import {
  errorColor, errorColors, styleColor, uniformColors,
} from './colors.js';
import { allFrusta } from './framing.js';
import { kVerticesPerImage, posedImages } from './frusta.js';
import { verdictColor } from './verdicts.js';

function repeated(colors, times) {
  const all = new Uint8Array(3 * colors.length * times);
  colors.forEach((color, i) => {
    for (let k = 0; k < times; ++k) all.set(color, 3 * (i * times + k));
  });
  return all;
}

export class Layer {
  // `styleName`: the custom property with the model's own colour; `verdicts`: by
  // image name.
  constructor(renderer, model, styleName, size, verdicts) {
    this.renderer = renderer;
    this.model = model;
    this.styleName = styleName;
    this.verdicts = verdicts;
    this.lines = allFrusta(model, size);
    this.points = renderer.createBatch(renderer.gl.POINTS, model.points.xyz);
    this.cameras = renderer.createBatch(renderer.gl.LINES, this.lines);
  }

  // `mode`: rgb, error (as a share of `top`), verdict or model.
  paint(mode, top) {
    this.renderer.setColors(this.points, this.pointColors(mode, top));
    this.renderer.setColors(this.cameras, repeated(
      posedImages(this.model).map((image) => this.cameraColor(image, mode, top)),
      kVerticesPerImage));
  }

  cameraColor(image, mode, top) {
    if (mode === 'error') {
      return errorColor((image.pixel_error.max ?? NaN) / top);
    }
    if (mode === 'verdict') return verdictColor(this.verdicts.get(image.name));
    return styleColor(this.styleName);
  }

  pointColors(mode, top) {
    const { points } = this.model;
    if (mode === 'rgb' || mode === 'verdict') return points.rgb;
    if (mode === 'error') return errorColors(points.maxError, top);
    return uniformColors(styleColor(this.styleName), points.num);
  }
}

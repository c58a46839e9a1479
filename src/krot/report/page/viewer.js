// The interactive view of both models.

import { byId, html } from './dom.js';
import { styleColor, uniformColors } from './colors.js';
import { largestError } from './data.js';
import { cameraSize, frame, upDirection } from './framing.js';
import { frustumLines, kVerticesPerImage, posedImages } from './frusta.js';
import { Layer } from './layers.js';
import { Orbit, attachControls } from './orbit.js';
import { pickLines, pickPoint } from './picking.js';
import { Renderer } from './renderer.js';
import {
  imagePanel, pointIndex, pointPanel, pointPlace,
} from './selection.js';
import { subtract } from './vectors.js';

export class Viewer {
  // `stage`: the element to fill; `support`: the report's, [] if none. Throws
  // where the browser has no WebGL 2.
  constructor(stage, models, labels, support) {
    const canvas = html('canvas', {
      tabindex: 0, 'aria-label': '3D view of cameras and points',
    });
    const gl = canvas.getContext('webgl2', { antialias: true, alpha: true });
    if (!gl) throw new Error('no WebGL 2');
    stage.append(canvas);
    Object.assign(this, { stage, canvas, models, labels, support });
    this.renderer = new Renderer(gl);
    const { target, radius } = frame(models[1]);
    this.size = cameraSize(models[1], radius);
    this.orbit = new Orbit({
      target, distance: 2.6 * radius, up: upDirection(models[1]),
    });
    this.layers = models.map((model, i) =>
      new Layer(this.renderer, model, ['--before', '--after'][i], this.size));
    this.shown = 'after';
    this.mode = 'rgb';
    this.pointSize = 2;
    this.hasSupport = support.length > 0;
    this.marks = [];
    attachControls(canvas, this.orbit, {
      onChange: () => this.redraw(),
      onClick: (x, y) => this.selectAt(x, y),
    });
    new ResizeObserver(() => this.redraw()).observe(canvas);
    canvas.addEventListener('webglcontextlost', () => stage.replaceChildren(
      html('p', {}, 'The browser took the 3D view away; reload the page.')));
    this.update();
  }

  // The errors' colours end at what both models reach, so that a rough start
  // does not leave the result in one colour.
  top() {
    return Math.min(...this.models.map((model) => largestError(model) ?? 1));
  }

  // Indices of the models in view.
  visible() {
    return { before: [0], after: [1], both: [0, 1] }[this.shown];
  }

  update() {
    const mode = this.shown === 'both' ? 'model' : this.mode;
    this.visible().forEach((i) => this.layers[i].paint(mode, this.top()));
    this.updateMarks();
    this.redraw();
  }

  // Lines between the support's cameras and points, and what is selected.
  updateMarks() {
    this.marks.forEach((batch) => this.renderer.deleteBatch(batch));
    this.marks = [];
    const { gl } = this.renderer;
    const lines = [];
    const points = [];
    for (const i of this.visible()) {
      const model = this.models[i];
      if (this.hasSupport) lines.push(...this.supportLines(model));
      const { imageId, pointId } = this.selected ?? {};
      const image = model.images.find(({ image_id }) => image_id === imageId);
      if (image?.center) {
        lines.push(...frustumLines(image, model.origin, 1.3 * this.size));
      }
      const index = pointId === undefined ? -1 : pointIndex(model, pointId);
      if (index >= 0) points.push(...pointPlace(model, index));
    }
    this.mark(gl.LINES, lines);
    this.mark(gl.POINTS, points);
  }

  mark(mode, places) {
    if (places.length === 0) return;
    const batch = this.renderer.createBatch(mode, new Float32Array(places));
    this.renderer.setColors(batch,
      uniformColors(styleColor('--mark'), batch.count));
    batch.pointSize = 10 * devicePixelRatio;
    this.marks.push(batch);
  }

  supportLines(model) {
    const images = new Map(
      model.images.map((image) => [image.image_id, image]));
    return this.support.flatMap(({ image_id, point3D_id }) => {
      const center = images.get(image_id)?.center;
      const index = pointIndex(model, point3D_id);
      if (!center || index < 0) return [];
      return [...subtract(center, model.origin), ...pointPlace(model, index)];
    });
  }

  redraw() {
    this.frameRequest ??= requestAnimationFrame(() => {
      this.frameRequest = null;
      this.drawNow();
    });
  }

  drawNow() {
    const { canvas } = this;
    const width = Math.round(canvas.clientWidth * devicePixelRatio);
    const height = Math.round(canvas.clientHeight * devicePixelRatio);
    if (width === 0 || height === 0) return;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const batches = this.visible().flatMap((i) =>
      [this.layers[i].points, this.layers[i].cameras]);
    this.renderer.draw([...batches, ...this.marks], {
      viewProjection: this.orbit.viewProjection(width / height),
      targetDistance: this.orbit.distance,
      pointSize: this.pointSize * devicePixelRatio,
    });
  }

  // Cameras come before points that are not in front of them.
  selectAt(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const screen = {
      x, y, width, height,
      viewProjection: this.orbit.viewProjection(width / height),
    };
    const i = this.visible().at(-1);
    const model = this.models[i];
    const image = pickLines(this.layers[i].lines, kVerticesPerImage, screen);
    const point = pickPoint(model.points.xyz, screen);
    if (image && !(point?.depth < image.depth)) {
      this.select({ imageId: posedImages(model)[image.index].image_id });
    } else if (point) {
      this.select({ pointId: model.points.ids[point.index] });
    } else {
      this.select(null);
    }
  }

  // { imageId }, { pointId }, both, or null for nothing.
  select(selected) {
    this.selected = selected;
    this.stage.querySelectorAll('.info').forEach((panel) => panel.remove());
    const close = () => this.select(null);
    if (selected?.imageId !== undefined) {
      this.stage.append(
        imagePanel(selected.imageId, this.models, this.labels, close));
    } else if (selected) {
      this.stage.append(
        pointPanel(selected.pointId, this.models, this.labels, close));
    }
    this.updateMarks();
    this.redraw();
  }

  // The same, and the page scrolls to it.
  show(selected) {
    this.select(selected);
    byId('scene').scrollIntoView({ behavior: 'smooth' });
  }
}

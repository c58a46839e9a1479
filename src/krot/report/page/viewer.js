// The interactive view of both models.

import { byId, html } from './dom.js';
import { boxLines } from './boxes.js';
import { styleColor, uniformColors } from './colors.js';
import {
  findImage, largestError, pointIndex, pointPlace,
} from './data.js';
import { cameraSize, frame, upDirection } from './framing.js';
import { frustumLines, kVerticesPerImage, posedImages } from './frusta.js';
import { Layer } from './layers.js';
import { Orbit, attachControls } from './orbit.js';
import { pickLines, pickPoint } from './picking.js';
import { Renderer } from './renderer.js';
import { imagePanel, pointPanel } from './selection.js';
import { subtract } from './vectors.js';

// CSS pixels: the more points, the smaller.
function usualPointSize(numPoints) {
  return Math.min(3.5, Math.max(1.5, 250 / Math.sqrt(numPoints)));
}

export class Viewer {
  // `stage`: the element to fill; `support`: the report's, [] if none;
  // `boxes`: likewise, in the second model; `levels`: of the error profile, [] if
  // none; `verdicts`: by image name, null if there are none; `wrongPoints`: ids;
  // `sharesPoints`: whether the models' point ids mean the same points.
  // Throws where the browser has no WebGL 2.
  constructor(stage, { models, labels, support, boxes, levels, verdicts,
    wrongPoints, sharesPoints }) {
    const canvas = html('canvas', {
      tabindex: 0, 'aria-label': '3D view of cameras and points',
    });
    // Where the processor draws, smooth edges cost most of a frame.
    const antialias = models[1].points.num < 30000;
    const gl = canvas.getContext('webgl2', { antialias });
    if (!gl) throw new Error('no WebGL 2');
    this.panels = html('div', { class: 'panels' });
    stage.append(canvas, this.panels);
    Object.assign(this,
      { stage, canvas, models, labels, support, boxes, levels, verdicts,
        wrongPoints, sharesPoints });
    this.renderer = new Renderer(gl);
    const { target, radius, front } = frame(models[1]);
    this.size = cameraSize(models[1], radius);
    this.orbit = new Orbit({
      target, distance: 1.9 * radius, up: upDirection(models[1]), front,
    });
    this.layers = models.map((model, i) =>
      new Layer(this.renderer, model, ['--before', '--after'][i], this.size,
        verdicts));
    this.shown = verdicts ? 'before' : 'after';  // what is wrong is in the first
    this.mode = verdicts ? 'verdict' : 'rgb';
    this.pointSize = usualPointSize(models[1].points.num);
    this.hasSupport = support.length > 0;
    this.level = 0;
    this.marks = [];
    this.selected = {};
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

  // Lines between the support's cameras and points, the points that lose
  // observations at the level or to verdicts, and what is selected.
  updateMarks() {
    this.marks.forEach((batch) => this.renderer.deleteBatch(batch));
    this.marks = [];
    const { gl } = this.renderer;
    const lines = [];
    const points = [];
    const suspects = [];
    for (const i of this.visible()) {
      const model = this.models[i];
      if (this.hasSupport) lines.push(...this.supportLines(model));
      if (i === 1) {
        lines.push(...this.boxes.flatMap((box) => boxLines(box, model.origin)));
      }
      suspects.push(...this.suspectPlaces(model));
      const { imageName, pointId } = this.selected;
      const image = findImage(model, imageName);
      if (image?.center) {
        lines.push(...frustumLines(image, model.origin, 1.3 * this.size));
      }
      const index = pointId !== undefined && this.knowsPoint(i) ?
        pointIndex(model, pointId) : -1;
      if (index >= 0) points.push(...pointPlace(model, index));
    }
    this.mark(gl.LINES, lines);
    this.mark(gl.POINTS, suspects, 2 * this.pointSize);
    this.mark(gl.POINTS, points);
  }

  // Whether the selected point's id is one of model i's.
  knowsPoint(i) {
    return this.sharesPoints || i === this.selected.modelIndex;
  }

  mark(mode, places, pointSize = 10) {
    if (places.length === 0) return;
    const batch = this.renderer.createBatch(mode, new Float32Array(places));
    this.renderer.setColors(batch,
      uniformColors(styleColor('--mark'), batch.count));
    batch.pointSize = pointSize * devicePixelRatio;
    this.marks.push(batch);
  }

  supportLines(model) {
    return this.support.flatMap(({ image_name, point3D_id }) => {
      const center = findImage(model, image_name)?.center;
      const index = pointIndex(model, point3D_id);
      if (!center || index < 0) return [];
      return [...subtract(center, model.origin), ...pointPlace(model, index)];
    });
  }

  suspectPlaces(model) {
    const ids = this.levels[this.level]?.point3D_ids ??
      (this.mode === 'verdict' ? this.wrongPoints : []);
    return ids.map((id) => pointIndex(model, id)).filter((index) => index >= 0)
      .flatMap((index) => pointPlace(model, index));
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
      this.select({ imageName: posedImages(model)[image.index].name });
    } else if (point) {
      this.select({ pointId: model.points.ids[point.index], modelIndex: i });
    } else {
      this.select({});
    }
  }

  // { imageName }, { pointId, modelIndex }, both, or {} for nothing.
  select(selected) {
    this.selected = selected;
    const { imageName, pointId } = selected;
    const close = () => this.select({});
    const panels = [];
    if (imageName !== undefined) {
      panels.push(imagePanel(imageName, this.models, this.labels, close));
    }
    if (pointId !== undefined) {
      const known = (_, i) => this.knowsPoint(i);
      panels.push(pointPanel(pointId, this.models.filter(known),
        this.labels.filter(known), close));
    }
    this.panels.replaceChildren(...panels);
    this.updateMarks();
    this.redraw();
  }

  // The same, and the page scrolls to it: at once for those who want no motion.
  show(selected) {
    this.select(selected);
    const { matches } = matchMedia('(prefers-reduced-motion: reduce)');
    byId('scene').scrollIntoView({ behavior: matches ? 'instant' : 'smooth' });
  }
}

// An eye that turns around a target: drag to turn; drag with the right button,
// with Shift or with two fingers to shift; wheel or pinch to come closer.

import {
  add, cross, dot, lookAt, multiply, norm, normalized, perspective, scale,
  subtract,
} from './vectors.js';

const kFieldOfView = 0.8;  // radians, across the smaller side of the canvas
const kTurn = 0.006;  // radians per CSS pixel
const kClickSlack = 5;  // CSS pixels

// The unit vector across `up` that is nearest to `direction`; any if that is
// along `up`.
function across(up, direction) {
  const level = (a) => subtract(a, scale(up, dot(a, up)));
  const wished = level(direction);
  if (norm(wished) > 1e-6 * norm(direction)) return normalized(wished);
  return normalized(level(Math.abs(up[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0]));
}

export class Orbit {
  // `front`: a direction from the target, near which to begin.
  constructor({ target, distance, up, front }) {
    this.home = { target, distance };
    this.up = up;
    this.east = across(up, front);
    this.north = cross(up, this.east);
    this.reset();
  }

  reset() {
    Object.assign(this, this.home, { yaw: 0.5, pitch: 0.4 });
  }

  // The eye's axes in the world.
  axes() {
    const level = add(scale(this.east, Math.cos(this.yaw)),
      scale(this.north, Math.sin(this.yaw)));
    const back = add(scale(level, Math.cos(this.pitch)),
      scale(this.up, Math.sin(this.pitch)));
    const right = normalized(cross(this.up, level));
    return { right, up: cross(back, right), back };
  }

  viewProjection(aspect) {
    const { right, up, back } = this.axes();
    const eye = add(this.target, scale(back, this.distance));
    const vertical = 2 * Math.atan(
      Math.tan(kFieldOfView / 2) / Math.min(1, aspect));
    return multiply(
      perspective(vertical, aspect, this.distance / 100,
        this.distance * 100),
      lookAt(eye, right, up, back));
  }

  turn(dx, dy) {
    this.yaw -= kTurn * dx;
    this.pitch = Math.min(1.55, Math.max(-1.55, this.pitch + kTurn * dy));
  }

  // By pixels of a canvas whose smaller side is `side` pixels long.
  shift(dx, dy, side) {
    const { right, up } = this.axes();
    const size = 2 * this.distance * Math.tan(kFieldOfView / 2) / side;
    this.target = add(this.target,
      add(scale(right, -dx * size), scale(up, dy * size)));
  }

  zoom(factor) {
    const { distance } = this.home;
    this.distance = Math.min(distance * 50,
      Math.max(distance / 2000, this.distance * factor));
  }
}

// Has pointers, wheel and keys on `canvas` move the orbit; `onClick` gets CSS
// pixels from the canvas' corner.
export function attachControls(canvas, orbit, { onChange, onClick }) {
  const pointers = new Map();
  let travelled = 0;

  const side = () => Math.min(canvas.clientWidth, canvas.clientHeight);
  const span = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };

  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    travelled = pointers.size === 1 ? 0 : Infinity;
  });

  canvas.addEventListener('pointermove', (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last.x;
    const dy = event.clientY - last.y;
    const spanBefore = pointers.size === 2 ? span() : 0;
    Object.assign(last, { x: event.clientX, y: event.clientY });
    travelled += Math.hypot(dx, dy);
    if (pointers.size === 2) {
      orbit.shift(dx / 2, dy / 2, side());
      orbit.zoom(spanBefore / Math.max(1, span()));
    } else if (event.buttons & 6 || event.shiftKey) {
      orbit.shift(dx, dy, side());
    } else {
      orbit.turn(dx, dy);
    }
    onChange();
  });

  canvas.addEventListener('pointerup', (event) => {
    if (pointers.delete(event.pointerId) && travelled < kClickSlack) {
      const box = canvas.getBoundingClientRect();
      onClick(event.clientX - box.left, event.clientY - box.top);
    }
  });
  canvas.addEventListener('pointercancel', (event) =>
    pointers.delete(event.pointerId));
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());

  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    orbit.zoom(Math.exp(0.001 * event.deltaY * (event.deltaMode ? 30 : 1)));
    onChange();
  }, { passive: false });

  const keys = {
    ArrowLeft: () => orbit.turn(-30, 0), ArrowRight: () => orbit.turn(30, 0),
    ArrowUp: () => orbit.turn(0, -30), ArrowDown: () => orbit.turn(0, 30),
    '+': () => orbit.zoom(0.85), '-': () => orbit.zoom(1 / 0.85),
  };
  canvas.addEventListener('keydown', (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
    onChange();
  });
}

// Charts as SVG: a frame with axes, and scales that map data into it.

import { html, svg } from './dom.js';

const kWidth = 440;
const kMargin = { left: 50, right: 12, top: 8, bottom: 36 };

function linearTicks([low, high]) {
  const rough = (high - low) / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= rough) * power;
  const ticks = [];
  for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-9); ++k) {
    ticks.push(Number((k * step).toPrecision(12)));
  }
  return ticks;
}

export function linear(low, high) {
  const domain = high > low ? [low, high] : [low, low + 1];
  return {
    unit: (value) => (value - domain[0]) / (domain[1] - domain[0]),
    ticks: linearTicks(domain),
  };
}

// Ticks at powers of ten; at 1, 2 and 5 times those if they are too few.
export function logarithmic(low, high) {
  const domain = high > low ? [low, high] : [low, low * 10];
  const ticks = [];
  const decades = Math.log10(domain[1] / domain[0]);
  for (let k = Math.floor(Math.log10(domain[0]));
    10 ** k <= domain[1]; ++k) {
    for (const factor of decades < 3 ? [1, 2, 5] : [1]) {
      const tick = Number((factor * 10 ** k).toPrecision(12));
      if (tick >= domain[0] && tick <= domain[1]) ticks.push(tick);
    }
  }
  return {
    unit: (value) => Math.log(Math.max(value, domain[0]) / domain[0]) /
      Math.log(domain[1] / domain[0]),
    // A narrow domain holds no such tick; its linear ones do.
    ticks: ticks.length >= 2 ? ticks : linearTicks(domain),
  };
}

function tickText(value) {
  return value >= 1e4 ? value.toLocaleString('en-US', { notation: 'compact' }) :
    String(value);
}

// An empty chart. `at(x, y)` is where data lie in it; `add` puts shapes there.
export function chart({ caption, legend, x, y, xName, yName, height = 250,
  width = kWidth }) {
  const inner = {
    width: width - kMargin.left - kMargin.right,
    height: height - kMargin.top - kMargin.bottom,
  };
  const toX = (value) => kMargin.left + inner.width * x.unit(value);
  const toY = (value) => kMargin.top + inner.height * (1 - y.unit(value));
  const bottom = kMargin.top + inner.height;
  const root = svg('svg', {
    viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': caption,
  });
  for (const tick of y.ticks) {
    root.append(
      svg('path', {
        class: 'grid', d: `M${kMargin.left} ${toY(tick)}h${inner.width}`,
      }),
      svg('text', {
        x: kMargin.left - 6, y: toY(tick) + 4, 'text-anchor': 'end',
      }, tickText(tick)));
  }
  for (const tick of x.ticks) {
    root.append(
      svg('path', { class: 'axis', d: `M${toX(tick)} ${bottom}v4` }),
      svg('text', { x: toX(tick), y: bottom + 16, 'text-anchor': 'middle' },
        tickText(tick)));
  }
  root.append(
    svg('path', {
      class: 'axis',
      d: `M${kMargin.left} ${kMargin.top}V${bottom}h${inner.width}`,
    }),
    svg('text', {
      x: kMargin.left + inner.width / 2, y: height - 4, 'text-anchor': 'middle',
    }, xName),
    svg('text', {
      x: 0, y: 0, 'text-anchor': 'middle',
      transform: `translate(10 ${kMargin.top + inner.height / 2}) rotate(-90)`,
    }, yName));
  const keys = legend.map(([name, text]) =>
    html('span', { class: `key ${name}` }, text));
  return {
    figure: html('figure', {}, html('figcaption', {}, caption),
      html('div', { class: 'legend' }, ...keys), root),
    at: (dataX, dataY) => [toX(dataX), toY(dataY)],
    bottom,
    add: (...shapes) => root.append(...shapes),
  };
}

export function polyline(places) {
  return 'M' + places.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`)
    .join('L');
}

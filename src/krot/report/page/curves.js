// The distribution of the errors, of both models in one chart.

import { chart, linear, logarithmic, polyline } from './axes.js';
import { svg } from './dom.js';

const kNames = ['before', 'after'];

function legendOf(labels) {
  return kNames.map((name, i) => [name, labels[i]]);
}

function binEdge(histogram, bin) {
  return 10 ** (histogram.min_exponent + bin / histogram.bins_per_decade);
}

function firstFilledBin(histograms) {
  const bins = histograms.map(({ counts }) =>
    counts.findIndex((count) => count > 0));
  return Math.max(0, Math.min(...bins.filter((bin) => bin >= 0)));
}

export function histogramChart(models, labels) {
  const histograms = models.map((model) => model.histogram);
  const begin = firstFilledBin(histograms);
  const end = Math.max(begin + 1,
    ...histograms.map(({ counts }) => counts.length));
  const highest = histograms.reduce((most, { counts }) =>
    counts.reduce((a, b) => Math.max(a, b), most), 1);
  const { figure, at, bottom, add } = chart({
    caption: 'Observations by error',
    legend: legendOf(labels),
    x: logarithmic(binEdge(histograms[0], begin), binEdge(histograms[0], end)),
    y: linear(0, highest),
    xName: 'error, px (bins of equal ratio)',
    yName: 'observations',
  });
  histograms.forEach((histogram, i) => {
    const places = [];
    for (let bin = begin; bin < histogram.counts.length; ++bin) {
      const count = histogram.counts[bin];
      places.push(at(binEdge(histogram, bin), count),
        at(binEdge(histogram, bin + 1), count));
    }
    if (places.length === 0) return;
    const outline = polyline([[places[0][0], bottom], ...places,
      [places.at(-1)[0], bottom]]);
    add(svg('path', { class: `${kNames[i]} area`, d: outline }),
      svg('path', { class: `${kNames[i]} line`, d: outline }));
  });
  return figure;
}

// How many observations have an error above x. A start far above the result
// is cut off, so that the result can be seen.
export function tailChart(models, labels) {
  const maxima = models.map(({ tail }) => tail[0]?.[1] ?? 0);
  const right = Math.min(Math.max(...maxima), 3 * Math.min(...maxima)) || 1;
  const most = Math.max(2, ...models.map(({ tail }) => tail.at(-1)?.[0] ?? 0));
  const isCut = Math.max(...maxima) > right;
  const { figure, at, bottom, add } = chart({
    caption: 'Observations with an error above x' + (isCut ?
      `; one curve goes on to ${Math.max(...maxima).toFixed(2)} px` : ''),
    legend: legendOf(labels),
    x: linear(0, right * 1.04),
    y: logarithmic(1, most),
    xName: 'error, px',
    yName: 'observations above',
  });
  models.forEach(({ tail }, i) => {
    const seen = tail.filter(([, error]) => error <= right * 1.04);
    if (seen.length === 0) return;
    const places = seen.map(([rank, error]) => at(error, rank));
    const start = isCut && maxima[i] > right ? [] : [[places[0][0], bottom]];
    add(svg('path', {
      class: `${kNames[i]} line`, d: polyline([...start, ...places]),
    }));
  });
  return figure;
}

// The largest error of every image, in the order of the second model's.
export function imagesChart(pairs, labels, onSelect) {
  const largest = pairs.reduce((most, { before, after }) => Math.max(most,
    before?.pixel_error.max ?? 0, after.pixel_error.max ?? 0), 0);
  const smallest = pairs.reduce((least, { before, after }) => Math.min(least,
    before?.pixel_error.max ?? least, after.pixel_error.max ?? least), largest);
  const isWide = smallest > 0 && largest > 10 * smallest;
  const { figure, at, add } = chart({
    caption: 'Largest error of every image, by rank; click one to see it above',
    legend: legendOf(labels),
    x: linear(0, pairs.length),
    y: isWide ? logarithmic(smallest * 0.9, largest * 1.1) :
      linear(0, largest * 1.05 || 1),
    xName: 'images',
    yName: 'px',
    width: 900,
    height: 260,
  });
  const radius = Math.max(1.2, Math.min(4, 300 / pairs.length));
  pairs.forEach((pair, rank) => kNames.forEach((name) => {
    const image = pair[name];
    if (!image || image.pixel_error.max === null) return;
    const [cx, cy] = at(rank + 0.5, image.pixel_error.max);
    add(svg('circle', {
      class: `${name} dot`, cx: cx.toFixed(1), cy: cy.toFixed(1), r: radius,
      onclick: () => onSelect(image.name),
    }, svg('title', {},
      `${image.name}: ${image.pixel_error.max.toFixed(4)} px`)));
  }));
  return figure;
}

// The buttons and sliders above the 3D view.

import { errorGradient } from './colors.js';
import { html } from './dom.js';
import { count, counted, pixels } from './format.js';

// One of `choices`, [value, text] each.
function choice(name, choices, value, onChange) {
  return html('fieldset', {}, ...choices.map(([option, text]) => {
    const input = html('input', {
      type: 'radio', name, value: option, onchange: () => onChange(option),
    });
    input.checked = option === value;
    return html('label', {}, input, text);
  }));
}

function checkbox(text, value, onChange) {
  const input = html('input', {
    type: 'checkbox', onchange: () => onChange(input.checked),
  });
  input.checked = value;
  return html('label', {}, input, ` ${text}`);
}

function slider(text, [min, max, step], value, onChange) {
  const input = html('input', {
    type: 'range', min, max, step, value,
    oninput: () => onChange(Number(input.value)),
  });
  return html('label', {}, `${text} `, input);
}

// Without which observations every error is below what. The page around this one
// may choose, too.
function levelSlider(levels, onChange) {
  const output = html('output', {});
  const choose = (level) => {
    const { num_removed: removed, max_error: error } = levels[level];
    output.value = `${counted(removed, 'observation')}: ${pixels(error)} px`;
    onChange(level);
  };
  const label = slider('Without', [0, levels.length - 1, 1], 0, choose);
  label.append(' ', output);
  addEventListener('message', ({ data }) => {
    const level = Number(data?.level);
    if (!levels[level]) return;
    label.querySelector('input').value = level;
    choose(level);
  });
  choose(0);
  return label;
}

function errorScale(top) {
  return html('div', { class: 'scale' },
    html('div', { class: 'bar', style: `background: ${errorGradient()}` }),
    html('div', { class: 'ends' }, html('span', {}, '0'),
      html('span', {}, `${top.toFixed(2)} px and more`)));
}

export function viewerControls(viewer) {
  const scale = errorScale(viewer.top());
  viewer.stage.append(scale);
  const set = (property) => (value) => {
    viewer[property] = value;
    scale.hidden = viewer.mode !== 'error' || viewer.shown === 'both';
    viewer.update();
  };
  scale.hidden = true;
  const controls = [
    choice('model', [['before', viewer.labels[0]],
      ['after', viewer.labels[1]], ['both', 'Both']], viewer.shown,
    set('shown')),
    choice('color', [...(viewer.verdicts ? [['verdict', 'Verdicts']] : []),
      ['rgb', 'Colours'], ['error', 'Errors']], viewer.mode, set('mode')),
    slider('Points', [1, 8, 0.5], viewer.pointSize, set('pointSize')),
  ];
  if (viewer.support.length > 0) {
    controls.push(checkbox('Support', viewer.hasSupport, set('hasSupport')));
  }
  if (viewer.levels.length > 0) {
    controls.push(levelSlider(viewer.levels, set('level')));
  }
  controls.push(html('button', {
    type: 'button',
    onclick: () => {
      viewer.orbit.reset();
      viewer.redraw();
    },
  }, 'Reset view'));
  return html('div', { class: 'controls' }, ...controls);
}

// How to use the view, and what it leaves out.
export function viewerNotes(models) {
  const [shown, all] = [models[1].points.num, models[1].num_points];
  const thinned = shown < all ?
    ` ${count(shown)} of ${count(all)} points are drawn, those with the ` +
    'largest errors among them; all other numbers are of all points.' : '';
  return html('p', { class: 'note' },
    'Drag to turn; right button, Shift or two fingers to shift; wheel or ' +
    'pinch to zoom; click a camera or a point for its numbers. Errors: the ' +
    'largest of the point or camera.' + thinned);
}

// The page: a model is given, a task is chosen, its result is shown.

import { byId } from '../krot/report/page/dom.js';
import { count, pixels } from '../krot/report/page/format.js';
import { modelFromDrop, modelFromFiles } from './input.js';
import { showBounds, showResult, textOf } from './result.js';
import { Runner } from './runner.js';
import { analyze, check, compare, filter, judge, solve } from './tasks.js';

// Measured on sparse models from the web: docs/browser.md.
const kSecondsPerObservation = 6e-5;
const kMostObservations = 4e6;

const runner = new Runner(byId('krot-wasm').textContent,
  byId('krot-worker').textContent);
let model = null;

// Runs a task in sight; null if it was cancelled.
async function run(task) {
  const started = performance.now();
  const showTime = () => {
    byId('elapsed').textContent =
      `${((performance.now() - started) / 1000).toFixed(0)} s`;
  };
  byId('run-title').textContent = task.title;
  byId('line').textContent = '';
  byId('run').hidden = false;
  byId('result').hidden = true;
  const focused = document.activeElement;  // what is inert loses it
  byId('tasks').inert = true;
  byId('drop').inert = true;
  showTime();
  const heartbeat = setInterval(showTime, 500);
  try {
    return await runner.run({ ...task,
      onLine: (line) => { byId('line').textContent = line; } });
  } finally {
    clearInterval(heartbeat);
    byId('run').hidden = true;
    byId('tasks').inert = false;
    byId('drop').inert = false;
    focused.focus();
  }
}

async function runAndShow(task) {
  const result = await run(task);
  if (!result) return;
  await showResult(result, task.verdict);
  const profile = textOf(result.files, 'profile.json');
  showBounds(profile && JSON.parse(profile),
    (bound) => runAndShow(filter(model, bound)));
}

function modelSentence(report) {
  const { num_images: images, num_points: points,
    num_observations: observations } = report.colmap;
  const time = Math.max(1, Math.round(observations * kSecondsPerObservation));
  const cost = observations > kMostObservations ?
    'more than a browser is likely to hold: take the command line' :
    `a solve takes about ${time} s here`;
  return `${count(images)} images, ${count(points)} points, ` +
    `${count(observations)} observations; largest error ${
      pixels(report.pixel_error.max)} px; ${cost}.`;
}

function say(sentence, isWrong = false) {
  byId('model').textContent = sentence;
  byId('model').classList.toggle('wrong', isWrong);
}

async function take(reading) {
  byId('tasks').hidden = true;
  byId('result').hidden = true;
  say('Reading …');
  try {
    model = await reading;
    const result = await run({ title: 'Reading the model', ...analyze(model) });
    if (!result) return say('');
    const report = textOf(result.files, 'report.json');
    if (!report) return say(result.failure ?? result.last, true);
    say(modelSentence(JSON.parse(report)));
    byId('tasks').hidden = false;
  } catch (error) {
    say(error.message, true);
  }
}

function onDrop(event) {
  event.preventDefault();
  byId('drop').classList.remove('over');
  if (byId('drop').inert) return;  // a command runs
  take(modelFromDrop(event.dataTransfer, 'model/'));
}

function onSubmit(id, task) {
  byId(id).addEventListener('submit', async (event) => {
    event.preventDefault();
    try {
      await runAndShow(await task(byId(id).elements));
    } catch (error) {
      say(error.message, true);
    }
  });
}

for (const id of ['choose-folder', 'choose-files']) {
  byId(id).addEventListener('change', () => {
    take(modelFromFiles(byId(id).files, 'model/'));
    byId(id).value = '';  // so that the same may be chosen again, mended
  });
}
document.addEventListener('dragover', (event) => {
  event.preventDefault();
  byId('drop').classList.add('over');
});
document.addEventListener('dragleave', () =>
  byId('drop').classList.remove('over'));
document.addEventListener('drop', onDrop);
byId('cancel').addEventListener('click', () => runner.cancel());
onSubmit('judge', () => judge(model));
onSubmit('solve', () => solve(model));
onSubmit('filter', ({ bound }) =>
  filter(model, bound.value === '' ? null : Number(bound.value)));
onSubmit('check', async ({ certificate }) =>
  check(model, new Uint8Array(await certificate.files[0].arrayBuffer())));
onSubmit('compare', async ({ other }) =>
  compare(model, await modelFromFiles(other.files, 'other/')));

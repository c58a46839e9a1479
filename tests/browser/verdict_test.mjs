// node --experimental-default-type=module verdict_test.mjs KROT
//
// Every task of the page gives a sentence, whatever the model: its command is run
// by the native KROT, and the sentence made of the report that it writes.

import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

import { analyze, check, compare, filter, judge, solve } from
  '../../src/browser/tasks.js';

const krot = path.resolve(process.argv[2]);
const scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'krot-'));
process.on('exit', () => fs.rmSync(scratch, { recursive: true }));

function run(folder, args) {
  const { status, stderr } = spawnSync(krot, args,
    { cwd: folder, encoding: 'utf8' });
  assert.equal(status, 0, `${args.join(' ')}: ${stderr}`);
}

// A folder of its own, with the model in it.
function makeScene(name, options) {
  const folder = path.join(scratch, name);
  fs.mkdirSync(path.join(folder, 'proof'), { recursive: true });
  run(folder, ['model_synthesizer', '--output_path', 'model',
    '--Scene.num_frames', '8', '--Scene.num_points', '60', ...options]);
  return folder;
}

function reportOf(folder, task) {
  for (const output of task.outputs) {
    fs.rmSync(path.join(folder, output), { recursive: true, force: true });
  }
  run(folder, task.args);
  return JSON.parse(fs.readFileSync(path.join(folder, 'report.json')));
}

function sentenceOf(folder, task) {
  return task.verdict(reportOf(folder, task));
}

const scenes = {
  noisy: ['--Scene.pixel_noise', '1', '--Scene.outlier_ratio', '0.01'],
  'free of errors': [],
};
for (const [name, options] of Object.entries(scenes)) {
  const folder = makeScene(name, options);
  assert.equal(reportOf(folder, analyze([])).colmap.num_images, 8);
  const solved = sentenceOf(folder, solve([]));
  assert.match(solved, name === 'noisy' ?
    /^The largest error fell from [\d.]+ px to [\d.]+ px\. Maximum .*, proved/ :
    /^(Every error is zero up to rounding|The largest error stayed)/);
  if (name === 'noisy') {
    fs.renameSync(path.join(folder, 'certificate.json'),
      path.join(folder, 'proof/certificate.json'));
    assert.match(sentenceOf(folder, check([], null)),
      /^The certificate holds: .* at least [\d.]+ px; this model has [\d.]+ px/);
    sentenceOf(folder, filter([], 2));
    fs.renameSync(path.join(folder, 'conflicts.json'),
      path.join(folder, 'proof/certificate.json'));
    assert.match(sentenceOf(folder, check([], null)),
      /^The conflicts hold: .* at least [\d,]+ observations? must go/);
  }
  assert.match(sentenceOf(folder, filter([], 2)),
    /^Without [\d,]+ of [\d,]+ observations all others are within 2\.00 px/);
  if (name === 'free of errors') {
    assert.match(sentenceOf(folder, filter([], null)),
      /^No observation is called wrong, and the model is the one that was read/);
  }
  assert.match(sentenceOf(folder, judge([])), name === 'noisy' ?
    /^[\d,]+ of [\d,]+ observations (is|are) wrong, and no image is: / :
    /^Nothing is wrong: all [\d,]+ observations of 8 images agree within noise/);
  fs.cpSync(path.join(folder, 'result'), path.join(folder, 'other'),
    { recursive: true });
  assert.match(sentenceOf(folder, compare([], [])),
    /^The largest error of model 1 is [\d.]+ px, of model 2 [\d.]+ px\.$/);
}

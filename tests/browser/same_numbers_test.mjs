// node same_numbers_test.mjs BUILD_WASM KROT MODEL...
//
// What krot.wasm finds is what the native KROT finds, but for rounding, and KROT
// accepts its certificates. KROT_REAL_MODELS: a folder with more models.

import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

import {
  accepts, solveByWasm, solveNatively,
} from '../../src/browser/node_krot.mjs';

const kRealModels = ['crane8_txt', 'task41_rigs_frames', 'fountain11', 'south128'];
// The lower bound is as good as unique, and the lowest maximum is known to the
// gap between the two; the least squares within it to the finish's tolerance.
const gap = (report) => report.finish.lowest_cost / report.lower_bound - 1;
const kFigures = {
  'lowest maximum': [(report) => report.finish.lowest_cost,
    (a, b) => Math.max(gap(a), gap(b), 1e-9)],
  'lower bound': [(report) => report.lower_bound, () => 1e-9],
  RMS: [(report) => report.pixel_error.after.rms, () => 1e-5],
};

const [build, krot, ...models] = process.argv.slice(2);
const folder = process.env.KROT_REAL_MODELS;
if (folder) {
  models.push(...kRealModels.map((name) => path.join(folder, name))
    .filter(fs.existsSync));
}
const scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'krot-'));
const [here, native] = ['wasm', 'native'].map((name) => path.join(scratch, name));
const reportIn = (folder) =>
  JSON.parse(fs.readFileSync(path.join(folder, 'report.json')));

let isWrong = false;
for (const model of models) {
  await solveByWasm(build, model, here);
  solveNatively(krot, model, native);
  const [a, b] = [reportIn(here), reportIn(native)];
  const said = Object.entries(kFigures).map(([name, [figure, tolerance]]) => {
    const difference = Math.abs(figure(a) / figure(b) - 1);
    const isFar = !(difference <= tolerance(a, b));
    isWrong ||= isFar;
    return `${name} ${difference.toExponential(1)}${isFar ? ', TOO FAR' : ''}`;
  });
  const isAccepted = accepts(krot, here);
  isWrong ||= !isAccepted;
  console.log(`${path.basename(model)}: relative differences: ${
    said.join(', ')}; certificate ${isAccepted ? 'accepted' : 'REFUSED'}`);
}
fs.rmSync(scratch, { recursive: true });
process.exit(isWrong ? 1 : 0);

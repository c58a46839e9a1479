// node measure.mjs BUILD_WASM KROT MODEL...
//
// Solves each model by BUILD_WASM/krot.wasm and by the native KROT on one thread,
// three times in turn, and prints the medians, wall clock with reading and writing.

import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

import { solveByWasm, solveNatively } from './node_krot.mjs';

const [build, krot, ...models] = process.argv.slice(2);
const scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'krot-'));
const here = path.join(scratch, 'wasm');
const native = path.join(scratch, 'native');

const median = (values) => values.sort((a, b) => a - b)[1].toFixed(2);
console.log('| model | observations | WebAssembly, s | native, one thread, s |');
console.log('|---|---:|---:|---:|');
for (const model of models) {
  const times = { here: [], native: [] };
  for (let n = 0; n < 3; ++n) {
    times.here.push(await solveByWasm(build, model, here));
    times.native.push(solveNatively(krot, model, native));
  }
  const report = JSON.parse(fs.readFileSync(path.join(here, 'report.json')));
  console.log(`| ${path.basename(model)} | ${
    report.num_observations.toLocaleString('en')} | ${
    median(times.here)} | ${median(times.native)} |`);
}
fs.rmSync(scratch, { recursive: true });

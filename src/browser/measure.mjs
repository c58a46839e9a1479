// node measure.mjs BUILD_WASM KROT MODEL...
//
// Solves each model by BUILD_WASM/krot.wasm and by the native KROT on one thread,
// three times in turn, and prints the medians, wall clock with reading and writing,
// and the memory of the last.

import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

import { solveByWasm, solveNatively } from './node_krot.mjs';

const [build, krot, ...models] = process.argv.slice(2);
const scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'krot-'));
const here = path.join(scratch, 'wasm');
const native = path.join(scratch, 'native');

const median = (values) => values.sort((a, b) => a - b)[1].toFixed(2);
const megabytes = (bytes) => (bytes / 1e6).toFixed(0);
console.log('| model | observations | WebAssembly, s | native, one thread, s | ' +
  'WebAssembly, MB | native, MB |');
console.log('|---|---:|---:|---:|---:|---:|');
for (const model of models) {
  const times = { here: [], native: [] };
  const bytes = {};
  for (let n = 0; n < 3; ++n) {
    const [a, b] = [await solveByWasm(build, model, here),
      solveNatively(krot, model, native)];
    times.here.push(a.time);
    times.native.push(b.time);
    Object.assign(bytes, { here: a.bytes, native: b.bytes });
  }
  const report = JSON.parse(fs.readFileSync(path.join(here, 'report.json')));
  console.log(`| ${path.basename(model)} | ${
    report.num_observations.toLocaleString('en')} | ${
    median(times.here)} | ${median(times.native)} | ${
    megabytes(bytes.here)} | ${megabytes(bytes.native)} |`);
}
fs.rmSync(scratch, { recursive: true });

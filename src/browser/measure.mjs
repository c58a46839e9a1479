// node measure.mjs BUILD_WASM KROT MODEL...
//
// Solves each model by BUILD_WASM/krot.wasm and by the native KROT on one thread,
// three times in turn, has KROT check the certificate that the former made, and
// prints the medians, wall clock with reading and writing.

import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import os from 'node:os';
import path from 'node:path';

const [build, krot, ...models] = process.argv.slice(2);
const createKrot = createRequire(import.meta.url)(path.resolve(build, 'krot.js'));
const wasmBinary = fs.readFileSync(path.join(build, 'krot.wasm'));
const scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'krot-'));

function seconds(work) {
  const start = performance.now();
  work();
  return (performance.now() - start) / 1000;
}

// Leaves certificate.json and the model in `scratch`.
async function solveHere(model) {
  const instance = await createKrot({ wasmBinary, print() {}, printErr() {} });
  const { FS } = instance;
  FS.mkdir('model');
  for (const name of fs.readdirSync(model)) {
    const file = path.join(model, name);
    if (fs.statSync(file).isFile()) {
      FS.writeFile(`model/${name}`, fs.readFileSync(file));
    }
  }
  const time = seconds(() => instance.callMain(['solver',
    '--input_path', 'model', '--output_path', 'result',
    '--certificate_path', 'result/certificate.json', '--log_level', '0']));
  fs.rmSync(path.join(scratch, 'result'), { recursive: true, force: true });
  fs.mkdirSync(path.join(scratch, 'result'));
  for (const name of FS.readdir('result').filter((n) => !n.startsWith('.'))) {
    fs.writeFileSync(path.join(scratch, 'result', name),
      FS.readFile(`result/${name}`));
  }
  return time;
}

function solveNatively(model) {
  return seconds(() => execFileSync(krot, ['solver', '--input_path', model,
    '--output_path', path.join(scratch, 'native'), '--overwrite', '1',
    '--certificate_path', path.join(scratch, 'native.json'),
    '--Solver.num_threads', '1', '--log_level', '0']));
}

function check() {
  const result = path.join(scratch, 'result');
  execFileSync(krot, ['certificate_checker', '--input_path', result,
    '--certificate_path', path.join(result, 'certificate.json')]);
}

const median = (values) => values.sort((a, b) => a - b)[1].toFixed(2);
console.log('| model | WebAssembly, s | native, one thread, s |\n|---|---:|---:|');
for (const model of models) {
  const times = { here: [], native: [] };
  for (let n = 0; n < 3; ++n) {
    times.here.push(await solveHere(model));
    times.native.push(solveNatively(model));
  }
  check();
  console.log(`| ${path.basename(model)} | ${median(times.here)} | ${
    median(times.native)} |`);
}
fs.rmSync(scratch, { recursive: true });

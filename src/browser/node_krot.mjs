// Solves a model by krot.wasm in Node.js as by the native command, into folders.

import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';

const kSolve = ['solver', '--input_path', 'model', '--output_path', 'result',
  '--certificate_path', 'certificate.json', '--report_path', 'report.json',
  '--Solver.num_threads', '1', '--log_level', '0'];

function seconds(work) {
  const start = performance.now();
  work();
  return (performance.now() - start) / 1000;
}

// Into `folder`, which is emptied: result/, certificate.json and report.json.
// What it took: seconds, and bytes of memory at the most.
export async function solveByWasm(build, model, folder) {
  const createKrot =
    createRequire(import.meta.url)(path.resolve(build, 'krot.js'));
  const wasmBinary = fs.readFileSync(path.join(build, 'krot.wasm'));
  const instance = await createKrot({ wasmBinary, print() {}, printErr() {} });
  const { FS, callMain } = instance;
  FS.mkdir('model');
  for (const name of fs.readdirSync(model)) {
    const file = path.join(model, name);
    if (fs.statSync(file).isFile()) {
      FS.writeFile(`model/${name}`, fs.readFileSync(file));
    }
  }
  const time = seconds(() => callMain(kSolve));
  fs.rmSync(folder, { recursive: true, force: true });
  fs.mkdirSync(path.join(folder, 'result'), { recursive: true });
  const names = FS.readdir('result').filter((name) => !/^\.+$/.test(name));
  for (const file of ['certificate.json', 'report.json',
    ...names.map((name) => `result/${name}`)]) {
    fs.writeFileSync(path.join(folder, file), FS.readFile(file));
  }
  return { time, bytes: instance.HEAPU8.length };  // it never shrinks
}

// The same by the native command on one thread.
export function solveNatively(krot, model, folder) {
  fs.rmSync(folder, { recursive: true, force: true });
  fs.mkdirSync(folder);
  const args = kSolve.map((word) => word === 'model' ? path.resolve(model) : word);
  const time = seconds(() => execFileSync(path.resolve(krot), args,
    { cwd: folder, stdio: 'ignore' }));
  const report = JSON.parse(fs.readFileSync(path.join(folder, 'report.json')));
  return { time, bytes: report.peak_memory_bytes };
}

// Whether the native command accepts the certificate in `folder` for the model
// there.
export function accepts(krot, folder) {
  try {
    execFileSync(krot, ['certificate_checker',
      '--input_path', path.join(folder, 'result'),
      '--certificate_path', path.join(folder, 'certificate.json')],
    { stdio: 'ignore' });
    return true;
  } catch {
    return false;
  }
}

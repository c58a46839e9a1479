// node make_page.mjs OUTPUT PAGE WASM INSTANCE WORKER SCRIPT STYLE...
//
// Puts all that the page needs into it. The WebAssembly goes in compressed.

import { readFileSync, writeFileSync } from 'node:fs';
import { gzipSync } from 'node:zlib';

const [output, page, wasm, instance, worker, script, ...styles] =
  process.argv.slice(2);
const text = (...files) => files.map((file) => readFileSync(file, 'utf8')).join('\n');

const parts = {
  '/* style */': text(...styles),
  '/* wasm */': gzipSync(readFileSync(wasm), { level: 9 }).toString('base64'),
  '/* worker */': text(instance, worker),
  '/* script */': text(script),
};
let filled = text(page);
for (const [place, part] of Object.entries(parts)) {
  if (/<\/script|<!--/i.test(part)) {
    throw new Error(`What goes to ${place} would end or change its element`);
  }
  filled = filled.replace(place, () => part);
}
writeFileSync(output, filled);

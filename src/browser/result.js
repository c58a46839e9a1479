// What a command gave: a sentence, its table, its report page, files to take.

import JSZip from 'jszip';

import { byId, html } from '../krot/report/page/dom.js';
import { counted, pixels } from '../krot/report/page/format.js';

let urls = [];

function urlOf(parts, type) {
  urls.push(URL.createObjectURL(new Blob(parts, { type })));
  return urls.at(-1);
}

export function textOf(files, path) {
  const file = files?.find((candidate) => candidate.path === path);
  return file ? new TextDecoder().decode(file.bytes) : null;
}

async function zipOf(files) {
  const zip = new JSZip();
  for (const { path, bytes } of files) zip.file(path, bytes);
  return zip.generateAsync({ type: 'uint8array', compression: 'DEFLATE' });
}

function download(name, bytes) {
  return html('a', { href: urlOf([bytes], 'application/octet-stream'),
    download: name }, name);
}

async function downloads(files) {
  const model = files.filter(({ path }) => path.startsWith('result/'));
  const others = files.filter(({ path }) => !path.startsWith('result/'));
  return [
    ...(model.length > 0 ? [download('result.zip', await zipOf(model))] : []),
    ...others.map(({ path, bytes }) => download(path, bytes)),
  ];
}

// The levels of an error profile under a slider; onTake gets a bound.
export function showBounds(profile, onTake) {
  const levels = profile?.levels ?? [];
  byId('bounds').hidden = levels.length === 0;
  if (levels.length === 0) return;
  const slider = byId('level');
  const show = () => {
    const level = levels[slider.value];
    byId('removed').value = counted(level.num_removed, 'observation') +
      (level.num_must_go ? ` (at least ${level.num_must_go} must go)` : '');
    byId('bound').value = `${pixels(level.max_error)} px`;
    // The next digit: the bound itself must be within reach.
    byId('take').onclick = () => onTake(level.max_error * (1 + 1e-6));
    // The report marks the points in 3D.
    byId('report').contentWindow.postMessage({ level: slider.value }, '*');
  };
  slider.max = levels.length - 1;
  slider.value = profile.elbow ?? 0;
  slider.oninput = show;
  byId('report').onload = show;
  show();
}

// What it says in one sentence, and whether something is wrong.
function conclude({ code, files, failure, last }, verdict) {
  if (failure) return { sentence: `${failure}; ${last}`, isWrong: true };
  if (code !== 0) return { sentence: last, isWrong: true };
  const report = JSON.parse(textOf(files, 'report.json'));
  return { sentence: verdict(report), isWrong: false };
}

// `result` as Runner.run gives it, of a task with that verdict.
export async function showResult(result, verdict) {
  urls.forEach((url) => URL.revokeObjectURL(url));
  urls = [];
  const { text = '', files = [] } = result;
  const page = files.find(({ path }) => path === 'page.html');
  const { sentence, isWrong } = conclude(result, verdict);
  byId('sentence').textContent = sentence;
  byId('sentence').classList.toggle('wrong', isWrong);
  byId('table').textContent = text;
  byId('table').parentElement.hidden = text === '';
  byId('downloads').replaceChildren(...await downloads(files));
  byId('report').hidden = !page;
  byId('report').src = page ? urlOf([page.bytes], 'text/html') : 'about:blank';
  byId('result').hidden = false;
}

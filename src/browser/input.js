// Models as the user gives them: a dropped folder, chosen files, a zip.

import JSZip from 'jszip';

const kModelFile =
  /(^|\/)(cameras|images|points3D|rigs|frames)\.(bin|txt)$|(^|\/)project\.ini$/;

function named(name, blob) {
  return { name, read: async () => new Uint8Array(await blob.arrayBuffer()) };
}

async function unzip(blob) {
  const zip = await JSZip.loadAsync(blob);
  return Object.values(zip.files).filter((entry) => !entry.dir).map((entry) => ({
    name: entry.name, read: () => entry.async('uint8array'),
  }));
}

// Of files and folders of a drop; its items must be read before the event ends.
function entriesOf(transfer) {
  return [...transfer.items].filter((item) => item.kind === 'file').map((item) =>
    item.webkitGetAsEntry?.() ?? item.getAsFile()).filter((entry) => entry);
}

async function walk(entry, folder = '') {
  if (entry instanceof File) return [named(entry.name, entry)];
  const name = folder + entry.name;
  if (entry.isFile) {
    const file = await new Promise((done, fail) => entry.file(done, fail));
    return [named(name, file)];
  }
  const reader = entry.createReader();
  const found = [];
  for (;;) {
    const some = await new Promise((done, fail) =>
      reader.readEntries(done, fail));
    if (some.length === 0) return found;
    for (const child of some) found.push(...await walk(child, `${name}/`));
  }
}

// The files of the one model among them, under `folder`. Throws an Error with a
// sentence if there is none or more than one.
async function modelOf(files, folder) {
  const unpacked = [];
  for (const file of files) {
    if (/\.zip$/i.test(file.name)) {
      unpacked.push(...await unzip(await file.read()));
    } else {
      unpacked.push(file);
    }
  }
  const found = unpacked.filter(({ name }) => kModelFile.test(name));
  const folderOf = (name) => name.slice(0, name.lastIndexOf('/') + 1);
  const folders = [...new Set(found.filter(({ name }) =>
    /cameras\.(bin|txt)$/.test(name)).map(({ name }) => folderOf(name)))];
  if (folders.length === 0) {
    throw new Error(`${files.map(({ name }) => name).slice(0, 3).join(', ') ||
      'Nothing'}: found no cameras.bin or cameras.txt, expected the files of a ` +
      'COLMAP sparse model');
  }
  if (folders.length > 1) {
    throw new Error(`Found ${folders.length} models (${folders.join(', ')}), ` +
      'expected one: drop its own folder');
  }
  return Promise.all(found.filter(({ name }) => folderOf(name) === folders[0])
    .map(async ({ name, read }) => ({
      path: folder + name.slice(folders[0].length), bytes: await read(),
    })));
}

export async function modelFromDrop(transfer, folder) {
  const entries = entriesOf(transfer);
  const files = await Promise.all(entries.map((entry) => walk(entry)));
  return modelOf(files.flat(), folder);
}

export function modelFromFiles(files, folder) {
  return modelOf([...files].map((file) =>
    named(file.webkitRelativePath || file.name, file)), folder);
}

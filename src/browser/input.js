// Models as the user gives them: a dropped folder, chosen files, a zip.

import JSZip from 'jszip';

const kModelFile =
  /(^|\/)(cameras|images|points3D|rigs|frames)\.(bin|txt)$|(^|\/)project\.ini$/;

function named(name, blob) {
  return { name, read: async () => new Uint8Array(await blob.arrayBuffer()) };
}

async function unzip({ name, read }) {
  const zip = await JSZip.loadAsync(await read()).catch(() => {
    throw new Error(`${name}: found no zip archive, or a damaged one`);
  });
  return Object.values(zip.files).filter((entry) => !entry.dir).map((entry) => ({
    name: entry.name, read: () => entry.async('uint8array'),
  }));
}

// Of files and folders of a drop; its items must be read before the event ends.
// From file://, Chromium opens no file of an entry; others have no handles.
function entriesOf(transfer) {
  return Promise.all([...transfer.items].filter(({ kind }) => kind === 'file')
    .map((item) => item.getAsFileSystemHandle?.() ?? item.webkitGetAsEntry()));
}

// A handle's or an entry's: it alone, or all that the folder holds.
async function fileOf(entry) {
  return entry.getFile?.() ??
    new Promise((done, fail) => entry.file(done, fail));
}

async function childrenOf(entry) {
  const children = [];
  if (entry.values) {
    for await (const child of entry.values()) children.push(child);
    return children;
  }
  const reader = entry.createReader();
  for (;;) {
    const some = await new Promise((done, fail) =>
      reader.readEntries(done, fail));
    if (some.length === 0) return children;
    children.push(...some);
  }
}

async function walk(entry, folder = '') {
  const name = folder + entry.name;
  if (entry.isFile || entry.kind === 'file') {
    return [named(name, await fileOf(entry))];
  }
  const children = await childrenOf(entry);
  return (await Promise.all(children.map((child) =>
    walk(child, `${name}/`)))).flat();
}

// The files of the one model among them, under `folder`. Throws an Error with a
// sentence if there is none or more than one.
async function modelOf(files, folder) {
  const unpacked = [];
  for (const file of files) {
    if (/\.zip$/i.test(file.name)) {
      unpacked.push(...await unzip(file));
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
  const entries = await entriesOf(transfer);
  const files = await Promise.all(entries.map((entry) => walk(entry)));
  return modelOf(files.flat(), folder);
}

export function modelFromFiles(files, folder) {
  return modelOf([...files].map((file) =>
    named(file.webkitRelativePath || file.name, file)), folder);
}

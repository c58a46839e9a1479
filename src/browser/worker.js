// Runs one command of krot in an instance of its own, and ends: files in, lines
// on the way, files out.

function write(FS, { path, bytes }) {
  FS.mkdirTree(path.slice(0, path.lastIndexOf('/')));
  FS.writeFile(path, bytes);
}

// The file at that path, or all files of the folder there.
function collect(FS, path) {
  if (!FS.analyzePath(path).exists) return [];
  if (!FS.isDir(FS.stat(path).mode)) return [{ path, bytes: FS.readFile(path) }];
  return FS.readdir(path).filter((name) => name !== '.' && name !== '..')
    .flatMap((name) => collect(FS, `${path}/${name}`));
}

self.onmessage = async ({ data: { wasm, files, args, outputs } }) => {
  const printed = [];  // warnings among it
  try {
    const krot = await createKrot({
      wasmBinary: wasm,
      print: (line) => printed.push(line),
      printErr: (line) => {
        printed.push(line);
        self.postMessage({ line });
      },
    });
    for (const file of files) write(krot.FS, file);
    const code = krot.callMain(args);
    self.postMessage({ code, text: printed.join('\n'),
      files: outputs.flatMap((path) => collect(krot.FS, path)) });
  } catch (error) {
    self.postMessage({ failure: String(error?.message ?? error) });
  }
};

// Commands in a worker, one at a time.

async function gunzip(base64) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream()
    .pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export class Runner {
  constructor(wasmBase64, workerSource) {
    this.wasm = gunzip(wasmBase64);
    this.url = URL.createObjectURL(
      new Blob([workerSource], { type: 'text/javascript' }));
    this.stop = () => {};
  }

  // What `krot args` gives: its exit code, what it prints, its last line on
  // stderr, and the files at `outputs`; null if it was cancelled. onLine gets
  // every line on stderr.
  async run({ files, args, outputs = [], onLine = () => {} }) {
    const wasm = await this.wasm;
    const worker = new Worker(this.url);
    let last = '';
    const result = await new Promise((resolve) => {
      this.stop = () => resolve(null);
      worker.onerror = (event) => resolve({ failure: event.message });
      worker.onmessage = ({ data }) => {
        if (data.line === undefined) return resolve(data);
        last = data.line;
        onLine(last);
      };
      worker.postMessage({ wasm, files, args, outputs });
    });
    worker.terminate();
    return result && { ...result, last };
  }

  cancel() {
    this.stop();
  }
}

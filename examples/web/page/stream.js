// The files of a capture in chunk files: fetched as its player needs them, whole or as parts of one file.
// In: the player, the number of the capture in it, where the files are, what is played. Out: files in the player; whether there is a picture of a
// time; an error if the player answers no call any more.

// Milliseconds of a frame in which files are read and uploaded.
const SLICE = 6;
// Results of a step of the player with files: `Step` in src/bin/player.rs.
const [NOTHING, FILE] = [0, 2];

// Where files beside the index at an address are.
export function beside(address) {
  return async ({ name }, signal) => {
    const response = await fetch(new URL(name, new URL(address, location.href)), { signal });
    if (!response.ok) throw new Error(`the server answered ${response.status}`);
    return response.arrayBuffer();
  };
}

// The same of files of this device.
export function among(files) {
  return async ({ name }) => {
    const file = files.find((one) => one.name === name);
    if (!file) throw new Error(`there is no ${name}`);
    return file.arrayBuffer();
  };
}

// Fetches bytes `from` to `to` of the file at an address. Returns null if the server sends no parts.
async function part(url, from, to, signal) {
  // A browser's cache would let one request for an address wait for another.
  const response = await fetch(url, { headers: { Range: `bytes=${from}-${to - 1}` }, cache: 'no-store', signal });
  if (response.status === 206) {
    const bytes = await response.arrayBuffer();
    if (bytes.byteLength !== to - from) throw new Error(`the server sent ${bytes.byteLength} of ${to - from} bytes`);
    return bytes;
  }
  response.body?.cancel().catch(() => {});
  if (!response.ok) throw new Error(`the server answered ${response.status}`);
  return null;
}

// The parts of the file at an address, once its server has sent one; null if it sends none.
export async function partsAt(url, signal) {
  if ((await part(url, 0, 1, signal)) === null) return null;
  return async ({ range: [from, to] }, signal) => {
    const bytes = await part(url, from, to, signal);
    if (!bytes) throw new Error('the server sends no parts any more');
    return bytes;
  };
}

// The parts of a file of this device.
export function partsOf(file) {
  return async ({ range: [from, to] }) => file.slice(from, to).arrayBuffer();
}

export class Stream {
  // `read` gives the bytes of a file by its name, or by its range in the file of the index.
  constructor(player, number, read) {
    Object.assign(this, { player, number, read, requests: new Map(), told: null, fault: null });
  }

  // Asks for the files that the player needs next, and ends requests that it does not need any more.
  follow(seconds, velocity, loops) {
    if (this.fault) throw this.fault;
    const plan = this.player.plan(this.number, performance.now() / 1000, seconds, velocity, loops);
    if (!plan) return this.end();
    const { fetch, give_up } = plan;
    plan.free();
    for (const file of give_up) {
      this.requests.get(file)?.abort();
      this.requests.delete(file);
    }
    // A request that fails is no fault: the player asks again. A player that has ended takes no answer.
    for (const file of fetch) this.ask(file).catch((error) => (this.fault = error));
  }

  async ask(file) {
    const own = new AbortController();
    this.requests.set(file, own);
    const [name, range] = [this.player.file_name(this.number, file), this.player.file_range(this.number, file)];
    const bytes = await this.read({ name, range }, own.signal).catch(() => null);
    // Neither the answer to a request that was given up nor its failure counts.
    if (own.signal.aborted) return;
    this.requests.delete(file);
    if (bytes) this.player.receive_file(this.number, file, new Uint8Array(bytes));
    else this.player.fail_file(this.number, file);
  }

  // Reads and uploads files that have been received, for a part of a frame. Returns whether the picture may be another one now.
  work() {
    const start = performance.now();
    let changed = false;
    while (performance.now() - start < SLICE) {
      const step = this.player.step_files();
      if (step === NOTHING) break;
      changed ||= step === FILE;
    }
    return changed;
  }

  has(seconds) {
    return this.player.has_picture(this.number, seconds);
  }

  // Why there may never be a picture of a time: once for each reason.
  obstacle(seconds) {
    const text = this.player.obstacle(this.number, seconds);
    if (!text || text === this.told) return null;
    return (this.told = text);
  }

  end() {
    for (const own of this.requests.values()) own.abort();
    this.requests.clear();
  }
}

// The files of a capture in chunk files: fetched as its player needs them.
// In: the player, the number of the capture in it, where the files are, what is played. Out: files in the player; whether there is a picture of a time.

// Milliseconds of a frame in which files are read and uploaded.
const SLICE = 6;
// Results of a step of the player with files: `Step` in src/bin/player.rs.
const [NOTHING, FILE] = [0, 2];

// Where files beside the index at an address are.
export function beside(address) {
  return async (name, signal) => {
    const response = await fetch(new URL(name, new URL(address, location.href)), { signal });
    if (!response.ok) throw new Error(`the server answered ${response.status}`);
    return response.arrayBuffer();
  };
}

// The same of files of this device.
export function among(files) {
  return async (name) => {
    const file = files.find((one) => one.name === name);
    if (!file) throw new Error(`there is no ${name}`);
    return file.arrayBuffer();
  };
}

export class Stream {
  // `read` gives the bytes of a file by its name.
  constructor(player, number, read) {
    Object.assign(this, { player, number, read, requests: new Map(), told: null });
  }

  // Asks for the files that the player needs next, and ends requests that it does not need any more.
  follow(seconds, velocity, loops) {
    const plan = this.player.plan(this.number, performance.now() / 1000, seconds, velocity, loops);
    if (!plan) return this.end();
    const { fetch, give_up } = plan;
    plan.free();
    for (const file of give_up) {
      this.requests.get(file)?.abort();
      this.requests.delete(file);
    }
    for (const file of fetch) this.ask(file);
  }

  async ask(file) {
    const own = new AbortController();
    this.requests.set(file, own);
    const name = this.player.file_name(this.number, file);
    const bytes = await this.read(name, own.signal).catch(() => null);
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

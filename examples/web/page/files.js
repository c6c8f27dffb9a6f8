// Files of captures: from an address or this device into the player.
// In: an address, a file, bytes. Out: what there is to tell about the capture once it is shown, and about its beginning before that; the stream of a
// capture in chunk files; progress; a sentence that says what was wrong and what to do.

import { Stream, partsAt } from './stream.js';

// Milliseconds of a slice of loading: the page draws and answers between slices.
const SLICE = 8;
// Milliseconds: if the rest of a file takes longer than this to arrive, its beginning is shown meanwhile.
const PATIENT = 1000;

// A file that was not opened; `again` is whether trying again can help.
export class Refusal extends Error {
  constructor(text, again = false) {
    super(text);
    this.again = again;
  }
}

export const megabytes = (bytes) => `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;

const channel = new MessageChannel();
channel.port1.start();

// Lets the page draw and answer.
function pause() {
  return new Promise((resolve) => {
    channel.port1.addEventListener('message', resolve, { once: true });
    channel.port2.postMessage(null);
  });
}

// The name of the file at an address.
export function nameOf(address) {
  try {
    return decodeURIComponent(new URL(address, location.href).pathname.split('/').pop()) || 'capture';
  } catch {
    return 'capture';
  }
}

// Why an address gave no answer.
async function unanswered(url, signal) {
  if (!navigator.onLine) return 'this device is offline';
  if (location.protocol === 'https:' && url.protocol === 'http:') return 'a page from https:// may not load from http://: use an https:// address';
  const answers = url.origin === location.origin ? false : await fetch(url, { mode: 'no-cors', method: 'HEAD', signal }).then(() => true, () => false);
  return answers
    ? `${url.host} answers, but does not let other pages read its files: its answers need the header Access-Control-Allow-Origin: ${location.origin} (or *)`
    : `${url.host} does not answer: the address may be wrong, or the server is down`;
}

// Asks for an address. Returns the stream of the file, its length, 0 if it is not known, whether that length is sure, what gives parts of it, and the
// address.
export async function request(address, signal) {
  let url;
  try {
    url = new URL(address, location.href);
    url.hash = '';
  } catch {
    throw new Refusal(`"${address}" is no address`);
  }
  const response = await fetch(url, { signal }).catch(async (error) => {
    if (signal.aborted) throw error;
    throw new Refusal(`${address} was not loaded: ${await unanswered(url, signal)}.`, true);
  });
  if (!response.ok) throw new Refusal(`${address} was not loaded: the server answered ${response.status} ${response.statusText}.`, true);
  // The length of a compressed answer is not that of the file.
  const length = response.headers.has('Content-Encoding') ? 0 : Number(response.headers.get('Content-Length')) || 0;
  // Other servers hide whether their answers are compressed.
  return { stream: response.body, length, isSure: response.type !== 'cors', parts: (signal) => partsAt(url, signal), address: url };
}

// What a beginning shows a file to be that is certainly none of a capture.
function misnomer(bytes) {
  const text = new TextDecoder('latin1').decode(bytes.subarray(0, 512)).replace(/^\u00ef\u00bb\u00bf/, '').trimStart().toLowerCase();
  const isPage = text.startsWith('<!doctype html') || text.startsWith('<html') || text.startsWith('<head');
  return isPage ? 'is a web page, not a capture: the address of the file itself is needed (a page about it, or one that asks to sign in, was sent)' : '';
}

// Opens files in a player, one at a time: a file replaces one that is still being opened.
export class Opener {
  // `report` gets the progress; `times.longestSlice` is kept; `explain` says what an error is about.
  constructor(player, times, report, explain) {
    // `lacksParts` is the server that sent all of a file because it sends no parts.
    Object.assign(this, { player, times, report, explain, own: null, stream: null, lacksParts: '' });
  }

  // Ends what is being opened.
  cancel() {
    this.own?.abort();
    this.end();
  }

  // Frees the memory of what is being opened, and ends its requests.
  end() {
    this.own = null;
    this.take()?.end();
    try {
      this.player.close?.();
    } catch {
      // A player that has run out of memory answers no call any more.
    }
  }

  // Returns the stream of the capture that has been opened, if it is in chunk files; from now on it is the caller's.
  take() {
    const stream = this.stream;
    this.stream = null;
    return stream;
  }

  get busy() {
    return Boolean(this.own);
  }

  // Does a part of the loading, whose time counts.
  slice(work) {
    const start = performance.now();
    const result = work(() => performance.now() - start < SLICE);
    this.times.longestSlice = Math.max(this.times.longestSlice, performance.now() - start);
    return result;
  }

  // Opens the file whose stream and length a promise gives. `preview` gets what there is to tell about each beginning of the file that is shown;
  // `beside` gives files beside it, if there are any, and `seconds` is the time of its first picture. `shown` gets what there is to tell about the file
  // once it is shown. Returns whether it is, and was not cancelled or replaced.
  async open(name, begin, { preview, beside, seconds, shown }) {
    this.cancel();
    const own = new AbortController();
    this.own = own;
    this.lacksParts = '';
    try {
      this.report({ name, part: 0, bytes: 0, total: 0, state: 'receiving' });
      const file = await begin(own.signal);
      if (own.signal.aborted) return false;
      const within = await this.receive(name, file, own.signal, preview);
      const found = own.signal.aborted ? null : await this.read(name, own.signal, within ?? beside, seconds);
      if (found) shown(found);
      return Boolean(found);
    } catch (error) {
      if (own.signal.aborted) return false;
      throw error instanceof Refusal ? error : new Refusal(`${name} was not opened: ${this.explain(error)}`);
    } finally {
      // What has not been received of a file that was refused is received no further.
      own.abort();
      if (this.own === own) this.end();
    }
  }

  // Receives a file. Of an index that chunk files follow, only the index where there are parts of the file: then these are returned.
  async receive(name, { stream, length, isSure = true, parts, address }, signal, preview) {
    // Whether there are parts, once they are needed.
    let within = null;
    const reader = stream.getReader();
    signal.addEventListener('abort', () => reader.cancel().catch(() => {}), { once: true });
    this.player.set_address?.(address?.href);
    this.slice(() => this.player.open(name, length));
    // Bytes, and milliseconds that the page waited for them.
    let [received, waited] = [0, 0];
    const cut = () => {
      const of = length ? ` of ${megabytes(length)}` : '';
      return new Refusal(`${name} was not opened: the connection ended after ${megabytes(received)}${of}.`, true);
    };
    for (;;) {
      const asked = performance.now();
      const { done, value } = await reader.read().catch((error) => {
        if (signal.aborted) throw error;
        throw cut();
      });
      if (signal.aborted) return;
      if (done) break;
      waited += performance.now() - asked;
      const wrong = received === 0 ? misnomer(value) : '';
      if (wrong) throw new Refusal(`${name} ${wrong}.`);
      this.slice(() => this.player.receive(value));
      received += value.length;
      // That of a compressed answer is not the length of the file.
      if (received > length && !isSure) length = 0;
      const index = this.player.index_length?.();
      if (index !== undefined) within ??= parts(signal).catch((error) => error);
      if (received >= index) {
        const found = await within;
        if (signal.aborted) return;
        if (found instanceof Error) throw new Refusal(`${name} was not opened: no part of it was loaded: ${found.message}.`, true);
        if (found) {
          reader.cancel().catch(() => {});
          this.slice(() => this.player.end_at_index());
          return found;
        }
        this.lacksParts = address?.host ?? '';
      }
      this.report({ name, part: length ? 0.7 * Math.min(1, received / length) : 0.35, bytes: received, total: length, state: 'receiving' });
      // A file of unknown length may take as long again.
      const left = length ? waited * (length / received - 1) : waited;
      if (left < PATIENT || !this.slice(() => this.player.begin_preview?.())) continue;
      const found = await this.steps(() => this.player.step_preview(), signal).catch((error) => {
        // What is wrong with a beginning is told when all of the file has been received, by a player that has not ended.
        if (error instanceof WebAssembly.RuntimeError) throw error;
        return null;
      });
      if (signal.aborted) return;
      if (found) preview(found);
    }
    if (received === 0) throw new Refusal(`${name} is empty: it has no byte.`);
    if (received < length && isSure) throw cut();
  }

  read(name, signal, beside, seconds) {
    const between = () => {
      this.report({ name, part: 0.7 + 0.29 * this.player.progress(), state: 'reading' });
      this.follow(name, beside, seconds);
    };
    return this.steps(() => this.player.step(), signal, between);
  }

  // Fetches files of the first picture of a capture in chunk files.
  follow(name, beside, seconds) {
    const number = this.player.opening_stream?.();
    if (number === undefined) return;
    if (!beside) {
      throw new Refusal(`${name} is the index of a capture in chunk files, which are beside it: drop all of them, open its address, or join them by gs4d join.`);
    }
    this.stream ??= new Stream(this.player, number, beside);
    this.stream.follow(seconds, 1, true);
    const obstacle = this.stream.obstacle(seconds);
    if (obstacle) throw new Refusal(`${name} was not opened: ${obstacle}.`, true);
  }

  // Does steps until one has a result, and returns it; null if that was cancelled. `between` is called before each further slice.
  async steps(step, signal, between = () => {}) {
    for (;;) {
      const found = this.slice((hasTime) => {
        let result;
        do result = step();
        while (!result && !this.player.waits() && hasTime());
        return result;
      });
      if (found) return found;
      await (this.player.waits() ? new Promise((resolve) => setTimeout(resolve, this.stream ? 15 : 1)) : pause());
      if (signal.aborted) return null;
      between();
    }
  }
}

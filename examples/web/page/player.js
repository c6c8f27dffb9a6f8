// The page of a player: controls, files, links, and the messages of a page around it.
// In: the query of the address (README of this folder), the user, messages. Out: calls of the player in WebAssembly, events for the page around.

import { Orbit } from './camera.js';

const query = new URLSearchParams(location.search);
const at = (id) => document.getElementById(id);
const stage = at('stage');
const canvas = at('canvas');
const framed = window.parent !== window;

// Milliseconds of a slice of loading: the page draws and answers between slices.
const SLICE = 8;
// Pixels of the canvas for one of the page, at most.
const DENSEST = 2;
const SPEEDS = [0.25, 0.5, 1, 2, 4];

let player = null;
let orbit = null;
let about = null;
let source = null;
let turn = 0;
let seconds = 0;
let playing = false;
let changed = false;
let before = 0;
let pictured = false;
const loops = query.get('loop') !== '0';
// Milliseconds that the page was blocked at most, by a slice of loading and by a picture; and when the code was compiled.
const times = { longestSlice: 0, longestDraw: 0, compiled: 0 };

// Events ---------------------------------------------------------------------------------------------------------------

function tell(event, details = {}) {
  stage.dispatchEvent(new CustomEvent(`gs4d-${event}`, { detail: details, bubbles: true }));
  if (framed) window.parent.postMessage({ gs4d: event, ...details }, '*');
}

function say(text) {
  at('said').textContent = text;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => (at('said').textContent = ''), 2500);
}

// Shows a message, with a button that closes it and does something, if there is anything to do.
function refuse(text, label = '', action = null) {
  at('text').textContent = text;
  at('message').hidden = false;
  at('again').hidden = !label;
  at('again').textContent = label;
  at('again').onclick = () => {
    at('message').hidden = true;
    action?.();
  };
  at('progress').hidden = true;
  tell('error', { message: text });
}

function message(error) {
  return typeof error === 'string' ? error : (error?.message ?? String(error));
}

// Playback -------------------------------------------------------------------------------------------------------------

const duration = () => about?.seconds ?? 0;

function play(on = true) {
  if (on && !duration()) return;
  if (on && !loops && seconds >= duration()) seconds = 0;
  if (playing === on) return;
  playing = on;
  stage.classList.toggle('playing', on);
  at('play').setAttribute('aria-label', on ? 'Pause' : 'Play');
  wake();
  tell(on ? 'playing' : 'paused', { seconds });
}

function seek(to) {
  seconds = Math.min(duration(), Math.max(0, to));
  changed = true;
  showTime();
  tell('time', { seconds });
}

function setSpeed(value) {
  at('speed').value = String(SPEEDS.reduce((best, one) => (Math.abs(one - value) < Math.abs(best - value) ? one : best)));
}

function showTime() {
  const slider = at('seek');
  slider.value = duration() ? seconds / duration() : 0;
  const text = `${seconds.toFixed(1)} / ${duration().toFixed(1)} s`;
  slider.setAttribute('aria-valuetext', text);
  at('time').textContent = text;
}

// One frame: the time advances whether the device is ready for a picture or not.
function frame(now) {
  requestAnimationFrame(frame);
  const passed = Math.min(now - before, 250) / 1000;
  before = now;
  if (!player || !about) return;
  if (playing) {
    seconds += passed * Number(at('speed').value);
    if (seconds >= duration()) {
      seconds = loops ? seconds % duration() : duration();
      if (!loops) play(false);
      tell('ended');
    }
    changed = true;
    showTime();
  }
  const fault = player.fault();
  if (fault) {
    play(false);
    refuse(fault, 'Load the page again', () => location.reload());
  }
  if (!player.is_ready()) return;
  if (pictured === 'drawn') {
    pictured = true;
    at('poster').classList.add('gone');
    // Windows of Bevy take the focus.
    if (!player.resize) canvas.blur();
    tell('picture', { milliseconds: performance.now() - times.compiled });
  }
  if (!changed) return;
  changed = false;
  try {
    const [first, last] = about.interval;
    const time = duration() ? first + ((last - first) * seconds) / duration() : first;
    const start = performance.now();
    player.draw(time, orbit.pose(), orbit.lens(canvas.width, canvas.height));
    times.longestDraw = Math.max(times.longestDraw, performance.now() - start);
    pictured ||= 'drawn';
  } catch (error) {
    play(false);
    refuse(message(error), 'Load the page again', () => location.reload());
  }
}

// A player without `resize` sizes its canvas itself.
function resize() {
  changed = true;
  if (player && !player.resize) return;
  const density = Math.min(devicePixelRatio, DENSEST) * Math.min(2, Math.max(0.1, Number(query.get('scale')) || 1));
  const size = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * density)));
  if (canvas.width === size[0] && canvas.height === size[1]) return;
  [canvas.width, canvas.height] = size;
  player?.resize(...size);
}

// Files ----------------------------------------------------------------------------------------------------------------

const channel = new MessageChannel();
channel.port1.start();

// Lets the page draw and answer.
function pause() {
  return new Promise((resolve) => {
    channel.port1.addEventListener('message', resolve, { once: true });
    channel.port2.postMessage(null);
  });
}

function progress(part) {
  at('progress').hidden = part >= 1;
  at('progress').value = part;
  tell('progress', { part });
}

// Does a part of the loading, whose time counts.
function slice(work) {
  const start = performance.now();
  const result = work(() => performance.now() - start < SLICE);
  times.longestSlice = Math.max(times.longestSlice, performance.now() - start);
  return result;
}

// Opens a file whose bytes a stream has; its length is 0 if it is not known. The capture that is shown stays if they are no capture.
async function openStream(name, stream, length, own, address = null) {
  const reader = stream.getReader();
  try {
    slice(() => player.open(name, length));
    for (let received = 0; ; ) {
      const { done, value } = await reader.read();
      if (own !== turn) return void reader.cancel();
      if (done) break;
      slice(() => player.receive(value));
      received += value.length;
      progress(length ? 0.7 * Math.min(1, received / length) : 0.35);
    }
    let found;
    while (!found) {
      found = slice((hasTime) => {
        let step;
        do step = player.step();
        while (!step && !player.waits() && hasTime());
        return step;
      });
      progress(0.7 + 0.29 * player.progress());
      await (player.waits() ? new Promise((resolve) => setTimeout(resolve, 1)) : pause());
      if (own !== turn) return;
    }
    show(found, address);
  } catch (error) {
    if (own === turn) refuse(`${name} was not opened: ${message(error)}`, about ? 'Close' : '');
  }
}

// Opens the bytes of a file.
function openBytes(name, bytes) {
  return openStream(name, new Blob([bytes]).stream(), bytes.length, ++turn);
}

function show(found, address) {
  source = address;
  about = { gaussians: found.gaussians, seconds: found.seconds, interval: [...found.interval], center: found.center, radius: found.radius, up: found.up };
  found.free?.();
  orbit = new Orbit(about);
  seconds = 0;
  changed = true;
  at('message').hidden = true;
  progress(1);
  for (const id of ['play', 'seek']) at(id).disabled = !duration();
  showTime();
  tell('loaded', { seconds: duration(), gaussians: about.gaussians });
}

// The name of the file at an address.
function nameOf(address) {
  try {
    return decodeURIComponent(new URL(address, location.href).pathname.split('/').pop()) || 'capture';
  } catch {
    return 'capture';
  }
}

// Opens a file at an address.
async function openAddress(address) {
  const own = ++turn;
  try {
    progress(0);
    const response = await fetch(address);
    if (!response.ok) throw new Error(`the server answered ${response.status} ${response.statusText}`);
    // The length of a compressed answer is not that of the file.
    const length = response.headers.has('Content-Encoding') ? 0 : Number(response.headers.get('Content-Length')) || 0;
    await openStream(nameOf(address), response.body, length, own, address);
  } catch (error) {
    if (own === turn) refuse(`${address} was not loaded: ${message(error)}`, 'Try again', () => openAddress(address));
  }
}

// Opens a file of this computer, and goes on playing.
async function openFile(file) {
  if (!file || !player) return;
  const [own, held, before] = [++turn, playing, about];
  await openStream(file.name, file.stream(), file.size, own);
  if (own === turn && about !== before && held) play();
}

// Links ----------------------------------------------------------------------------------------------------------------

function link() {
  const address = new URL(location.href);
  address.search = '';
  if (query.has('engine')) address.searchParams.set('engine', query.get('engine'));
  if (source) address.searchParams.set('capture', source);
  address.searchParams.set('time', seconds.toFixed(3));
  if (orbit) address.searchParams.set('camera', orbit.text());
  return address.href;
}

async function copyLink() {
  const text = link();
  history.replaceState(null, '', text);
  try {
    await navigator.clipboard.writeText(text);
    say(source ? 'The link is copied' : 'The link is copied, without the file, which is on this device alone');
  } catch {
    say('The link is in the address bar');
  }
}

function full() {
  if (document.fullscreenElement) document.exitFullscreen();
  else stage.requestFullscreen?.().catch(() => say('This page may not fill the screen'));
}

// The user -------------------------------------------------------------------------------------------------------------

function wake() {
  stage.classList.remove('idle');
  clearTimeout(wake.timer);
  wake.timer = setTimeout(() => stage.classList.toggle('idle', playing), 3000);
}

const pointers = new Map();

function spread() {
  const [a, b] = [...pointers.values()];
  return b ? { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) } : { ...a, apart: 0 };
}

function listen() {
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!pointers.has(event.pointerId) || !orbit) return;
    const old = spread();
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const now = spread();
    const [across, down] = [now.x - old.x, now.y - old.y].map((move) => move / canvas.clientHeight);
    if (pointers.size > 1 || event.shiftKey || event.buttons & 6) orbit.pan(-across, -down);
    else orbit.turn(-3 * across, 3 * down);
    if (pointers.size > 1 && now.apart > 0) orbit.zoom(old.apart / now.apart);
    changed = true;
  });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    orbit?.zoom(Math.exp(Math.min(1, Math.max(-1, event.deltaY / 500))));
    changed = true;
  }, { passive: false });
  canvas.addEventListener('dblclick', full);

  at('play').onclick = () => play(!playing);
  at('seek').oninput = () => seek(Number(at('seek').value) * duration());
  at('home').onclick = () => act('Home');
  at('open').onclick = () => at('file').click();
  at('file').onchange = () => {
    openFile(at('file').files[0]);
    at('file').value = '';
  };
  at('link').onclick = copyLink;
  at('full').onclick = full;
  addEventListener('keydown', (event) => {
    wake();
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    // Keys of a control that has the focus are its own.
    const own = event.target.closest?.('select, input, button');
    if (own && (own.id !== 'seek' || /^(Arrow|Home|End|Page)/.test(event.key)) && /^( |Enter|Arrow|Home|End|Page)/.test(event.key)) return;
    if (act(event.key)) event.preventDefault();
  });

  addEventListener('dragover', (event) => {
    event.preventDefault();
    at('drop').hidden = false;
  });
  addEventListener('dragleave', (event) => (at('drop').hidden = !event.relatedTarget));
  addEventListener('drop', (event) => {
    event.preventDefault();
    at('drop').hidden = true;
    openFile(event.dataTransfer.files[0]);
  });
  for (const event of ['pointermove', 'pointerdown', 'focusin']) addEventListener(event, wake);
  new ResizeObserver(resize).observe(canvas);
  if (framed) addEventListener('message', (event) => event.source === window.parent && obey(event.data));
}

// Does what a key stands for. Returns whether it stands for anything.
function act(key) {
  const step = (by) => setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, SPEEDS.indexOf(Number(at('speed').value)) + by))]);
  const moves = {
    ArrowLeft: () => orbit?.turn(0.1, 0),
    ArrowRight: () => orbit?.turn(-0.1, 0),
    ArrowUp: () => orbit?.turn(0, 0.1),
    ArrowDown: () => orbit?.turn(0, -0.1),
    '+': () => orbit?.zoom(0.9),
    '=': () => orbit?.zoom(0.9),
    '-': () => orbit?.zoom(1 / 0.9),
    Home: () => orbit?.home(),
    ' ': () => play(!playing),
    k: () => play(!playing),
    j: () => seek(seconds - duration() / 20),
    ';': () => seek(seconds + duration() / 20),
    ',': () => (play(false), seek(seconds - 1 / 30)),
    '.': () => (play(false), seek(seconds + 1 / 30)),
    '<': () => step(-1),
    '>': () => step(1),
    f: full,
    o: () => at('file').click(),
    l: copyLink,
  };
  const done = Object.hasOwn(moves, key) ? moves[key] : /^[0-9]$/.test(key) ? () => seek((Number(key) / 10) * duration()) : null;
  done?.();
  changed ||= Boolean(done);
  return Boolean(done);
}

// Does what the page around asks for.
function obey(data) {
  const orders = {
    play: () => play(),
    pause: () => play(false),
    seek: () => seek(Number(data.value) || 0),
    speed: () => setSpeed(Number(data.value) || 1),
    open: () => {
      if (typeof data.value === 'string') openAddress(data.value);
      else if (data.value instanceof ArrayBuffer) openBytes(String(data.name ?? 'capture'), new Uint8Array(data.value));
    },
    camera: () => {
      if (typeof data.value === 'string') orbit?.read(data.value);
      else orbit?.give(data.value ?? {});
      changed = true;
    },
  };
  if (data && Object.hasOwn(orders, data.gs4d) && player) orders[data.gs4d]();
}

// The beginning --------------------------------------------------------------------------------------------------------

const WITHOUT =
  'This browser has no WebGPU, which draws the capture. Chrome and Edge have it since version 113 (on Android 121), Safari since 26, Firefox since 141 on Windows. It may be switched off, or the graphics driver may be too old.';

async function begin() {
  const poster = query.get('poster') ?? (query.has('capture') ? null : 'poster.jpg');
  if (poster) {
    at('poster').onload = () => (at('poster').hidden = false);
    at('poster').src = poster;
  }
  stage.classList.toggle('bare', query.get('controls') === '0');
  progress(0);
  if (!isSecureContext) return refuse('WebGPU needs a page from https:// or from this computer (http://localhost).');
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) return refuse(WITHOUT);
  const engine = query.get('engine') === 'bevy' ? 'player_bevy' : 'player_plain';
  try {
    const { default: init, Player } = await import(`./${engine}.js`);
    const { memory } = await init();
    times.memory = () => memory.buffer.byteLength;
    times.compiled = performance.now();
    resize();
    player = await Player.create(canvas, navigator.gpu.getPreferredCanvasFormat());
    player.resize?.(canvas.width, canvas.height);
    // Software drivers are faster with the other design.
    const design = query.get('design') ?? (adapter.info?.isFallbackAdapter ? 'sort' : null);
    if (design) player.set_design?.(design);
    player.set_detail?.(Number(query.get('detail')) || 0);
  } catch (error) {
    return refuse(`The player did not start: ${message(error)}`, 'Load the page again', () => location.reload());
  }
  listen();
  requestAnimationFrame(frame);
  tell('ready');
  await openAddress(query.get('capture') ?? 'toybox.gs4d');
  if (!about) return;
  if (query.has('camera') && !orbit.read(query.get('camera'))) say('The camera of the link is not understood');
  if (query.has('speed')) setSpeed(Number(query.get('speed')) || 1);
  if (query.has('time')) seek(Number(query.get('time')) || 0);
  else if (query.get('autoplay') !== '0' && !matchMedia('(prefers-reduced-motion: reduce)').matches) play();
}

// For scripts of this page, and tests.
window.gs4d = { redraw() { changed = true; }, get player() { return player; }, play, seek, setSpeed, openAddress, openBytes, link, obey, times, get about() { return about; }, get seconds() { return seconds; }, get playing() { return playing; } };

begin();

// The player of a page: what plays, is drawn and is asked of it by the user.
// In: the query of the address (README of this folder), the user, messages. Out: calls of the player in WebAssembly, events for the page around.

import { Orbit } from './camera.js';
import { Opener, Refusal, nameOf, request } from './files.js';
import { at, dismiss, help, loading, refuse, say, toolbar } from './parts.js';
import { among, beside, partsOf } from './stream.js';
import { Quality } from './quality.js';
import { framed, linkTo, listenAround, obedient, tell } from './around.js';

const query = new URLSearchParams(location.search);
const stage = at('stage');
const canvas = at('canvas');

// Pixels of the canvas for one of the page, at most.
const DENSEST = 2;
// Pixels of the first picture on a software driver, and of the shorter side of the smallest picture.
const SMALL = 320 * 180;
const SMALLEST_SIDE = 90;
const FRAME = 1 / 30;
const SPEEDS = [0.25, 0.5, 1, 2, 4];
const BACKGROUNDS = { trained: null, black: [0, 0, 0], gray: [0.5, 0.5, 0.5], white: [1, 1, 1] };
const WITHOUT =
  'This browser has no WebGPU, which draws the capture. Chrome and Edge have it since version 113 (on Android 121), Safari since 26, Firefox since 141 on Windows and 145 on Macs. It may be switched off, or the graphics driver may be too old.';
const FULL =
  'the page has run out of memory: make the capture smaller (gs4d compress), or cut it into chunk files (gs4d split), of which the page keeps some';
const RELOAD = { again: 'Load the page again', action: () => location.reload() };
const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;

let player = null;
let opener = null;
let orbit = null;
let about = null;
// The files of a capture in chunk files, and whether time waits for some.
let stream = null;
let buffering = false;
// The address of the capture that is shown, if the query does not name it; null for a file of this device.
let source;
let name = '';
let seconds = 0;
let playing = false;
// Whether the user, the query or the page around wants it to play.
let wanted = query.get('autoplay') !== '0' && !calm;
let changed = false;
let before = 0;
// The density of the screen when the last picture was asked for.
let drawnDensity = devicePixelRatio;
// 'drawn' when the first picture is on its way, true when it is there.
let pictured = false;
// Whether the time of the next picture tells about those after it: the first picture of a capture compiles.
let learns = false;
let background = 'trained';
let quality = new Quality();
let drawn = null;
let told = 0;
let moved = 0;
// Why the code of the player has ended, after which it answers no call; and what gives the message of its panic, if it was one.
let ended = '';
let panicMessage = () => undefined;
const held = new Set();
const loops = query.get('loop') !== '0';
// Milliseconds that the page was blocked at most, by a slice of loading and by a picture; and when the code was compiled.
const times = { longestSlice: 0, longestDraw: 0, compiled: 0 };

function fail(text, options = {}) {
  refuse(text, options);
  tell('error', { message: text });
}

// Says what an error is about, and notes that the code of the player has ended.
function explain(error) {
  const text = typeof error === 'string' ? error : (error?.message ?? String(error));
  if (!(error instanceof WebAssembly.RuntimeError)) return text;
  // Without memory the code ends without a message.
  ended ||= panicMessage() ?? (/unreachable/i.test(text) ? FULL : text);
  return ended;
}

// Playback -------------------------------------------------------------------------------------------------------------

const duration = () => about?.seconds ?? 0;

function play(on = true) {
  wanted = on;
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

const speed = () => Number(at('speed').value);

// Returns whether there is such a background: a name, or six hexadecimal digits.
function setBackground(value) {
  const digits = /^#?([0-9a-f]{6})$/i.exec(value)?.[1];
  if (!digits && !Object.hasOwn(BACKGROUNDS, value)) return false;
  background = digits ?? value;
  const color = digits ? [0, 2, 4].map((i) => parseInt(digits.slice(i, i + 2), 16) / 255) : BACKGROUNDS[value];
  player.set_background?.(color ? Float32Array.from(color) : undefined);
  at('background').value = digits ? '' : value;
  changed = true;
  return true;
}

function setCamera(value) {
  const is = typeof value === 'string' ? orbit?.read(value) : orbit?.give(value ?? {});
  changed = true;
  return Boolean(is);
}

function showTime() {
  const slider = at('seek');
  slider.value = duration() ? seconds / duration() : 0;
  const text = `${seconds.toFixed(1)} / ${duration().toFixed(1)} s`;
  // Screen readers read the value when the slider has the focus, not at every picture.
  if (!playing || document.activeElement !== slider) slider.setAttribute('aria-valuetext', text);
  at('time').textContent = text;
}

// Lets the time of the capture pass: it stands until there is a picture of it.
function advance(passed) {
  if (!playing || pictured !== true || buffering) return;
  seconds += passed * speed();
  if (seconds >= duration()) {
    seconds = loops ? seconds % duration() : duration();
    if (!loops) {
      play(false);
      // What is opened next plays.
      wanted = true;
    }
    tell('ended');
  }
  changed = true;
  showTime();
  if (before - told > 250) {
    told = before;
    tell('time', { seconds });
  }
}

// Shows what the picture waits for, unless a file is being opened, whose progress is shown.
function notice() {
  if (!opener.busy) loading(buffering ? { state: 'buffering', part: 1 } : null);
}

// Fetches the files of a capture in chunk files. Until the most important Gaussians of a time are there, the picture of before stays.
function follow() {
  if (!stream) return;
  try {
    stream.follow(seconds, playing ? speed() : 0, loops);
    if (stream.work()) changed = true;
  } catch (error) {
    stream.end();
    stream = null;
    if (buffering) tell('buffered', { seconds });
    buffering = false;
    play(false);
    const reason = explain(error);
    return fail(`${name} is not played any further: ${reason}`, ended ? RELOAD : { closable: true });
  }
  const waits = !stream.has(seconds);
  if (waits !== buffering) {
    buffering = waits;
    changed = true;
    notice();
    tell(waits ? 'buffering' : 'buffered', { seconds });
  }
  const obstacle = waits ? stream.obstacle(seconds) : null;
  if (obstacle) fail(`${name}, at ${seconds.toFixed(1)} s: ${obstacle}.`, { closable: true });
}

const FLIGHTS = { d: [0, 1], a: [0, -1], q: [1, 1], e: [1, -1], w: [2, 1], s: [2, -1] };

function flight() {
  const direction = [0, 0, 0];
  for (const key of held) direction[FLIGHTS[key][0]] += FLIGHTS[key][1];
  return direction;
}

// One frame: the time advances whether the device is ready for a picture or not.
function frame(now) {
  if (ended) return;
  requestAnimationFrame(frame);
  const interval = Math.min(now - before, 250);
  const passed = interval / 1000;
  before = now;
  if (drawnDensity !== devicePixelRatio) [drawnDensity, changed] = [devicePixelRatio, true];
  if (!player || !about) return;
  if (orbit.advance(passed, flight())) {
    changed = true;
    moved = now;
  }
  follow();
  advance(passed);
  const fault = player.fault();
  if (fault) {
    play(false);
    fail(fault, RELOAD);
  }
  if (!player.is_ready()) return;
  finish(now, interval);
  const moves = playing || now - moved < 200;
  if (changed || (pictured === true && !moves && drawn && player.resize && quality.sharper(drawn))) draw(moves);
}

// The device has finished a picture. `interval` is the time since the frame before, milliseconds.
function finish(now, interval) {
  if (drawn?.start) {
    if (drawn.learns) quality.learn(now - drawn.start, drawn.share, drawn.moves, interval);
    // A small picture whose time tells nothing is followed by one that tells how much larger the next may be.
    else changed ||= drawn.share < 1;
    drawn.start = 0;
  }
  if (pictured !== 'drawn') return;
  pictured = true;
  at('poster').classList.add('gone');
  notice();
  stage.classList.remove('loading');
  // Windows of Bevy take the focus.
  if (!player.resize) canvas.blur();
  tell('picture', { milliseconds: performance.now() - times.compiled });
}

function draw(moves) {
  // A frame that is collapsed is drawn once it has a size again.
  if (!canvas.clientWidth || !canvas.clientHeight) return;
  changed = false;
  quality.least = leastShare();
  try {
    const [first, last] = about.interval;
    const time = duration() ? first + ((last - first) * seconds) / duration() : first;
    const share = quality.share(moves || pictured !== true);
    const gaussians = quality.gaussians(moves);
    const start = performance.now();
    fit(share);
    player.set_share?.(gaussians);
    player.draw(time, orbit.pose(), orbit.lens(canvas.clientWidth, canvas.clientHeight));
    times.longestDraw = Math.max(times.longestDraw, performance.now() - start);
    drawn = { start, share, gaussians, moves, learns };
    learns = true;
    pictured ||= 'drawn';
  } catch (error) {
    play(false);
    fail(explain(error), RELOAD);
  }
}

// Pixels of the canvas at full resolution.
function fullSize() {
  const density = Math.min(devicePixelRatio, DENSEST) * Math.min(2, Math.max(0.1, Number(query.get('scale')) || 1));
  return [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, side * density));
}

// The smallest share of the side length, at this size of the canvas.
const leastShare = () => Math.min(1, SMALLEST_SIDE / Math.min(...fullSize()));

// Sizes the canvas to a share of that. A player without `resize` sizes its canvas itself.
function fit(share) {
  if (player && !player.resize) return;
  const size = fullSize().map((side) => Math.max(1, Math.round(side * share)));
  if (canvas.width === size[0] && canvas.height === size[1]) return;
  [canvas.width, canvas.height] = size;
  player?.resize(...size);
}

// Files ----------------------------------------------------------------------------------------------------------------

function report(progress) {
  loading(progress);
  tell('progress', progress);
}

// What is shown of whose file only the beginning has been received: its title, its address, and what opens it again.
let partial = null;

// Opens a file; `near` gives files beside it, if there are any. Returns whether it is shown; what was shown, perhaps its beginning, stays if it is not.
async function open(title, begin, again, address, near = null) {
  if (!player) return fail(WITHOUT), false;
  if (ended) return fail(ended, RELOAD), false;
  dismiss();
  // Whether the beginning of the file is shown.
  let begun = Boolean(again) && partial?.title === title && partial.address === address;
  const take = (found) => (begun ? renew(found) : show(found, title, address));
  try {
    const preview = (beginning) => {
      take(beginning);
      [begun, partial] = [true, { title, address, again }];
      tell('preview', { gaussians: about.gaussians });
    };
    const shown = (found) => {
      take(found);
      partial = null;
      loading(pictured === true ? null : { state: 'compiling', part: 1 });
      tell('loaded', { seconds: duration(), gaussians: about.gaussians });
      if (opener.lacksParts) say(`${opener.lacksParts} sends no parts of files: all of the capture was loaded`);
    };
    return await opener.open(title, begin, { preview, shown, beside: near, seconds: address === undefined ? timeOfLink() ?? 0 : 0 });
  } catch (error) {
    const action = error instanceof Refusal && error.again ? again : null;
    if (ended) play(false);
    fail(explain(error), ended ? RELOAD : { again: action ? 'Try again' : '', action, closable: Boolean(about) || !action });
    return false;
  }
}

const local = (file) => async () => ({ stream: file.stream(), length: file.size, parts: async () => partsOf(file) });

const openBytes = (title, bytes) => open(title, local(new Blob([bytes])), null, null);

const openAddress = (address, isOfQuery = false) =>
  open(nameOf(address), (signal) => request(address, signal), () => openAddress(address, isOfQuery), isOfQuery ? undefined : address, beside(address));

const openFile = (file, near = null) => file && open(file.name, local(file), null, null, near);

// Of several files, one is the index of the others.
function openFiles(list) {
  const files = [...list];
  if (files.length < 2) return openFile(files[0]);
  return openFile(files.find((file) => file.name === 'index.gs4d') ?? files[0], among(files));
}

function cancel() {
  opener?.cancel();
  if (about) notice();
  else loading(null);
  const again = about ? partial?.again : () => first();
  if (again) fail('Loading was cancelled.', { again: 'Load again', action: again, closable: Boolean(about) });
  else say('Loading was cancelled');
}

// Notes what there is to tell about the capture that is drawn from now on.
function note(found) {
  about = { gaussians: found.gaussians, seconds: found.seconds, interval: [...found.interval], center: found.center, radius: found.radius, up: found.up };
  found.free?.();
  stream?.end();
  [stream, buffering] = [opener.take(), false];
  [changed, learns] = [true, false];
  // A picture that is on its way is of another capture.
  if (drawn) drawn.learns = false;
  describe();
}

// Shows a capture, or the beginning of one, from its first camera and time.
function show(found, title, address) {
  source = address;
  name = title;
  note(found);
  orbit = new Orbit(about, !calm);
  [seconds, pictured] = [0, false];
  playing = false;
  stage.classList.remove('playing');
  stage.classList.toggle('still', !duration());
  for (const id of ['play', 'seek', 'speed', 'home', 'link']) at(id).disabled = false;
  refreshTools?.();
  showTime();
  // A link with a time shows that moment.
  if (wanted && !(source === undefined && query.has('time'))) play();
  if (source === undefined) goToLink();
}

// Shows more of the capture that is shown: camera, time and playback stay.
function renew(found) {
  note(found);
  orbit.surround(about);
}

// Shows the title and the count.
function describe() {
  const title = (source === undefined && query.get('title')) || name.replace(/\.[a-z0-9]{1,6}$/i, '');
  at('title').textContent = title;
  const length = duration() ? `, ${duration().toFixed(1)} s` : '';
  at('count').textContent = `${about.gaussians.toLocaleString('en')} Gaussians${length}`;
  at('about').hidden = false;
  document.title = `${title} - gs4d player`;
}

// Links and the screen -------------------------------------------------------------------------------------------------

function link() {
  return linkTo(query, { source, seconds: duration() ? seconds : null, camera: orbit?.text() ?? null, speed: speed(), background });
}

async function copyLink() {
  const text = link();
  history.replaceState(null, '', text);
  try {
    await navigator.clipboard.writeText(text);
    say(source === null ? 'The link is copied, without the file, which is on this device alone' : 'The link is copied');
  } catch {
    say('The link is in the address bar');
  }
}

function full() {
  const refused = () => {
    say('This page may not fill the screen: the page around has to allow it');
    tell('error', { message: 'full screen is not allowed' });
  };
  if (document.fullscreenElement) document.exitFullscreen();
  else if (!document.fullscreenEnabled || !stage.requestFullscreen) refused();
  else stage.requestFullscreen().catch(refused);
}

// The user -------------------------------------------------------------------------------------------------------------

let refreshTools = null;
const pointers = new Map();
// Whether the wheel is the player's: in a page around it is that page's, until the user clicks here.
let takesWheel = !framed;

function wake() {
  stage.classList.remove('idle');
  clearTimeout(wake.timer);
  wake.timer = setTimeout(() => stage.classList.toggle('idle', playing), 3000);
}

function spread() {
  const [a, b] = [...pointers.values()];
  return b ? { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) } : { ...a, apart: 0 };
}

// Moves of the camera by a pointer are followed at once.
function drag(event) {
  if (!pointers.has(event.pointerId) || !orbit) return;
  const old = spread();
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  const now = spread();
  const [across, down] = [now.x - old.x, now.y - old.y].map((move) => move / canvas.clientHeight);
  if (pointers.size > 1 || event.shiftKey || event.buttons & 6) orbit.pan(-across, -down);
  else if (held.size || event.altKey) orbit.look(across, -down);
  else orbit.turn(-3 * across, 3 * down);
  if (pointers.size > 1 && now.apart > 0) orbit.zoom(old.apart / now.apart);
  orbit.jump();
  [changed, moved] = [true, before];
}

function wheel(event) {
  const isOurs = takesWheel || event.ctrlKey || event.metaKey;
  if (!isOurs && orbit) say('Click first, or hold Ctrl, to zoom with the wheel');
  if (!isOurs || !orbit?.zoom(Math.exp(Math.min(1, Math.max(-1, event.deltaY / 500))))) return;
  event.preventDefault();
  changed = true;
}

function listenPointers() {
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    takesWheel = true;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener('pointermove', drag);
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  if (framed) stage.addEventListener('pointerleave', () => (takesWheel = false));
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('wheel', wheel, { passive: false });
  canvas.addEventListener('dblclick', full);
}

function listenControls() {
  at('play').onclick = () => play(!playing);
  at('seek').oninput = () => seek(Number(at('seek').value) * duration());
  at('seek').addEventListener('keydown', (event) => {
    const far = duration() / 10;
    const to = { ArrowRight: FRAME, ArrowUp: FRAME, ArrowLeft: -FRAME, ArrowDown: -FRAME, PageUp: far, PageDown: -far, Home: -Infinity, End: Infinity }[event.key];
    if (to === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    seek(seconds + to);
    at('seek').setAttribute('aria-valuetext', at('time').textContent);
  });
  at('background').onchange = () => setBackground(at('background').value);
  at('home').onclick = () => act('Home');
  at('open').onclick = () => at('file').click();
  at('file').onchange = () => {
    openFiles(at('file').files);
    at('file').value = '';
  };
  at('link').onclick = copyLink;
  at('full').onclick = full;
  at('cancel').onclick = cancel;
}

function listenKeys() {
  addEventListener('keydown', (event) => {
    wake();
    if (event.ctrlKey || event.metaKey || event.altKey || at('help').open) return;
    if (event.key === 'Escape' && !at('message').hidden && !at('close').hidden) return dismiss();
    // Keys of a control that has the focus are its own.
    if (event.target.closest?.('select, input, button') && /^( |Enter|Arrow|Home|End|Page)/.test(event.key)) return;
    if (act(event.key)) event.preventDefault();
  });
  addEventListener('keyup', (event) => held.delete(event.key.toLowerCase()));
  addEventListener('blur', () => held.clear());
}

// Files that are dropped; without a player they are refused, and the page stays.
function listenDrops() {
  addEventListener('dragover', (event) => {
    event.preventDefault();
    at('drop').hidden = !player;
  });
  addEventListener('dragleave', (event) => (at('drop').hidden = at('drop').hidden || !event.relatedTarget));
  addEventListener('drop', (event) => {
    event.preventDefault();
    at('drop').hidden = true;
    openFiles(event.dataTransfer.files);
  });
}

function listen() {
  listenPointers();
  listenControls();
  listenKeys();
  for (const event of ['pointermove', 'pointerdown', 'focusin']) addEventListener(event, wake);
  new ResizeObserver(() => (changed = true)).observe(canvas);
  // A picture that is finished while nobody sees the page tells nothing about the device.
  document.addEventListener('visibilitychange', () => drawn && (drawn.learns = false));
  listenAround(obedient({ play, seek, setSpeed, setBackground, setCamera, openAddress, openBytes }));
  for (const id of ['open', 'full', 'background']) at(id).disabled = false;
  at('background').disabled = !player.set_background;
  refreshTools = toolbar(at('tools'));
}

// Does what a key stands for. Returns whether it stands for anything.
function act(key) {
  if (Object.hasOwn(FLIGHTS, key.toLowerCase()) && orbit) {
    held.add(key.toLowerCase());
    return true;
  }
  const faster = (by) => setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, SPEEDS.indexOf(speed()) + by))]);
  const nextBackground = () => {
    const all = Object.keys(BACKGROUNDS);
    setBackground(all[(all.indexOf(background) + 1) % all.length]);
  };
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
    ',': () => (play(false), seek(seconds - FRAME)),
    '.': () => (play(false), seek(seconds + FRAME)),
    '<': () => faster(-1),
    '>': () => faster(1),
    b: nextBackground,
    f: full,
    o: () => at('file').click(),
    l: copyLink,
    '?': help,
  };
  const done = Object.hasOwn(moves, key) ? moves[key] : /^[0-9]$/.test(key) ? () => seek((Number(key) / 10) * duration()) : null;
  done?.();
  changed ||= Boolean(done);
  return Boolean(done);
}

// The beginning --------------------------------------------------------------------------------------------------------

// A poster is of the first view: a link to another one does not show it.
function showPoster() {
  if (query.has('time') || query.has('camera')) return;
  const poster = query.get('poster') ?? (query.has('capture') ? null : 'poster.jpg');
  if (!poster) return;
  at('poster').onload = () => (at('poster').hidden = false);
  at('poster').src = poster;
}

async function begin() {
  document.documentElement.classList.toggle('framed', framed);
  stage.classList.toggle('bare', query.get('controls') === '0');
  at('keys').onclick = help;
  listenDrops();
  showPoster();
  loading({ state: 'starting' });
  if (!isSecureContext) return fail('WebGPU needs a page from https:// or from this computer (http://localhost).');
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) return fail(WITHOUT);
  const engine = query.get('engine') === 'bevy' ? 'player_bevy' : 'player_plain';
  try {
    const { default: init, Player, panic_message } = await import(`./${engine}.js`);
    const { memory } = await init();
    panicMessage = panic_message;
    times.memory = () => memory.buffer.byteLength;
    times.compiled = performance.now();
    const isSoftware = Boolean(adapter.info?.isFallbackAdapter);
    const [width, height] = fullSize();
    const start = isSoftware ? Math.min(1, Math.sqrt(SMALL / (width * height))) : 1;
    quality = new Quality(start, leastShare());
    fit(quality.share(true));
    player = await Player.create(canvas, navigator.gpu.getPreferredCanvasFormat());
    player.resize?.(canvas.width, canvas.height);
    // Software drivers are faster with the other design.
    const design = query.get('design') ?? (isSoftware ? 'sort' : null);
    if (design) player.set_design?.(design);
    player.set_detail?.(Number(query.get('detail')) || 0);
  } catch (error) {
    return fail(`The player did not start: ${explain(error)}`, RELOAD);
  }
  opener = new Opener(player, times, report, explain);
  listen();
  requestAnimationFrame(frame);
  if (query.has('background') && !setBackground(query.get('background'))) say('The background of the link is not understood');
  if (query.has('speed')) setSpeed(Number(query.get('speed')) || 1);
  tell('ready');
  await first();
}

// Opens the capture of the query, at its view.
const first = () => openAddress(query.get('capture') ?? 'toybox.gs4d', true);

// The time of the query; null if it has none.
function timeOfLink() {
  const time = Number(query.get('time') || 'none');
  return Number.isFinite(time) ? time : null;
}

// Goes to the camera and the time of the query.
function goToLink() {
  if (query.has('camera') && !orbit.read(query.get('camera'))) say('The camera of the link is not understood');
  if (timeOfLink() !== null) seek(timeOfLink());
  else if (query.has('time')) say('The time of the link is not understood');
}

// For scripts of this page, and tests.
window.gs4d = {
  play, seek, setSpeed, setBackground, openAddress, openBytes, link, times,
  redraw: () => (changed = true),
  get player() { return player; },
  get about() { return about; },
  get seconds() { return seconds; },
  get playing() { return playing; },
  get settled() { return !orbit || orbit.settled; },
  get quality() { return quality; },
  get share() { return drawn?.share ?? 0; },
  get gaussians() { return drawn?.gaussians ?? 0; },
  get buffering() { return buffering; },
  get thereShare() { return stream ? player.share_there(stream.number, seconds) : 1; },
};

begin();

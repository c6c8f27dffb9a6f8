// The page around the players: opens them in frames, uses them, and posts what it has seen to the server.

const post = (name, body) => fetch(`/result/${name}`, { method: 'POST', body: ArrayBuffer.isView(body) ? body : JSON.stringify(body) });
const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

async function until(what, holds, seconds = 60) {
  for (const start = performance.now(); !holds(); await pause(20)) {
    if (performance.now() - start > 1000 * seconds) throw new Error(`${what} did not happen in ${seconds} s`);
  }
}

const frames = new Map();
addEventListener('message', (event) => frames.get(event.source)?.push(event.data));

// Opens a player, and waits for its first picture, once the whole capture is there, or its refusal.
async function open(query, width = 320, height = 180, seconds = 60) {
  const frame = document.createElement('iframe');
  Object.assign(frame.style, { width: `${width}px`, height: `${height}px`, border: 0 });
  frame.allow = 'fullscreen';
  document.body.append(frame);
  const events = [];
  frames.set(frame.contentWindow, events);
  frame.src = `/page/index.html?${query}`;
  const had = (event) => events.filter((one) => one.gs4d === event);
  const isDone = () => had('error').length > 0 || (had('loaded').length > 0 && had('picture').length > 0);
  await until(`a picture or a message of ?${query}`, isDone, seconds);
  const inside = frame.contentWindow;
  const at = (id) => inside.document.getElementById(id);
  return {
    frame, events, inside, at, had, page: inside.gs4d,
    tell: (gs4d, value, more) => inside.postMessage({ gs4d, value, ...more }, '*'),
    key: (key, target = inside.document.body) => target.dispatchEvent(new inside.KeyboardEvent('keydown', { key, bubbles: true, cancelable: true })),
    // Of the view that the camera has eased to, at the full resolution.
    picture: async () => {
      await until('rest', () => inside.gs4d.settled);
      whole(inside.gs4d);
      return inside.picture();
    },
    close: async (name) => {
      await pause(100);
      await post(`${name}.frame`, inside.seen);
      frames.delete(inside);
      frame.remove();
    },
  };
}

// Draws at the full resolution, however long it takes.
function whole(page) {
  page.quality.moving = page.quality.still = page.quality.kept = 1;
  page.redraw();
}

const differ = (a, b) => a.length !== b.length || a.reduce((sum, value, i) => sum + Math.abs(value - b[i]), 0) > a.length / 50;

async function pictures(design, shots) {
  const player = await open(`design=${design}&autoplay=0`);
  let opened = '/page/toybox.gs4d';
  for (const [index, shot] of shots.entries()) {
    if (/\/(index|parts|whole)\.gs4d$/.test(shot.file)) {
      if (shot.file !== opened) await player.page.openAddress(shot.file);
      opened = shot.file;
      // The time interval of the capture is 0 to 1.
      player.page.seek(shot.time * player.page.about.seconds);
      await until('all files of the time', () => player.page.thereShare === 1);
    } else if (shot.file !== opened) {
      const bytes = new Uint8Array(await (await fetch(shot.file)).arrayBuffer());
      await player.page.openBytes(shot.name, bytes);
      opened = shot.file;
    }
    Object.assign(player.frame.style, { width: `${shot.width}px`, height: `${shot.height}px` });
    await until('the size', () => player.at('canvas').width === shot.width && player.at('canvas').height === shot.height);
    await until('the device', () => player.page.player.is_ready());
    const picture = player.inside.picture();
    player.page.player.draw(shot.time, Float32Array.from(shot.pose), Float32Array.from(shot.lens));
    await post(`${design}-${index}`, await picture);
  }
  await player.close(design);
}

async function loading() {
  const slices = [];
  const draws = [];
  const pictures = [];
  let player;
  for (let i = 0; i < 3; i++) {
    player?.frame.remove();
    player = await open('autoplay=0');
    slices.push(player.page.times.longestSlice);
    draws.push(player.page.times.longestDraw);
    pictures.push(player.had('picture')[0].milliseconds);
  }
  const { page, had, inside } = player;
  await post('loading', { slices, draws, pictures, parts: had('progress').length, long: inside.seen.long });
  const bytes = new Uint8Array(await (await fetch('/page/toybox.gs4d')).arrayBuffer());
  const sizes = [];
  for (let i = 0; i < 24; i++) {
    await page.openBytes('toybox.gs4d', bytes.slice());
    sizes.push(page.times.memory());
  }
  await post('memory', { bytes: bytes.length, sizes });
  await files(player);
  await player.close('loading');
}

// A large capture: its steps are as long as those of a small one.
async function large() {
  const player = await open('autoplay=0');
  const { page, inside } = player;
  const bytes = new Uint8Array(await (await fetch('/large.gs4d')).arrayBuffer());
  const slices = [];
  for (let i = 0; i < 3; i++) {
    page.times.longestSlice = 0;
    await page.openBytes('large.gs4d', bytes);
    slices.push(page.times.longestSlice);
  }
  await post('large', { slices, gaussians: page.about.gaussians, long: inside.seen.long });
  await player.close('large');
}

async function limits() {
  const player = await open('test=limits&autoplay=0');
  await post('limits', { ...player.inside.seen.limits, pictured: player.had('picture').length === 1, text: player.at('text').textContent });
  await player.close('limits');
}

async function seeking() {
  const player = await open('time=1.5&camera=1,0.4,6,0,0,0.5', 800, 200);
  const { page, key, at, picture } = player;
  const results = {};
  results['a link sets the time and does not play'] = page.seconds === 1.5 && !page.playing;
  results['a link sets the camera'] = page.link().includes('camera=1%2C0.4%2C6%2C0%2C0%2C0.5');
  results['the link of the view has the time'] = page.link().includes('time=1.5');
  const first = await picture();
  at('seek').value = 0.75;
  at('seek').dispatchEvent(new Event('input'));
  results['the slider sets the time'] = page.seconds === 3;
  results['another time is another picture'] = differ(first, await picture());
  key('5');
  results['digits seek'] = page.seconds === 2;
  key('.');
  results['a point steps by a frame'] = Math.abs(page.seconds - 2 - 1 / 30) < 1e-6;
  key('j');
  results['j goes back'] = page.seconds < 2;
  key('>');
  results['> makes it faster'] = at('speed').value === '2';
  key(' ');
  results['space plays'] = page.playing && at('play').getAttribute('aria-label') === 'Pause';
  const before = page.seconds;
  await until('time passes', () => page.seconds !== before);
  at('play').click();
  results['the button pauses'] = !page.playing;
  key(' ', at('play'));
  results['keys of a button are its own'] = !page.playing;
  results['all controls can have the focus'] = ['play', 'seek', 'speed', 'home', 'open', 'link', 'full', 'canvas'].every((id) => {
    at(id).focus();
    return player.inside.document.activeElement === at(id);
  });
  await post('seeking', results);
  await orbit(player);
  await phone(player);
  await player.close('seeking');
}

async function orbit(player) {
  const { inside, at, page, key, picture } = player;
  const results = {};
  let camera = new URL(page.link()).searchParams.get('camera');
  const moved = (name) => {
    const now = new URL(page.link()).searchParams.get('camera');
    results[name] = now !== camera;
    camera = now;
  };
  key('Home', at('canvas'));
  camera = new URL(page.link()).searchParams.get('camera');
  const first = await picture();
  const pointer = (type, pointerId, clientX, clientY, more = {}) =>
    at('canvas').dispatchEvent(new inside.PointerEvent(type, { pointerId, clientX, clientY, bubbles: true, buttons: 1, ...more }));
  at('canvas').setPointerCapture = () => {};
  pointer('pointerdown', 1, 100, 100);
  pointer('pointermove', 1, 140, 90);
  pointer('pointerup', 1, 140, 90);
  moved('a mouse turns the camera');
  results['another camera is another picture'] = differ(first, await picture());
  pointer('pointermove', 1, 180, 90);
  results['a mouse without a button turns nothing'] = new URL(page.link()).searchParams.get('camera') === camera;
  const apart = () => Number(camera.split(',')[2]);
  const old = apart();
  pointer('pointerdown', 2, 100, 100, { pointerType: 'touch' });
  pointer('pointerdown', 3, 120, 100, { pointerType: 'touch' });
  pointer('pointermove', 3, 160, 100, { pointerType: 'touch' });
  pointer('pointerup', 2, 0, 0);
  pointer('pointerup', 3, 0, 0);
  moved('two fingers move the camera');
  results['fingers that spread come nearer'] = apart() < old;
  at('canvas').dispatchEvent(new inside.WheelEvent('wheel', { deltaY: 100, bubbles: true, cancelable: true }));
  moved('a wheel moves the camera');
  for (const name of ['ArrowLeft', 'ArrowUp', '+']) {
    key(name, at('canvas'));
    moved(`${name} moves the camera`);
  }
  key('Home', at('canvas'));
  moved('home returns');
  results['home is the first camera'] = !differ(first, await picture());
  await post('orbit', results);
}

async function messages() {
  const player = await open('autoplay=0&controls=0&loop=0');
  const { page, had, tell, at, inside } = player;
  const results = {};
  results['the page is told of the capture'] = had('ready').length === 1 && had('loaded')[0]?.seconds === 4;
  results['there are no controls'] = inside.getComputedStyle(at('controls')).display === 'none';
  tell('play');
  await until('playing', () => had('playing').length === 1);
  results['it plays'] = page.playing;
  tell('pause');
  await until('paused', () => had('paused').length === 1);
  results['it pauses'] = !page.playing;
  tell('seek', 2.5);
  await until('a time', () => had('time').some((event) => event.seconds === 2.5));
  results['it seeks'] = page.seconds === 2.5;
  tell('camera', '0,0.3,5,0,0,0.5');
  await until('the camera', () => page.link().includes('camera=0%2C0.3'));
  tell('camera', { pose: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 4, 1], lens: [0.5, 0.3] });
  tell('speed', 4);
  tell('play');
  await until('the end', () => had('ended').length === 1);
  results['it ends where it does not repeat'] = page.seconds === 4;
  tell('open', '/page/nothing.gs4d');
  await until('an error', () => had('error').length === 1);
  results['the page is told of a file that is not there'] = had('error')[0].message.includes('404');
  for (const [index, order] of ['nonsense', '__proto__', 'camera'].entries()) {
    tell(order, { pose: 'nonsense' });
    await until('an error', () => had('error').length === 2 + index);
  }
  inside.postMessage('of somebody else', '*');
  await pause(50);
  results['messages of somebody else are ignored'] = inside.seen.errors.length === 0 && had('error').length === 4;
  inside.seen.console = inside.seen.console.filter((text) => !text.includes('404'));
  await post('messages', results);
  await player.close('messages');
}

async function files(player) {
  const { page, inside, at, had, picture } = player;
  const golden = new Uint8Array(await (await fetch(shots[0].file)).arrayBuffer());
  const drop = (name, bytes) => {
    const dataTransfer = new inside.DataTransfer();
    dataTransfer.items.add(new inside.File([bytes], name));
    inside.document.body.dispatchEvent(new inside.DragEvent('dragover', { dataTransfer, bubbles: true, cancelable: true }));
    const asked = !at('drop').hidden;
    inside.document.body.dispatchEvent(new inside.DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true }));
    return asked;
  };
  const before = await picture();
  const loaded = had('loaded').length;
  const dropped = {};
  dropped['the page says that it takes the file'] = drop('own.gs4d', golden);
  await until('another capture', () => had('loaded').length === loaded + 1);
  dropped['it is another capture'] = page.about.gaussians !== 45000;
  dropped['it is shown'] = differ(before, await picture());
  dropped['the link does not name it'] = !page.link().includes('capture=');
  await post('dropped', dropped);
  const broken = {};
  const shown = await picture();
  const damaged = golden.slice();
  damaged[damaged.length - 3] ^= 0x55;
  for (const [what, name, bytes] of [
    ['a file that is cut off', 'cut.gs4d', golden.slice(0, golden.length / 2)],
    ['a damaged file', 'damaged.gs4d', damaged],
    ['a picture', 'photo.png', Uint8Array.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10])],
    ['an empty file', 'empty.gs4d', new Uint8Array()],
  ]) {
    const told = had('error').length;
    drop(name, bytes);
    await until(what, () => had('error').length > told);
    broken[`${what}: a message names the file`] = !at('message').hidden && at('text').textContent.includes(name);
    at('close').click();
    broken[`${what}: the message can be closed`] = at('message').hidden;
    broken[`${what}: the capture stays`] = !differ(shown, await picture());
  }
  await post('broken', broken);
}

// A capture in chunk files.
async function take() {
  const player = await open('capture=/slow/index.gs4d&autoplay=0');
  const { page, had, at, inside, picture } = player;
  const results = {};
  results['its Gaussians are counted, and it has a length'] = page.about.gaussians === 4000 && page.about.seconds === 2;
  const requests = () => inside.performance.getEntriesByType('resource').filter((one) => one.name.includes('/slow/chunk-')).length;
  results['it is shown before all of its files are there'] = page.thereShare > 0 && page.thereShare < 1;
  const coarse = await picture();
  await fetch('/slow/finer');
  await until('all files', () => page.thereShare === 1);
  const first = await picture();
  results['further layers make the picture finer'] = differ(coarse, first);
  // The boundary of a stretch whose first layer is missing.
  page.seek(1.5);
  await until('the time waits', () => had('buffering').length === 1);
  results['the picture of before stays'] = page.buffering && !differ(first, await picture());
  page.play();
  await pause(200);
  results['the time waits for its most important Gaussians, and says so'] = page.buffering && page.seconds === 1.5 && !at('loading').hidden;
  await fetch('/slow/last');
  await until('the other time', () => had('buffered').length === 1);
  await until('a loop', () => had('ended').length > 0);
  results['it plays on in a loop'] = page.playing && page.seconds < 1.5;
  results['nothing is waited for any more'] = had('buffering').length === 1 && at('loading').hidden;
  page.play(false);
  await until('all files', () => page.thereShare === 1);
  const asked = requests();
  page.seek(1.5);
  results['another time is another picture'] = differ(first, await picture());
  await pause(300);
  results['files that are there are not fetched again'] = requests() === asked && page.thereShare === 1;
  await page.openAddress('/page/toybox.gs4d');
  results['another capture takes its place'] = page.about.gaussians === 45000 && page.thereShare === 1;
  results['no message'] = at('message').hidden;
  await post('take', results);
  await player.close('take');
}

async function faults() {
  const player = await open('capture=/flaky/index.gs4d&autoplay=0');
  const { page, had, at, inside, picture } = player;
  const results = {};
  await until('all files', () => page.thereShare === 1);
  results['requests that fail are made again'] = had('error').length === 0 && page.about.gaussians === 4000;
  const shown = await picture();
  page.openAddress('/lossy/index.gs4d');
  await until('a message', () => had('error').length === 1);
  results['a file that is missing is named'] = at('text').textContent.includes('chunk-00001-of-');
  results['the capture of before stays'] = page.about.gaussians === 4000 && !differ(shown, await picture());
  at('close').click();
  page.openAddress('http://[');
  await until('a message', () => had('error').length === 2);
  results['an address that is none is refused'] = at('text').textContent.includes('is no address');
  at('close').click();
  const bytes = new Uint8Array(await (await fetch('/take/index.gs4d')).arrayBuffer());
  await page.openBytes('index.gs4d', bytes);
  await until('a message', () => had('error').length === 3);
  results['an index alone is refused, and the remedy told'] = at('text').textContent.includes('gs4d join');
  at('close').click();
  const names = (await (await fetch('take.json')).json()).filter((name) => name !== 'index.gs4d');
  const read = async (name) => new inside.File([await (await fetch(`/take/${name}`)).arrayBuffer()], name);
  const dataTransfer = new inside.DataTransfer();
  for (const name of [...names, 'index.gs4d']) dataTransfer.items.add(await read(name));
  const before = had('loaded').length;
  inside.document.body.dispatchEvent(new inside.DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true }));
  await until('the files of this device', () => had('loaded').length > before && page.thereShare === 1);
  results['the files of a folder can be dropped together'] = had('error').length === 3;
  page.player.receive_file = () => {
    throw new inside.WebAssembly.RuntimeError('unreachable');
  };
  page.openAddress('/take/index.gs4d');
  await until('a message', () => had('error').length === 4);
  results['a page that runs out of memory while files arrive says so'] = at('text').textContent.includes('out of memory');
  inside.seen.console = inside.seen.console.filter((text) => !/503|404/.test(text));
  await post('faults', results);
  await player.close('faults');
}

// A capture whose chunk files follow their index in one file.
async function parts() {
  const player = await open('capture=/parts.gs4d&autoplay=0');
  const { page, had, at, inside } = player;
  const results = {};
  await until('all files', () => page.thereShare === 1);
  results['its Gaussians are counted'] = page.about.gaussians === 4000 && page.about.seconds === 2;
  const requests = () => inside.performance.getEntriesByType('resource').filter((one) => one.name.endsWith('/parts.gs4d')).length;
  results['the file, a byte of it to see whether there are parts, and parts are fetched'] = requests() > 4;
  const opened = page.openAddress('/whole.gs4d');
  // What is said stays for four seconds.
  await until('the server without parts is named', () => at('said').textContent.includes(`${location.host} sends no parts of files`));
  await opened;
  results['and the capture played whole'] = page.about.gaussians === 4000 && page.thereShare === 1;
  const bytes = new Uint8Array(await (await fetch('/whole.gs4d')).arrayBuffer());
  const before = requests();
  await page.openBytes('one.gs4d', bytes);
  await until('the parts of a file of this device', () => page.about.gaussians === 4000 && page.thereShare === 1);
  results['of a file of this device parts are read, too'] = requests() === before;
  results['no message'] = at('message').hidden && had('error').length === 0;
  await post('parts', results);
  await player.close('parts');
}

async function missing() {
  const player = await open('test=missing');
  const results = {};
  results['there is a message'] = !player.at('message').hidden;
  results['it names browsers that can'] = /WebGPU.*Chrome/.test(player.at('text').textContent);
  results['the page around is told'] = player.had('error').length === 1;
  await until('the poster', () => !player.at('poster').hidden);
  results['there is a poster'] = !player.at('poster').hidden && player.at('poster').naturalWidth > 0;
  await post('missing', results);
  player.frame.remove();
}

async function phone(player) {
  Object.assign(player.frame.style, { width: '360px', height: '640px' });
  await until('the layout', () => player.at('canvas').clientWidth === 360);
  whole(player.page);
  await until('the size', () => player.at('canvas').width === 360 && player.at('canvas').height === 640);
  const results = {};
  for (const id of ['play', 'seek', 'speed', 'background', 'home', 'open', 'link', 'full', 'keys']) {
    const box = player.at(id).getBoundingClientRect();
    results[`${id} is within the screen and large enough for a finger`] = box.left >= 0 && box.right <= 360 && box.bottom <= 640 && box.width >= 44 && box.height >= 44;
  }
  results['nothing scrolls'] = player.inside.document.documentElement.scrollWidth <= 360;
  await post('phone', results);
}

// The same page with the Bevy app, if it is built.
async function bevy(shots) {
  if (!(await fetch('/page/player_bevy.js')).ok) return;
  // In so small a picture an app draws a level of detail: here all Gaussians. Its many passes take minutes to compile on a busy machine.
  const player = await open('engine=bevy&autoplay=0&detail=8', 320, 180, 200);
  for (const [index, shot] of shots.entries()) {
    if (shot.file !== '/page/toybox.gs4d') continue;
    Object.assign(player.frame.style, { width: `${shot.width}px`, height: `${shot.height}px` });
    await until('the size', () => player.at('canvas').width === shot.width && player.at('canvas').height === shot.height);
    player.page.player.draw(shot.time, Float32Array.from(shot.pose), Float32Array.from(shot.lens));
    await until('the picture', () => player.page.player.is_ready());
    await post(`bevy-${index}`, await player.inside.picture(6));
  }
  const results = {};
  for (const address of ['/take/index.gs4d', '/parts.gs4d']) {
    await player.page.openAddress(address);
    results[`the app streams ${address}`] = player.page.about.gaussians === 4000 && player.had('error').length === 0;
    await until('the picture', () => player.page.player.is_ready());
  }
  const parts = player.inside.performance.getEntriesByType('resource').filter((one) => one.name.endsWith('/parts.gs4d'));
  results['the app fetches parts of one file'] = parts.length > 4;
  await post('app-streams', results);
  // Bevy writes its adapter to the log.
  await player.close('bevy');
}

const shots = await (await fetch('shots.json')).json();
try {
  await loading();
  await large();
  await limits();
  await seeking();
  await messages();
  await take();
  await faults();
  await parts();
  await missing();
  for (const design of ['sort', 'bins']) await pictures(design, shots);
  await bevy(shots);
} catch (error) {
  await post('failure', String(error.stack ?? error));
}
await post('end', {});

// People at the page: keyboard alone, a phone, forced colors, another page around, slow devices, slow links, broken files.
// In: node people.mjs FOLDER MODULES BROWSER [SHOTS]: the folder of the built page, node_modules with playwright-core and axe-core, the browser's program,
// perhaps a folder for screenshots. Out: one JSON object on standard output: groups of checks, each true or what was found instead.

import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { readFile } from 'node:fs/promises';
import { gzipSync } from 'node:zlib';
import { join, resolve } from 'node:path';

const [folder, modules, program, shots] = process.argv.slice(2);
// The groups to run; all if it is not set.
const only = process.env.GS4D_WEB_ONLY?.split(',');
const require = createRequire(join(resolve(modules), 'x.js'));
const { chromium } = require('playwright-core');
const axe = await readFile(join(modules, 'axe-core/axe.min.js'), 'utf8');

// The server -----------------------------------------------------------------------------------------------------------

const KINDS = { html: 'text/html; charset=utf-8', js: 'text/javascript', css: 'text/css', wasm: 'application/wasm', jpg: 'image/jpeg' };
const toybox = await readFile(join(folder, 'toybox.gs4d'));
const still = process.env.GS4D_STILL ? await readFile(process.env.GS4D_STILL) : null;
// A package in layers, the bytes up to the end of the first one, and the same package with damage at its end.
const progressive = process.env.GS4D_PROGRESSIVE ? await readFile(process.env.GS4D_PROGRESSIVE) : null;
const layer = Number(process.env.GS4D_LAYER);
const spoiled = progressive && Buffer.from(progressive);
if (spoiled) spoiled[spoiled.length - 3] ^= 0x55;
// What follows a first layer, once a test asks for it.
const rests = {
  'progressive.gs4d': (response) => response.end(progressive.subarray(layer)),
  'torn.gs4d': (response) => response.destroy(),
  'spoiled.gs4d': (response) => response.end(spoiled.subarray(layer)),
};
let release = () => {};

// A page around, taller than the screen, that notes what the player tells.
const around = (query, allow) => `<!doctype html><title>around</title><h1>Around</h1>
<iframe id="player" src="${origin}/index.html?${query}" width="480" height="270" title="A capture" ${allow ? 'allow="fullscreen"' : ''}></iframe><div style="height: 3000px"></div>
<script>window.told = []; addEventListener('message', (event) => told.push(event.data));
window.tell = (data) => document.getElementById('player').contentWindow.postMessage(data, '*');</script>`;

const server = createServer(async (request, response) => {
  const url = new URL(request.url, 'http://localhost');
  const path = url.pathname.slice(1) || 'index.html';
  const send = (body, type = 'application/octet-stream', more = {}) => {
    response.writeHead(200, { 'Content-Type': type, 'Content-Length': body.length, ...more });
    response.end(body);
  };
  if (path === 'around') return send(Buffer.from(around(url.searchParams.get('query') ?? '', url.searchParams.has('full'))), KINDS.html);
  if (path === 'cut.gs4d') {
    response.writeHead(200, { 'Content-Length': toybox.length });
    response.write(toybox.subarray(0, 300_000));
    return setTimeout(() => response.destroy(), 300);
  }
  if (path === 'slow.gs4d') {
    response.writeHead(200, { 'Content-Length': toybox.length });
    response.write(toybox.subarray(0, 100_000));
    return request.on('close', () => response.destroy());
  }
  if (path === 'empty.gs4d') return send(Buffer.alloc(0));
  if (path === 'page.gs4d') return send(Buffer.from('<!DOCTYPE html><title>Sign in</title>'), KINDS.html);
  if (path === 'junk.gs4d') return send(Buffer.from('something else entirely'));
  if (path === 'still.gs4d' && still) return send(still);
  if (Object.hasOwn(rests, path) && progressive) {
    response.writeHead(200, { 'Content-Length': progressive.length });
    response.write(progressive.subarray(0, layer >> 1));
    // The page takes the link for a slow one, and does not wait for the rest of the file.
    await new Promise((done) => setTimeout(done, 1500));
    response.write(progressive.subarray(layer >> 1, layer));
    release = () => rests[path](response);
    return;
  }
  if (path === 'release') {
    release();
    return send(Buffer.alloc(0));
  }
  try {
    send(await readFile(join(folder, path.replaceAll('..', ''))), KINDS[path.split('.').pop()]);
  } catch {
    response.writeHead(404).end();
  }
});
// Answers of another origin, compressed: longer and shorter than the file.
const coded = { '/coded.gs4d': gzipSync(toybox, { level: 0 }), '/zeros.gs4d': gzipSync(Buffer.alloc(200_000)) };
// The same files for pages of other origins: without the header that allows it.
const other = createServer((request, response) => {
  const body = coded[request.url];
  if (!body) return response.end(toybox);
  response.writeHead(200, { 'Access-Control-Allow-Origin': '*', 'Content-Encoding': 'gzip', 'Content-Length': body.length });
  response.end(body);
});
const listen = (one) => new Promise((done) => one.listen(0, '127.0.0.1', () => done(`http://127.0.0.1:${one.address().port}`)));
const [origin, foreign] = [await listen(server), await listen(other)];

// The browser ----------------------------------------------------------------------------------------------------------

const browser = await chromium.launch({
  executablePath: program,
  args: ['--no-sandbox', '--enable-unsafe-webgpu', '--enable-features=Vulkan', '--use-vulkan=swiftshader', '--use-angle=swiftshader', '--disable-background-networking'],
});
const results = {};
const failures = [];
// Other programs of a busy machine take time, too.
const busy = Math.max(1, Number(process.env.GS4D_BUSY) || 1);

// Opens the page, notes its events, and runs checks on it.
async function visit(group, query, work, { size = [480, 270], media = {}, hooks = '', path = '/index.html' } = {}) {
  if (only && !only.includes(group)) return;
  const context = await browser.newContext({ viewport: { width: size[0], height: size[1] }, hasTouch: size[0] < 400, ...media });
  await context.grantPermissions(['clipboard-read', 'clipboard-write']);
  const page = await context.newPage();
  const checks = (results[group] ??= {});
  await page.addInitScript(`window.told = []; for (const name of ['ready', 'progress', 'preview', 'loaded', 'picture', 'playing', 'paused', 'ended', 'time', 'error'])
    addEventListener('gs4d-' + name, (event) => told.push({ gs4d: name, at: performance.now(), ...event.detail })); ${hooks}`);
  const had = (name) => page.evaluate((name) => told.filter((one) => one.gs4d === name), name);
  const until = (name, count = 1, timeout = 60000) => page.waitForFunction(([name, count]) => told.filter((one) => one.gs4d === name).length >= count, [name, count], { timeout });
  const check = (what, value, found = null) => (checks[what] = value === true ? true : `not so: ${JSON.stringify(found ?? value)}`);
  const shot = async (name) => shots && page.screenshot({ path: join(shots, `${name}.png`) });
  try {
    // A page around is of another origin.
    await page.goto(`${path === '/around' ? origin.replace('127.0.0.1', 'localhost') : origin}${path}${query ? `?${query}` : ''}`);
    await work({ page, check, had, until, shot });
  } catch (error) {
    failures.push(`${group}: ${error.message.split('\n')[0]}`);
    checks['ran to its end'] = String(error.message).slice(0, 300);
  }
  await context.close();
}

const text = (page, id) => page.locator(`#${id}`).textContent();
const seconds = (page) => page.evaluate(() => gs4d.seconds);
// In a page, or in a frame of one.
const camera = (page) => page.evaluate(() => new URL(gs4d.link()).searchParams.get('camera'));

// Accessibility --------------------------------------------------------------------------------------------------------

async function accessible(page, check, what) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ['violations'] }));
  const serious = violations.filter((one) => ['serious', 'critical'].includes(one.impact)).map((one) => `${one.id}: ${one.nodes[0].html}`);
  check(`axe finds nothing serious ${what}`, serious.length === 0, serious);
}

for (const [name, media] of [['dark', { colorScheme: 'dark' }], ['light', { colorScheme: 'light' }], ['forced colors', { forcedColors: 'active' }]]) {
  await visit('accessibility', 'autoplay=0', async ({ page, check, until, shot }) => {
    await until('picture');
    await accessible(page, check, `in ${name}`);
    await page.evaluate(() => gs4d.setBackground('white'));
    await page.keyboard.press('l');
    await page.waitForFunction(() => document.getElementById('said').textContent);
    await accessible(page, check, `with a toast over white in ${name}`);
    const icon = await page.evaluate(() => {
      const color = (text) => text.match(/[\d.]+/g).slice(0, 3).map(Number);
      const [ink, ground] = [getComputedStyle(document.querySelector('#home svg')).fill, getComputedStyle(document.getElementById('controls')).backgroundColor];
      return { ink, ground, apart: color(ink).reduce((sum, value, i) => sum + Math.abs(value - color(ground)[i]), 0) };
    });
    check(`icons stand out in ${name}`, icon.apart > 250, icon);
    await page.keyboard.press('?');
    check(`the keys are listed in ${name}`, await page.locator('#help[open] kbd').count() > 15);
    await accessible(page, check, `with the list of keys in ${name}`);
    await page.keyboard.press('Escape');
    await shot(`accessibility-${name.replace(' ', '-')}`);
  }, { media });
}

// Keyboard alone -------------------------------------------------------------------------------------------------------

await visit('keyboard', 'autoplay=0', async ({ page, check, until }) => {
  await until('picture');
  const stops = [];
  for (let i = 0; i < 6; i++) {
    await page.keyboard.press('Tab');
    stops.push(await page.evaluate(() => document.activeElement?.id || document.activeElement?.tagName));
  }
  check('tab stops are the view, play, the time and one for the toolbar', ['canvas', 'play', 'seek', 'speed'].every((id, i) => stops[i] === id), stops);
  await page.locator('#seek').focus();
  await page.keyboard.press('ArrowRight');
  check('an arrow key moves the time by a frame', Math.abs((await seconds(page)) - 1 / 30) < 1e-6, await seconds(page));
  check('the slider says its time', (await page.getAttribute('#seek', 'aria-valuetext')).startsWith('0.0 / 4.0'));
  await page.keyboard.press('End');
  check('End is the end', (await seconds(page)) === 4);
  await page.locator('#speed').focus();
  const visited = [];
  for (let i = 0; i < 7; i++) {
    visited.push(await page.evaluate(() => document.activeElement.id));
    await page.keyboard.press('ArrowRight');
  }
  check('arrow keys go through the toolbar and round', visited.join() === 'speed,background,home,open,link,full,keys' && (await page.evaluate(() => document.activeElement.id)) === 'speed', visited);
  check('no arrow of the toolbar changes the speed', (await page.locator('#speed').inputValue()) === '1');
  check('the clock is no live region', await page.evaluate(() => !document.getElementById('time').closest('[aria-live], output, [role=status], [role=timer]')));
  check('the view takes arrow keys from screen readers', (await page.getAttribute('#canvas', 'role')) === 'application');
  await page.locator('#canvas').focus();
  let before = await camera(page);
  for (const key of ['ArrowLeft', 'w', 'd', 'q', '+']) {
    await page.keyboard.down(key);
    await page.waitForFunction((before) => new URL(gs4d.link()).searchParams.get('camera') !== before, before, { timeout: 5000 }).catch(() => {});
    await page.keyboard.up(key);
    const now = await camera(page);
    check(`${key} moves the camera`, now !== before, now);
    before = now;
  }
  await page.keyboard.press('Home');
  check('the camera eases', await page.evaluate(() => !gs4d.settled));
  await page.waitForFunction(() => gs4d.settled);
  await page.keyboard.press('b');
  check('b changes the background', (await page.locator('#background').inputValue()) === 'black');
  await page.keyboard.press('?');
  check('a question mark opens the list of keys', await page.locator('#help').evaluate((one) => one.open));
  await page.keyboard.press('Escape');
  await page.keyboard.press(' ');
  check('space plays', await page.evaluate(() => gs4d.playing));
});

// A phone --------------------------------------------------------------------------------------------------------------

for (const size of [[390, 844], [320, 568]]) {
  // Playing, the controls fade, and colors that fade have no contrast.
  await visit('phone', 'autoplay=0', async ({ page, check, until, shot }) => {
    await until('picture');
    for (const id of ['play', 'seek', 'time', 'speed', 'background', 'home', 'open', 'link', 'full', 'keys']) {
      const box = await page.locator(`#${id}`).boundingBox();
      const fits = box && box.x >= 0 && box.x + box.width <= size[0] && box.y + box.height <= size[1] && (id === 'time' || (box.width >= 44 && box.height >= 44));
      check(`${id} is within ${size[0]} pixels and large enough for a finger`, Boolean(fits), box);
    }
    check(`nothing scrolls at ${size[0]}`, await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
    await accessible(page, check, `at ${size[0]} pixels`);
    await shot(`phone-${size[0]}`);
  }, { size });
}

await visit('phone', 'autoplay=0', async ({ page, check, until }) => {
  await page.waitForFunction(() => !document.getElementById('poster').hidden, null, { timeout: 20000 });
  const box = await page.locator('#poster').boundingBox();
  check('the poster has the scale of the picture: its height is the width of the screen', Math.abs(box.height - 390) <= 1, box);
  await until('picture');
}, { size: [390, 844] });

// Failures -------------------------------------------------------------------------------------------------------------

await visit('failures', 'autoplay=1&title=First', async ({ page, check, had, until, shot }) => {
  await until('picture');
  const fails = async (address) => {
    const before = (await had('error')).length;
    await page.evaluate((address) => void gs4d.openAddress(address), address);
    await until('error', before + 1);
    return text(page, 'text');
  };
  let said = await fails('cut.gs4d');
  check('a download that is cut off says so, with its bytes', /connection ended after 0\.3 MB of 0\.9 MB|connection ended after/.test(said), said);
  check('and can be tried again', await page.locator('#again').isVisible());
  const [message, stage] = [await page.locator('#message').boundingBox(), { width: 480, height: 270 }];
  check('a message leaves the capture in sight', message.width * message.height < 0.6 * stage.width * stage.height, message);
  await shot('failure');
  await page.locator('#close').click();
  check('and can be closed', await page.locator('#message').isHidden());
  check('the capture still plays', await page.evaluate(() => gs4d.playing));
  said = await fails(`${foreign}/toybox.gs4d`);
  check('a server that does not allow it is told from one that does not answer', said.includes('Access-Control-Allow-Origin'), said);
  await page.keyboard.press('Escape');
  check('Escape closes the message', await page.locator('#message').isHidden());
  said = await fails('http://127.0.0.1:9/x.gs4d');
  check('a server that does not answer is named', said.includes('does not answer') && said.includes('127.0.0.1:9'), said);
  said = await fails('nothing.gs4d');
  check('a missing file has the answer of the server', said.includes('404'), said);
  said = await fails('empty.gs4d');
  check('an empty file is named so', said.includes('is empty'), said);
  said = await fails('page.gs4d');
  check('a page in place of a file is named so', said.includes('web page'), said);
  said = await fails('junk.gs4d');
  check('junk is no known format', said.includes('neither'), said);
  await fails(`${foreign}/zeros.gs4d`);
  const received = (await had('progress')).filter((one) => one.name === 'zeros.gs4d' && one.bytes > 0);
  check('no more bytes are received than there are', received.length > 0 && received.every((one) => !one.total || one.bytes <= one.total), received);
  const before = (await had('loaded')).length;
  await page.evaluate((address) => void gs4d.openAddress(address), `${foreign}/coded.gs4d`);
  // A compressed answer may be longer than the file.
  await until('loaded', before + 1);
  check('what is opened after a failure plays', await page.evaluate(() => gs4d.playing));
  const link = new URL(await page.evaluate(() => gs4d.link())).searchParams;
  check('a link to another capture has not the title of the first', link.get('capture') === `${foreign}/coded.gs4d` && !link.has('title'), link.toString());
  await page.evaluate(() => {
    gs4d.player.step = () => {
      throw new WebAssembly.RuntimeError('unreachable');
    };
  });
  said = await fails('toybox.gs4d');
  check('a page without memory says so, and the remedy', said.includes('toybox.gs4d') && said.includes('out of memory') && said.includes('gs4d compress'), said);
  check('and can be loaded again', (await page.locator('#again').isVisible()) && (await text(page, 'again')) === 'Load the page again');
});

await visit('failures', 'capture=nothing.gs4d', async ({ page, check, until }) => {
  await until('error');
  const bytes = [...toybox];
  await page.locator('#file').setInputFiles({ name: 'toybox.gs4d', mimeType: 'application/octet-stream', buffer: Buffer.from(bytes) });
  await until('picture');
  check('a file that is opened after the first one failed plays', await page.evaluate(() => gs4d.playing));
  check('its link says that the file is on this device', !(await page.evaluate(() => gs4d.link())).includes('capture='));
});

await visit('failures', 'capture=slow.gs4d', async ({ page, check, until, shot }) => {
  await page.waitForFunction(() => document.getElementById('loading-text').textContent.includes('slow.gs4d') && document.getElementById('progress').value > 0);
  const said = await text(page, 'loading-text');
  check('loading says name, share and bytes', /slow\.gs4d \d+ %, 0\.1 MB of \d\.\d MB/.test(said), said);
  await shot('loading');
  await page.locator('#cancel').click();
  check('it can be cancelled', (await text(page, 'text')).includes('cancelled'));
  await page.locator('#file').setInputFiles({ name: 'toybox.gs4d', mimeType: 'application/octet-stream', buffer: toybox });
  await until('picture');
  check('a file that is opened in place of a slow one plays', await page.evaluate(() => gs4d.playing));
});

await visit('failures', '', async ({ page, check, until, shot }) => {
  await until('error');
  const said = await text(page, 'text');
  check('browsers with WebGPU are named', /Chrome.*Safari.*Firefox/.test(said), said);
  check('no button looks alive that does nothing', await page.evaluate(() => [...document.querySelectorAll('#controls button, #controls select, #controls input')].every((one) => one.disabled || one.id === 'keys')));
  const stays = await page.evaluate(() => {
    const event = new DragEvent('drop', { dataTransfer: new DataTransfer(), bubbles: true, cancelable: true });
    event.dataTransfer.items.add(new File(['x'], 'x.gs4d'));
    return !document.body.dispatchEvent(event);
  });
  check('a dropped file does not leave the page', stays);
  await accessible(page, check, 'without WebGPU');
  await shot('without-webgpu');
}, { hooks: "Object.defineProperty(Navigator.prototype, 'gpu', { get: () => undefined });" });

// Links ----------------------------------------------------------------------------------------------------------------

await visit('links', 'time=1.5&camera=1,0.4,6,0,0,0.5&scale=0.5&loop=0&controls=1&poster=poster.jpg&speed=2&title=Dancer', async ({ page, check, until }) => {
  await until('picture');
  check('a link to a view shows no poster of another one', await page.locator('#poster').isHidden());
  check('the view of the link is shown', (await seconds(page)) === 1.5 && !(await page.evaluate(() => gs4d.playing)));
  const query = new URL(await page.evaluate(() => gs4d.link())).searchParams;
  for (const [name, value] of Object.entries({ scale: '0.5', loop: '0', controls: '1', poster: 'poster.jpg', speed: '2', title: 'Dancer', time: '1.500', camera: '1,0.4,6,0,0,0.5' })) {
    check(`a copied link keeps ${name}`, query.get(name) === value, query.get(name));
  }
});

// Another page around --------------------------------------------------------------------------------------------------

await visit('embedding', 'query=autoplay%3D0', async ({ page, check }) => {
  const had = (name) => page.evaluate((name) => told.filter((one) => one.gs4d === name), name);
  const until = (name, count = 1) => page.waitForFunction(([name, count]) => told.filter((one) => one.gs4d === name).length >= count, [name, count], { timeout: 60000 });
  const tell = (data) => page.evaluate((data) => tell(data), data);
  await until('picture');
  const frame = page.frames()[1];
  await page.mouse.move(240, 200);
  await page.mouse.wheel(0, 300);
  await frame.waitForFunction(() => document.getElementById('said').textContent.includes('Ctrl'), null, { timeout: 3000 }).catch(() => {});
  check('the player says how to zoom', (await frame.locator('#said').textContent()).includes('Ctrl'));
  await page.waitForFunction(() => scrollY > 0, null, { timeout: 3000 }).catch(() => {});
  check('the wheel scrolls the page around', (await page.evaluate(() => scrollY)) > 0);
  // The wheel scrolls smoothly, and the browser finds what is below the pointer some frames later.
  await page.waitForTimeout(1500);
  await page.evaluate(() => scrollTo(0, 0));
  await page.waitForTimeout(1000);
  await frame.locator('#canvas').click({ position: { x: 200, y: 70 } });
  const before = await camera(frame);
  await page.mouse.wheel(0, 300);
  await frame.waitForFunction((before) => new URL(gs4d.link()).searchParams.get('camera') !== before, before, { timeout: 5000 }).catch(() => {});
  check('after a click the wheel zooms', (await camera(frame)) !== before);
  check('and does not scroll the page around', (await page.evaluate(() => scrollY)) === 0);
  for (const data of [{ gs4d: 'seek', value: 'nonsense' }, { gs4d: 'seek' }, { gs4d: 'fly' }, { gs4d: 'camera', value: 'x' }, { gs4d: 'open', value: 7 }]) {
    const errors = (await had('error')).length;
    await tell({ gs4d: 'seek', value: 1 });
    await tell(data);
    await until('error', errors + 1);
    check(`${JSON.stringify(data)} is an error`, true);
    check(`${JSON.stringify(data)} changes nothing`, (await frame.evaluate(() => gs4d.seconds)) === 1);
  }
  const times = (await had('time')).length;
  await tell({ gs4d: 'play' });
  await until('time', times + 2);
  check('the time is told while it plays', true);
  await tell({ gs4d: 'pause' });
  await until('paused');
  await frame.locator('#full').click();
  await frame.waitForFunction(() => document.getElementById('said').textContent.includes('may not fill'), null, { timeout: 3000 });
  check('full screen without permission is said', true);
}, { size: [640, 480], path: '/around' });

// Waiting --------------------------------------------------------------------------------------------------------------

await visit('collapsed', 'autoplay=0', async ({ page, check, had, until }) => {
  await until('picture');
  const size = (style) => page.evaluate((style) => Object.assign(document.getElementById('stage').style, style), style);
  await size({ height: '0px', minHeight: '0px' });
  await page.waitForFunction(() => document.getElementById('canvas').clientHeight === 0, null, { timeout: 5000 });
  await page.evaluate(() => gs4d.seek(1));
  await page.waitForTimeout(500);
  check('a picture without a height is no error', (await had('error')).length === 0, await had('error'));
  check('no message is shown', await page.locator('#message').isHidden());
  await size({ height: '', minHeight: '' });
  await page.waitForFunction(() => document.getElementById('canvas').clientHeight > 0, null, { timeout: 5000 });
  await page.evaluate(() => gs4d.play());
  await page.waitForFunction(() => gs4d.seconds > 1, null, { timeout: 20000 });
  check('it plays once it has a height again', (await had('error')).length === 0 && (await page.locator('#message').isHidden()));
});

await visit('waiting', '', async ({ page, check, had, until }) => {
  await until('picture', 1, 90000);
  const first = (await had('picture'))[0];
  results.figures = { 'first picture at 1280x720, ms': Math.round(first.milliseconds) };
  const early = (await had('time')).filter((one) => one.at < first.at);
  check('the clock stands until the first picture', (await had('playing')).length === 1 && early.every((one) => one.seconds === 0), early);
  check('the first picture comes within 25 s', first.milliseconds <= 25_000 * busy, first.milliseconds);
  const tasks = () => page.evaluate(() => long.filter((one) => one.startTime > gs4d.times.compiled).map((one) => Math.round(one.duration)));
  let long = await tasks();
  // Another program may have taken the time: the page is loaded again.
  for (let i = 0; i < 2 && long.some((one) => one > 50 * busy); i++) {
    await page.reload();
    await until('picture', 1, 90000);
    long = await tasks();
  }
  results.figures['long tasks after the code is compiled, ms'] = long;
  check('nothing blocks the page once the code is compiled', long.every((one) => one <= 50 * busy), long);
  // The first pictures tell how slow the device is.
  const pictures = page.evaluate(() => new Promise((done) => {
    let [count, start] = [0, 0];
    setTimeout(() => done(0), 60000);
    const draw = gs4d.player.draw.bind(gs4d.player);
    gs4d.player.draw = (...all) => {
      count += 1;
      if (count === 3) {
        start = count;
        setTimeout(() => done((count - start) / 6), 6000);
      }
      draw(...all);
    };
  }));
  const rate = await pictures;
  results.figures['pictures a second while playing at 1280x720'] = +rate.toFixed(1);
  check('a slow device plays: a picture a second at least', rate >= 1 / busy, rate);
  const small = await page.evaluate(() => gs4d.share);
  check('the resolution is reduced', small < 0.6, small);
  const few = await page.evaluate(() => gs4d.gaussians);
  results.figures['share of the Gaussians while playing'] = few;
  check('Gaussians are left out', few < 1, few);
  await page.keyboard.press(' ');
  await page.waitForFunction((small) => gs4d.share > small * 1.5, small, { timeout: 40000 });
  check('a paused picture gets sharper', true);
  check('a paused picture has all Gaussians', (await page.evaluate(() => gs4d.gaussians)) === 1);
  // Frames of 1/30 s, as of a phone that saves power: after a slow picture, those that take two frames, then one.
  const shares = await page.evaluate(() => {
    const quality = new gs4d.quality.constructor();
    return [200, 66, 33].map((milliseconds) => {
      for (let i = 0; i < (milliseconds > 90 ? 1 : 100); i++) quality.learn(milliseconds, quality.share(true), true, 1000 / 30);
      return quality.share(true);
    });
  });
  check('pictures of two frames stay small at 30 frames a second', shares[0] < 1 && shares[1] === shares[0], shares);
  check('pictures of one frame become large again at 30 frames a second', shares[2] === 1, shares);
}, { size: [1280, 720], hooks: "window.long = []; new PerformanceObserver((list) => long.push(...list.getEntries())).observe({ entryTypes: ['longtask'] });" });

// Slow links -----------------------------------------------------------------------------------------------------------

const recorder = await readFile(new URL('hooks.js', import.meta.url), 'utf8');
// The share of the pixels of the next picture that are not black.
const drawn = (page) => page.evaluate(async () => {
  const picture = window.picture();
  gs4d.redraw();
  const pixels = await picture;
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) count += Math.max(pixels[i], pixels[i + 1], pixels[i + 2]) > 30;
  return (4 * count) / pixels.length;
});

if (progressive) {
  await visit('beginning', 'capture=progressive.gs4d&autoplay=0', async ({ page, check, had, until, shot }) => {
    await until('picture');
    const early = await had('preview');
    check('a picture comes before all of the file', early.length === 1 && (await had('loaded')).length === 0, early);
    const share = await drawn(page);
    check('it is not black', share > 0.05, share);
    check('the name is shown', (await text(page, 'title')) === 'progressive');
    const said = await text(page, 'loading-text');
    check('the page tells that it still receives the file', /progressive\.gs4d \d+ %/.test(said) && (await page.locator('#loading').isVisible()), said);
    const first = await camera(page);
    await page.locator('#canvas').focus();
    await page.keyboard.press('ArrowLeft');
    await page.evaluate(() => gs4d.seek(1.25));
    const turned = await camera(page);
    check('the camera can be moved', turned !== first, turned);
    await shot('beginning');
    await page.evaluate(async () => void (await fetch('release')));
    await until('loaded');
    const whole = (await had('loaded'))[0];
    check('the first picture has fewer Gaussians', early[0].gaussians > 0 && early[0].gaussians < whole.gaussians, [early, whole]);
    check('the whole capture is shown', (await page.evaluate(() => gs4d.about.gaussians)) === whole.gaussians, whole);
    check('the camera stays', (await camera(page)) === turned, await camera(page));
    check('the time stays', (await seconds(page)) === 1.25, await seconds(page));
    check('it does not play', !(await page.evaluate(() => gs4d.playing)));
    // How sharp depends on the device.
    const sharp = () => gs4d.share >= Math.min(1, gs4d.quality.moving * 1.5);
    await page.waitForFunction(sharp, null, { timeout: 40000 }).catch(() => {});
    const shares = await page.evaluate(() => [gs4d.share, gs4d.quality.moving]);
    check('the whole capture gets sharper at rest', await page.evaluate(sharp), shares);
    check('no progress is told any more', await page.locator('#loading').isHidden());
    const last = await drawn(page);
    check('the picture of all is not black', last > 0.05, last);
    check('there is one first picture', (await had('picture')).length === 1);
    await shot('beginning-whole');
  }, { hooks: recorder });

  await visit('beginning', 'capture=torn.gs4d', async ({ page, check, had, until }) => {
    await until('picture');
    const first = (await had('picture'))[0];
    const early = (await had('time')).filter((one) => one.at < first.at);
    check('the clock stands until the first picture', early.every((one) => one.seconds === 0), early);
    await until('time');
    check('the beginning plays', await page.evaluate(() => gs4d.playing));
    await page.evaluate(async () => void (await fetch('release')));
    await until('error');
    let said = await text(page, 'text');
    check('a file that is cut off after its first layer is told', said.includes('torn.gs4d') && said.includes('connection ended after'), said);
    check('its beginning still plays', (await page.evaluate(() => gs4d.playing)) && (await had('playing')).length === 1);
    await page.locator('#close').click();
    check('the message can be closed', await page.locator('#message').isHidden());
    const before = (await had('preview')).length;
    await page.evaluate(() => void gs4d.openAddress('spoiled.gs4d'));
    await until('preview', before + 1);
    await page.evaluate(async () => void (await fetch('release')));
    await until('error', 2);
    said = await text(page, 'text');
    check('damage behind the first layer is told', said.includes('spoiled.gs4d'), said);
    const about = await page.evaluate(() => gs4d.about.gaussians);
    check('its beginning stays', about === (await had('preview')).at(-1).gaussians && (await had('loaded')).length === 0, about);
  });
}

// Still captures -------------------------------------------------------------------------------------------------------

if (still) {
  await visit('stills', 'capture=still.gs4d', async ({ page, check, until, shot }) => {
    await until('picture');
    for (const id of ['play', 'seek', 'time', 'speed']) check(`a still has no ${id}`, await page.locator(`#${id}`).isHidden());
    check('its count is shown', /Gaussians$/.test((await text(page, 'count')).trim()), await text(page, 'count'));
    check('its name is shown', (await text(page, 'title')) === 'still');
    await shot('still');
  });
}

// The Bevy app in the same page, if it is built -------------------------------------------------------------------------

const hasBevy = await readFile(join(folder, 'player_bevy.js')).then(() => true, () => false);
if (hasBevy) {
  await visit('bevy', 'engine=bevy&autoplay=0', async ({ page, check, until, shot }) => {
    // Its many passes take minutes to compile on a software driver.
    await until('picture', 1, 240000);
    await accessible(page, check, 'around the app');
    await page.locator('#seek').focus();
    await page.keyboard.press('ArrowRight');
    check('an arrow key moves the time by a frame', Math.abs((await seconds(page)) - 1 / 30) < 1e-6);
    await page.locator('#speed').focus();
    await page.keyboard.press('ArrowRight');
    check('arrow keys go through the toolbar', (await page.evaluate(() => document.activeElement.id)) === 'background');
    await page.evaluate(() => void gs4d.openAddress('empty.gs4d'));
    await until('error');
    check('a failure can be closed', await page.locator('#close').isVisible());
    await page.keyboard.press('Escape');
    check('and leaves the capture', await page.locator('#message').isHidden());
    await shot('bevy');
  });
}

await browser.close();
server.closeAllConnections();
server.close();
other.closeAllConnections();
other.close();
if (failures.length) process.stderr.write(`${failures.join('\n')}\n`);
process.stdout.write(JSON.stringify(results));

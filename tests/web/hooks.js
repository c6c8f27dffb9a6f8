// Runs in a player before its own scripts: records what the browser says about the calls of the player, and copies pictures off the canvas.

window.seen = { shaders: [], errors: [], console: [], modules: 0, long: [] };
const asked = new URLSearchParams(location.search).get('test') ?? '';

for (const kind of ['warn', 'error']) {
  const original = console[kind];
  console[kind] = (...all) => {
    seen.console.push(all.map(String).join(' ').slice(0, 400));
    original.apply(console, all);
  };
}
addEventListener('error', (event) => seen.errors.push(String(event.message)));
addEventListener('unhandledrejection', (event) => seen.errors.push(String(event.reason)));
new PerformanceObserver((list) => seen.long.push(...list.getEntries().map((entry) => Math.round(entry.duration)))).observe({ entryTypes: ['longtask'] });

if (asked === 'missing') Object.defineProperty(Navigator.prototype, 'gpu', { get: () => undefined });

if (navigator.gpu) {
  const make = GPUDevice.prototype.createShaderModule;
  GPUDevice.prototype.createShaderModule = function (descriptor) {
    const module = make.call(this, descriptor);
    seen.modules += 1;
    module.getCompilationInfo().then((info) => {
      for (const message of info.messages) seen.shaders.push(`${descriptor.label} ${message.lineNum}: ${message.message}`.slice(0, 400));
    });
    return module;
  };
  const request = GPUAdapter.prototype.requestDevice;
  GPUAdapter.prototype.requestDevice = async function (descriptor) {
    if (asked === 'limits') delete descriptor.requiredLimits;
    const device = await request.call(this, descriptor);
    seen.limits = { storage: device.limits.maxStorageBuffersPerShaderStage, workgroup: device.limits.maxComputeWorkgroupStorageSize };
    device.addEventListener('uncapturederror', (event) => seen.errors.push(event.error.message.slice(0, 400)));
    return device;
  };
  // Resolves with the pixels of the canvas after so many submits. A canvas can be read only in the task that drew it; an app may submit further lists
  // in the task, after which the canvas is as it was.
  const wanted = [];
  window.picture = (submits = 1) => new Promise((resolve) => wanted.push({ resolve, submits }));
  const submit = GPUQueue.prototype.submit;
  GPUQueue.prototype.submit = function (lists) {
    submit.call(this, lists);
    if (!wanted.length) return;
    const canvas = document.getElementById('canvas');
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const pixels = copy.getImageData(0, 0, canvas.width, canvas.height).data;
    for (const one of wanted) {
      if (!one.pixels || pixels.some((value, i) => i % 4 < 3 && value > 0)) one.pixels = pixels;
      one.submits -= 1;
    }
    for (const one of wanted.filter((one) => one.submits <= 0)) one.resolve(one.pixels);
    wanted.splice(0, wanted.length, ...wanted.filter((one) => one.submits > 0));
  };
}

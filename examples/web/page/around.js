// The page around the player, and links to what it shows.
// In: messages of the page around, the query of the address. Out: events for it; links.

const framed = window.parent !== window;

// Tells the page, and the page around, of an event.
export function tell(event, details = {}) {
  document.getElementById('stage').dispatchEvent(new CustomEvent(`gs4d-${event}`, { detail: details, bubbles: true }));
  if (framed) window.parent.postMessage({ gs4d: event, ...details }, '*');
}

// Tells of a message that cannot be obeyed.
function object(text) {
  tell('error', { message: text });
}

// Returns a function that does what a message asks for. `player` has what can be asked.
export function obedient(player) {
  const number = (value, what, then) => {
    const is = (typeof value === 'number' || (typeof value === 'string' && value.trim() !== '')) && Number.isFinite(Number(value));
    if (is) then(Number(value));
    else object(`"${what}" needs a number as its value, not ${JSON.stringify(value)}`);
  };
  const orders = {
    play: () => player.play(),
    pause: () => player.play(false),
    seek: ({ value }) => number(value, 'seek', player.seek),
    speed: ({ value }) => number(value, 'speed', player.setSpeed),
    background: ({ value }) => player.setBackground(value) || object(`"background" needs trained, black, gray, white or six hexadecimal digits, not ${JSON.stringify(value)}`),
    open: ({ value, name }) => {
      if (typeof value === 'string') player.openAddress(value);
      else if (value instanceof ArrayBuffer) player.openBytes(String(name ?? 'capture'), new Uint8Array(value));
      else object('"open" needs an address or an ArrayBuffer as its value');
    },
    camera: ({ value }) => player.setCamera(value) || object('"camera" needs the text of a link, or {pose, lens} with 16 and 2 or 4 numbers'),
  };
  return (data) => {
    if (!data || typeof data !== 'object' || !Object.hasOwn(data, 'gs4d')) return;
    if (!Object.hasOwn(orders, data.gs4d)) return object(`there is no message ${JSON.stringify(data.gs4d)}: ${Object.keys(orders).join(', ')}`);
    orders[data.gs4d](data);
  };
}

// Obeys the page around alone.
export function listenAround(obey) {
  if (framed) addEventListener('message', (event) => event.source === window.parent && obey(event.data));
}

// The link to a view: the query of this page with what has changed since.
export function linkTo(query, { source, seconds, camera, speed, background }) {
  const address = new URL(location.href);
  const values = new URLSearchParams(query);
  const set = (name, value) => (value === null ? values.delete(name) : values.set(name, value));
  if (source !== undefined) {
    set('capture', source);
    // The title is that of the capture of the query.
    set('title', null);
  }
  set('time', seconds === null ? null : seconds.toFixed(3));
  set('camera', camera);
  set('speed', speed === 1 ? null : String(speed));
  set('background', background === 'trained' ? null : background);
  address.search = values.toString();
  return address.href;
}

export { framed };

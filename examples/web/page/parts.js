// The parts of the page that the user sees: messages, progress, toolbar, help.
// In: the elements of index.html. Out: functions that show and hide them.

import { megabytes } from './files.js';

export const at = (id) => document.getElementById(id);

// Says something for some seconds, and to screen readers.
export function say(text) {
  at('said').textContent = text;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => (at('said').textContent = ''), 4000);
}

// Shows a message until it is closed: `again` is the label of a button that does `action`; `closable` is whether there is anything behind it to see.
export function refuse(text, { again = '', action = null, closable = false } = {}) {
  at('text').textContent = text;
  at('again').hidden = !again;
  at('again').textContent = again;
  at('again').onclick = () => {
    dismiss();
    action?.();
  };
  at('close').hidden = !closable;
  at('close').onclick = dismiss;
  at('message').hidden = false;
  loading(null);
}

export function dismiss() {
  const hadFocus = at('message').contains(document.activeElement);
  at('message').hidden = true;
  if (hadFocus) at('canvas').focus();
}

// Shows what is being loaded, and how far; null hides it.
export function loading(report) {
  at('loading').hidden = !report;
  if (!report) return;
  const { name = '', part = 0, bytes = 0, total = 0, state } = report;
  const share = total ? `${Math.round((100 * bytes) / total)} %, ${megabytes(bytes)} of ${megabytes(total)}` : bytes ? megabytes(bytes) : '';
  const words = { starting: 'Starting the player', receiving: `${name} ${share}`.trim(), reading: `Reading ${name}`, compiling: 'Preparing the first picture', buffering: 'Loading this time' };
  at('loading-text').textContent = words[state] ?? '';
  at('progress').value = part;
  at('cancel').hidden = ['starting', 'compiling', 'buffering'].includes(state);
}

// Makes a toolbar one stop of the tab key: arrow keys move inside it.
export function toolbar(bar) {
  const items = () => [...bar.querySelectorAll('button, select')].filter((item) => !item.disabled && item.offsetParent);
  const enter = (item) => bar.querySelectorAll('button, select').forEach((other) => (other.tabIndex = other === item ? 0 : -1));
  // To be called when controls are switched on or off.
  const refresh = () => {
    if (!bar.contains(document.activeElement)) enter(items()[0]);
  };
  bar.addEventListener('focusin', (event) => enter(event.target));
  bar.addEventListener('keydown', (event) => {
    const all = items();
    const index = all.indexOf(event.target);
    const to = { ArrowRight: index + 1, ArrowLeft: index - 1, Home: 0, End: all.length - 1 }[event.key];
    if (index < 0 || to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    all[(to + all.length) % all.length].focus();
  });
  refresh();
  return refresh;
}

export function help() {
  if (at('help').open) at('help').close();
  else at('help').showModal();
}

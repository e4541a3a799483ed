// SPDX-License-Identifier: BSD-3-Clause
// Elements, numbers and the state that the URL's hash keeps. Foreign text (names of photos, paths)
// only ever becomes text nodes or attributes: nothing here parses markup.

const kSvg = 'http://www.w3.org/2000/svg';

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith('on')) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? '' : value);
  }
  for (const child of children.flat(Infinity)) {
    if (child !== null && child !== undefined && child !== false) node.append(child);
  }
  return node;
}

const el = (tag, attributes, ...children) => fill(document.createElement(tag), attributes, children);
const svg = (tag, attributes, ...children) =>
  fill(document.createElementNS(kSvg, tag), attributes, children);
const put = (node, ...children) => { node.replaceChildren(); return fill(node, null, children); };
const byId = (id) => document.getElementById(id);

const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);
const list = (value) => (Array.isArray(value) ? value : []);
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
const median = (values) => {
  const sorted = values.filter(isNumber).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.floor((sorted.length - 1) / 2)] : null;
};

// Three significant digits; whole numbers as they are.
function formatNumber(value) {
  if (!isNumber(value)) return '–';
  if (Number.isInteger(value)) return value.toLocaleString('en-US');
  const size = Math.abs(value);
  if (size >= 100) return Math.round(value).toLocaleString('en-US');
  if (size < 1e-6) return '0';
  if (size < 0.001) return value.toPrecision(1);
  return size >= 10 ? value.toFixed(1) : size >= 1 ? value.toFixed(2) : value.toFixed(3);
}

// Without zeros at the end, for axes and ratios.
const formatTick = (value, digits = 3) => Number(value.toPrecision(digits)).toLocaleString('en-US', { maximumFractionDigits: 12 });

const withUnit = (value, unit) =>
  isNumber(value) && unit ? `${formatNumber(value)}\u00a0${unit}` : formatNumber(value);

// The middle of a long name is what may go: its end tells photos apart.
function shorten(name, length) {
  const letters = [...name];
  if (letters.length <= length) return name;
  const head = Math.ceil((length - 1) / 3);
  return `${letters.slice(0, head).join('')}…${letters.slice(head + 1 - length).join('')}`;
}

const decodeBase64 = (text) => Uint8Array.from(atob(text || ''), (c) => c.charCodeAt(0));

function announce(text) {
  byId('announcer').textContent = text;
}

// What the hash may say, and what holds where it does not.
const kDefaults = {
  view: '', show: 'after', reference: '0', turn: '', a: '', b: '', overlay: '0', sort: 'worst',
  status: 'all', find: '', moves: '', points: '', photos: '1', all: '0',
};

const state = { ...kDefaults };

function readHash() {
  const given = new URLSearchParams(location.hash.slice(1));
  for (const key of Object.keys(kDefaults)) {
    state[key] = given.has(key) ? given.get(key) : kDefaults[key];
  }
}

// Changes the state and the address. `visit` makes a step that the browser's Back undoes.
function changeState(changes, visit = false) {
  Object.assign(state, changes);
  const kept = new URLSearchParams();
  for (const key of Object.keys(kDefaults)) {
    if (state[key] !== kDefaults[key]) kept.set(key, state[key]);
  }
  const hash = `#${kept}`;
  if (hash === (location.hash || '#')) return;
  try {
    history[visit ? 'pushState' : 'replaceState'](null, '', hash);
  } catch {
    location.hash = hash;  // where a frame or a file may not touch the history
  }
}

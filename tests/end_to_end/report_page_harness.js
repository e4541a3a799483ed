// SPDX-License-Identifier: BSD-3-Clause
// What the test's own page does with report.html, which stands in a frame beside this script: it waits
// for it, takes the steps that a person would, and leaves the answer as JSON in #answer.
'use strict';

const frame = document.querySelector('iframe');
const sleep = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
const find = (selector) => frame.contentDocument.querySelector(selector);
const findAll = (selector) => [...frame.contentDocument.querySelectorAll(selector)];

async function click(selector) {
  find(selector).click();
  await sleep(300);
}

async function press(selector, ...keys) {
  for (const key of keys) {
    find(selector).dispatchEvent(new frame.contentWindow.KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
    await sleep(20);
  }
  await sleep(400);
}

// Presses the mouse at one place of the canvas and lets it go at another, in pixels of the frame.
async function drag(from, to) {
  const send = (kind, [clientX, clientY], target) => target.dispatchEvent(
    new frame.contentWindow[kind.startsWith('pointer') ? 'PointerEvent' : 'MouseEvent'](
      kind, { clientX, clientY, button: 0, bubbles: true, cancelable: true, pointerType: 'mouse' }));
  const canvas = find('#canvas');
  send('pointerdown', from, canvas);
  send('mousedown', from, canvas);
  send('mousemove', to, frame.contentDocument);
  send('mouseup', to, frame.contentDocument);
  send('pointerup', to, canvas);
  await sleep(400);
}

// Puts the 3D view into the corner of the window, 400 x 300 pixels, where a screenshot finds it.
async function showStageOnly() {
  const stage = find('#stage');
  stage.style.cssText = 'position:fixed;left:0;top:0;width:400px;height:300px;min-height:0;border:0;border-radius:0;z-index:9';
  await sleep(300);
}

const channels = (color) => (color.match(/[\d.]+/g) || []).map(Number);

function luminance([r, g, b]) {
  const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
  return 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
}

function groundOf(element) {
  for (let node = element; node; node = node.parentElement) {
    const color = channels(frame.contentWindow.getComputedStyle(node).backgroundColor);
    if (color.length === 3 || color[3] === 1) return color;
  }
  return [255, 255, 255];
}

// Texts whose contrast is below WCAG 2.1's AA: 4.5, or 3 where they are large.
function faintTexts() {
  const walker = frame.contentDocument.createTreeWalker(frame.contentDocument.body, NodeFilter.SHOW_TEXT);
  const faint = [];
  let count = 0;
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !element.checkVisibility() || element.closest('script,noscript')) continue;
    const style = frame.contentWindow.getComputedStyle(element);
    const ink = channels(element.namespaceURI.endsWith('svg') ? style.fill : style.color);
    const [light, dark] = [luminance(ink), luminance(groundOf(element))].sort((a, b) => b - a);
    const size = parseFloat(style.fontSize);
    const needed = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700) ? 3 : 4.5;
    ++count;
    if ((light + 0.05) / (dark + 0.05) < needed) faint.push(walker.currentNode.data.trim().slice(0, 40));
  }
  return { count, faint };
}

// What makes the page itself wider than the frame: nothing, or the elements beyond its right edge.
function sticksOut() {
  const root = frame.contentDocument.documentElement;
  if (root.scrollWidth <= root.clientWidth) return [];
  return findAll('body *').filter((element) => element.getBoundingClientRect().right > root.clientWidth)
    .map((element) => `${element.tagName} ${element.getAttribute('class')} ${element.id}`);
}

async function answer(steps) {
  await sleep(500);
  let result;
  try {
    result = await steps();
  } catch (error) {
    result = { error: String(error) };
  }
  const escaped = JSON.stringify(result ?? null)
    .replace(/[<>&\u007f-\uffff]/g, (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, '0')}`);
  document.querySelector('#answer').textContent = escaped;
}

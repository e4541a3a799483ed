// SPDX-License-Identifier: BSD-3-Clause
// The 3D view's place in the page: its switches, keys, pointer and words.

const kSceneHelp = 'Drag to turn, two fingers or wheel (after a click) to zoom, right button or two fingers to move. '
  + 'Keys when it has the focus: arrows turn, + and − zoom, space switches before and after, 1 before, 2 after, 3 both, '
  + '4 reference, comma and full stop step through the cameras, Enter opens the photo, 0 resets.';

function setScene(changes) {
  changeState(changes);
  for (const input of byId('scene').querySelectorAll('input')) {
    if (input.name === 'show') input.checked = input.value === state.show;
    if (input.name === 'reference') input.checked = state.reference === '1';
  }
  stageOf3D.tip.hidden = true;
  stageOf3D.build();
  showCaption();
}

function showCaption() {
  const [before, after] = chosenPair();
  const shown = state.show === 'before' && before >= 0 ? [before] : state.show === 'both' && before >= 0 ? [before, after] : [after];
  if (state.reference === '1' && referenceModel() >= 0) shown.push(referenceModel());
  const words = shown.map((i) => {
    const count = modelScene(i).points ? modelScene(i).points.count : 0;
    return el('span', {}, el('span', { class: `dot ${roleClass(i)}`, 'aria-hidden': 'true' }),
      `${models[i].name}: ${formatNumber(camerasOf(i).length)} cameras, ${formatNumber(count)} points`);
  });
  const factor = stageOf3D.factor();
  const note = shown.includes(before) && shown.includes(after) && before >= 0
    ? el('span', {}, factor > 1 ? `lines join the cameras’ places before and after; distances drawn ${factor} times as long as they are`
      : 'lines join the cameras’ places before and after') : null;
  put(byId('scene-caption'), ...words, ...(note ? [note] : []));
  byId('scene-factor').hidden = !note;
}

function sceneSwitches() {
  const [before] = chosenPair();
  const radio = (value, text, key) => el('label', { class: `segment ${value}` },
    el('input', { type: 'radio', name: 'show', value, checked: state.show === value, onchange: () => setScene({ show: value }) }),
    el('span', {}, text, el('kbd', { 'aria-hidden': 'true' }, key)));
  return el('div', { class: 'controls' },
    before >= 0 && el('fieldset', { class: 'segments' }, el('legend', { class: 'unseen' }, 'Which model the 3D view shows'),
      radio('before', 'Before', '1'), radio('after', 'After', '2'), radio('both', 'Both', '3')),
    referenceModel() >= 0 && el('label', {}, el('input', { type: 'checkbox', name: 'reference', checked: state.reference === '1',
      onchange: (event) => setScene({ reference: event.target.checked ? '1' : '0' }) }), ' Reference'),
    views.some((view) => view.thumbnail) && el('label', {}, el('input', { type: 'checkbox', name: 'photos', checked: state.photos === '1',
      onchange: (event) => setScene({ photos: event.target.checked ? '1' : '0' }) }), ' Photos'),
    el('label', {}, 'Points ', el('input', { type: 'range', min: 1, max: 8, step: 0.5, value: Number(state.points) || 2.5,
      oninput: (event) => setScene({ points: event.target.value }) })),
    el('label', { id: 'scene-factor' }, 'Moves ', el('select', { onchange: (event) => setScene({ moves: event.target.value }) },
      kFactors.map((factor) => option(String(factor), `× ${factor}`, String(stageOf3D.factor()))))),
    el('button', { type: 'button', onclick: () => { stageOf3D.tip.hidden = true; stageOf3D.reset(); } }, 'Reset view'));
}

function stepCamera(by) {
  const { cameras } = stageOf3D.shown[0] || { cameras: [] };
  if (cameras.length === 0) return;
  const at = cameras.findIndex((camera) => camera.view === stageOf3D.selected);
  const next = cameras[(at + by + cameras.length + (at < 0 && by < 0 ? 1 : 0)) % cameras.length].view;
  stageOf3D.select(next);
  announce(stageOf3D.tip.textContent);
}

function sceneKeys(event) {
  if (event.altKey || event.ctrlKey || event.metaKey) return;
  const [before] = chosenPair();
  const show = (value) => () => before >= 0 && setScene({ show: value });
  const actions = {
    ArrowLeft: () => stageOf3D.turnBy(-6, 0), ArrowRight: () => stageOf3D.turnBy(6, 0),
    ArrowUp: () => stageOf3D.turnBy(0, 6), ArrowDown: () => stageOf3D.turnBy(0, -6),
    '+': () => stageOf3D.turnBy(0, 0, 0.85), '=': () => stageOf3D.turnBy(0, 0, 0.85), '-': () => stageOf3D.turnBy(0, 0, 1 / 0.85),
    1: show('before'), 2: show('after'), 3: show('both'), ' ': show(state.show === 'after' ? 'before' : 'after'),
    4: () => referenceModel() >= 0 && setScene({ reference: state.reference === '1' ? '0' : '1' }),
    0: () => stageOf3D.reset(), ',': () => stepCamera(-1), '.': () => stepCamera(1),
    Enter: () => stageOf3D.selected !== null && openView(stageOf3D.selected),
  };
  if (!actions[event.key]) return;
  event.preventDefault();
  actions[event.key]();
}

function scenePointer(canvas) {
  let pressed = null;
  const place = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.addEventListener('pointerdown', (event) => { pressed = place(event); });
  canvas.addEventListener('pointerup', (event) => {
    const [x, y] = place(event);
    const view = pressed && event.button === 0 && Math.hypot(x - pressed[0], y - pressed[1]) < 5
      ? stageOf3D.pick(x, y, event.pointerType === 'touch' ? 28 : 14) : null;
    pressed = null;
    if (view !== null) openView(view);
  });
  canvas.addEventListener('pointermove', (event) => {
    if (pressed || event.pointerType === 'touch') { stageOf3D.tip.hidden = true; return; }
    const view = stageOf3D.pick(...place(event), 14);
    canvas.style.cursor = view === null ? 'grab' : 'pointer';
    if (view === null) stageOf3D.tip.hidden = true;
    else stageOf3D.placeTip(...place(event), view);
  });
  canvas.addEventListener('pointerleave', () => { stageOf3D.tip.hidden = true; });
  canvas.addEventListener('keydown', sceneKeys);
  // The wheel scrolls the page until the view was chosen.
  canvas.addEventListener('focus', () => { stageOf3D.controls.enableZoom = true; });
  canvas.addEventListener('blur', () => { stageOf3D.controls.enableZoom = false; });
}

function showInScene(viewIdx) {
  stageOf3D.select(viewIdx);
  byId('scene').scrollIntoView({ block: 'start' });
  byId('canvas').focus();
}

function buildScene() {
  const section = byId('scene');
  section.hidden = false;
  put(section, el('h2', { id: 'scene-title' }, 'Cameras and points'));
  const leaveOut = (why) => section.append(el('p', { class: 'note' }, why));
  if (typeof THREE === 'undefined') {
    leaveOut('The 3D view is left out: the 3D library (Debian’s package libjs-three) was absent when vgtw was built.');
  } else if (!list(sceneData.models).some((model) => model && list(model.cameras).length)) {
    leaveOut('There is nothing to show in 3D: no model has a camera.');
  } else {
    const canvas = el('canvas', { id: 'canvas', tabindex: 0, role: 'application', 'aria-label': '3D view of cameras and points', 'aria-describedby': 'scene-help' });
    const tip = el('div', { class: 'tip', hidden: true });
    try {
      stageOf3D = new Stage(canvas, tip);
    } catch {
      leaveOut('The 3D view is left out: this browser offers no WebGL.');
      return;
    }
    section.append(sceneSwitches(), el('div', { id: 'stage' }, canvas, tip, el('img', { id: 'still', alt: '' })),
      el('p', { id: 'scene-caption', class: 'legend' }),
      el('details', {}, el('summary', {}, 'Keys and gestures'), el('p', { class: 'help', id: 'scene-help' }, kSceneHelp)));
    scenePointer(canvas);
    new ResizeObserver(() => stageOf3D.resize()).observe(byId('stage'));
    stageOf3D.build();
    showCaption();
  }
}

// SPDX-License-Identifier: BSD-3-Clause
// The 3D view: cameras and points of the compared models. The world is turned so that its up is the
// screen's, moved to its centre and scaled to radius 1. Nothing is drawn unless something changed.

const sceneData = data.scene || {};
const modelScene = (modelIdx) => list(sceneData.models)[modelIdx] || {};
const camerasOf = (modelIdx) => list(modelScene(modelIdx).cameras);
const hasScene = () => stageOf3D !== null;
let stageOf3D = null;

const cssColor = (name) => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());

function worldFrame() {
  const up = new THREE.Vector3(...(sceneData.up || [0, -1, 0]));
  const turn = new THREE.Quaternion().setFromUnitVectors(up.normalize(), new THREE.Vector3(0, 1, 0));
  const centre = new THREE.Vector3(...(sceneData.centre || [0, 0, 0]));
  const radius = sceneData.radius > 0 ? sceneData.radius : 1;
  const root = new THREE.Group();
  root.quaternion.copy(turn);
  root.scale.setScalar(1 / radius);
  root.position.copy(centre).applyQuaternion(turn).multiplyScalar(-1 / radius);
  return { root, turn, radius };
}

// All cameras and most points (those within the middle nine tenths along each axis), in the world of
// the screen: what one wants to see first.
function mainSamples(root) {
  root.updateMatrixWorld();
  const toScreen = (point) => new THREE.Vector3(...point).applyMatrix4(root.matrixWorld);
  const indices = models.map((model, i) => i);
  const centres = indices.flatMap(camerasOf).map((camera) => toScreen(camera.centre));
  let points = indices.flatMap((i) => (modelScene(i).points ? somePoints(modelScene(i).points, 1000) : [])).map(toScreen);
  const bounds = ['x', 'y', 'z'].map((axis) => {
    const sorted = points.map((point) => point[axis]).sort((a, b) => a - b);
    return [axis, sorted[Math.floor(0.05 * sorted.length)], sorted[Math.floor(0.95 * sorted.length)]];
  });
  points = points.filter((point) => bounds.every(([axis, low, high]) => point[axis] >= low && point[axis] <= high));
  return [...centres, ...points];
}

// Where to look at, and from how far in direction `toward`, to see all samples in the middle.
function placeToSee(samples, toward, aspect) {
  const right = new THREE.Vector3(0, 1, 0).cross(toward).normalize();
  const up = toward.clone().cross(right);
  const target = new THREE.Vector3();
  for (const axis of [right, up, toward]) {
    const along = samples.map((sample) => sample.dot(axis));
    target.addScaledVector(axis, (Math.min(...along) + Math.max(...along)) / 2);
  }
  const distances = samples.map((sample) => {
    const from = sample.clone().sub(target);
    return from.dot(toward) + Math.max(Math.abs(from.dot(right)) / Math.max(1, aspect), Math.abs(from.dot(up))) / Math.tan(Math.PI / 8);
  });
  return { target, distance: 1.06 * Math.max(0.05, ...distances) };
}

const directionOf = (azimuth, elevation) => {
  const a = (azimuth * Math.PI) / 180;
  const e = (clamp(elevation, -89, 89) * Math.PI) / 180;
  return new THREE.Vector3(Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e));
};

// From behind the cameras and a little aside where they look one way, else from the side above.
function startingTurn(turn) {
  const cameras = camerasOf(Math.max(0, chosenPair()[1]));
  const forward = new THREE.Vector3();
  for (const camera of cameras) forward.add(new THREE.Vector3(0, 0, 1).applyQuaternion(quaternionOf(camera.rotation_wxyz)));
  forward.applyQuaternion(turn).divideScalar(Math.max(1, cameras.length));
  const level = Math.hypot(forward.x, forward.z);
  if (level < 0.3) return [35, 30];
  return [(Math.atan2(-forward.x, -forward.z) * 180) / Math.PI + 28, 20];
}

class Stage {
  constructor(canvas, tip) {
    this.canvas = canvas;
    this.tip = tip;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.scene = new THREE.Scene();
    this.eye = new THREE.PerspectiveCamera(45, 1, 0.005, 100);
    Object.assign(this, worldFrame());
    this.scene.add(this.root);
    this.shown = [];  // { modelIdx, cameras, frusta } of what is on the screen
    this.selected = null;
    this.samples = mainSamples(this.root);
    this.size = frustumSize(camerasOf(Math.max(0, chosenPair()[1])), this.radius);
    this.atlas = makeAtlas(() => this.draw());
    this.controls = new THREE.OrbitControls(this.eye, canvas);
    Object.assign(this.controls, { enableKeys: false, enableZoom: false, minDistance: 0.05, maxDistance: 20, rotateSpeed: 0.8 });
    this.controls.addEventListener('change', () => this.draw());
    this.controls.addEventListener('end', () => this.keepTurn());
    this.look();
  }

  // Looks as the state says: azimuth and elevation (degrees), then distance and the point looked at;
  // where it says less, so that everything is seen.
  look() {
    const given = state.turn === '' ? [] : state.turn.split(',').map(Number);
    const known = given.every(Number.isFinite) ? given : [];
    const [azimuth, elevation] = known.length >= 2 ? known : startingTurn(this.turn);
    const toward = directionOf(azimuth, elevation);
    const { target, distance } = placeToSee(this.samples, toward, this.eye.aspect);
    if (known.length === 6) this.lookFrom(toward, known[2], new THREE.Vector3(...known.slice(3)));
    else this.lookFrom(toward, distance, target);
  }

  lookFrom(toward, distance, target = this.controls.target) {
    this.controls.target.copy(target);
    this.eye.position.copy(toward).multiplyScalar(clamp(distance, 0.05, 20)).add(target);
    this.controls.update();
    this.draw();
  }

  currentTurn() {
    const offset = this.eye.position.clone().sub(this.controls.target);
    const distance = offset.length();
    return [(Math.atan2(offset.x, offset.z) * 180) / Math.PI, (Math.asin(clamp(offset.y / distance, -1, 1)) * 180) / Math.PI, distance];
  }

  // After a pause, because browsers limit how often an address may change.
  keepTurn() {
    clearTimeout(this.turnTimer);
    this.turnTimer = setTimeout(() => {
      changeState({ turn: [...this.currentTurn(), ...this.controls.target.toArray()].map((v) => v.toFixed(3)).join(',') });
    }, 250);
  }

  turnBy(azimuth, elevation, zoom = 1) {
    const [a, e, d] = this.currentTurn();
    this.lookFrom(directionOf(a + azimuth, e + elevation), d * zoom);
    this.keepTurn();
  }

  reset() {
    changeState({ turn: '' });
    this.selected = null;
    this.look();
    this.build();
  }

  // How much farther than they are the moves from before to after are drawn.
  factor() {
    return state.moves === '' ? suggestedFactor(this.radius) : Number(state.moves) || 1;
  }

  build() {
    disposeAll(this.root);
    const [before, after] = chosenPair();
    const both = state.show === 'both' && before >= 0;
    this.shown = [];
    this.scene.background = cssColor('--scene');
    if (both) this.addMoves(before, after);
    if (both || (state.show === 'before' && before >= 0)) this.add(before, '--before', both, both ? this.factor() : 0, after);
    if (both || state.show === 'after' || before < 0) this.add(after, '--after', both, 0, after);
    const reference = referenceModel();
    if (reference >= 0 && state.reference === '1') this.add(reference, '--reference', true, 0, after);
    this.addSelection();
    this.draw();
  }

  // Cameras are moved along the way from `anchor`'s by `factor` in place of 1; 0 leaves them.
  add(modelIdx, color, tinted, factor, anchor) {
    const cameras = camerasOf(modelIdx);
    const centres = new Map(camerasOf(anchor).map((camera) => [camera.view, camera.centre]));
    const frusta = cameras.map((camera) => frustum(camera, this.size, shiftOf(camera, centres.get(camera.view), factor)));
    this.root.add(frustaLines(frusta, cssColor(color)));
    if (state.photos === '1' && !tinted) this.root.add(photoMesh(cameras, frusta, this.atlas));
    const points = modelScene(modelIdx).points;
    if (points && points.count > 0) this.root.add(pointCloud(points, tinted ? cssColor(color) : null, this.pointSize(points.count)));
    this.shown.push({ modelIdx, cameras, frusta });
  }

  pointSize(count) {
    return (Number(state.points) || defaultPointSize(count)) * this.renderer.getPixelRatio();
  }

  addMoves(before, after) {
    const centres = new Map(camerasOf(after).map((camera) => [camera.view, camera.centre]));
    const ends = camerasOf(before).filter((camera) => centres.has(camera.view)).flatMap((camera) => {
      const to = centres.get(camera.view);
      return [new THREE.Vector3(...camera.centre).add(shiftOf(camera, to, this.factor())), new THREE.Vector3(...to)];
    });
    this.root.add(lines(ends, cssColor('--text')));
  }

  addSelection() {
    if (this.selected === null) return;
    for (const { cameras, frusta } of this.shown) {
      const k = cameras.findIndex((camera) => camera.view === this.selected);
      if (k < 0) continue;
      const [apex, ...corners] = frusta[k];
      const larger = [apex, ...corners.map((corner) => corner.clone().sub(apex).multiplyScalar(1.6).add(apex))];
      const object = frustaLines([larger], cssColor('--text'));
      object.material.depthTest = false;
      object.renderOrder = 1;
      this.root.add(object);
    }
  }

  select(viewIdx) {
    this.selected = viewIdx;
    this.build();
    const entry = this.nameTag(viewIdx);
    this.tip.hidden = !entry;
    if (entry) this.placeTip(entry.x, entry.y, viewIdx);
  }

  placeTip(x, y, viewIdx) {
    const error = pairText(views[viewIdx], errorKey);
    this.tip.textContent = `${views[viewIdx].name}${error ? ` · ${error}` : ''}`;
    this.tip.hidden = false;
    const width = this.tip.offsetWidth;
    this.tip.style.left = `${clamp(x + 12, 0, Math.max(0, this.canvas.clientWidth - width))}px`;
    this.tip.style.top = `${clamp(y + 14, 0, Math.max(0, this.canvas.clientHeight - 30))}px`;
  }

  // A world point on the canvas in CSS pixels, with its depth; null behind the eye.
  project(vector) {
    const p = vector.clone().applyMatrix4(this.root.matrixWorld).project(this.eye);
    if (p.z > 1) return null;
    return { x: ((p.x + 1) / 2) * this.canvas.clientWidth, y: ((1 - p.y) / 2) * this.canvas.clientHeight, z: p.z };
  }

  nameTag(viewIdx) {
    for (const { cameras, frusta } of this.shown) {
      const k = cameras.findIndex((camera) => camera.view === viewIdx);
      if (k >= 0) return this.project(frusta[k][0]);
    }
    return null;
  }

  // The view whose frustum is under the pointer, the nearest to the eye; else one within reach.
  pick(x, y, reach) {
    let best = { z: Infinity, view: null };
    let near = { distance: reach, view: null };
    for (const { cameras, frusta } of this.shown) {
      cameras.forEach((camera, k) => {
        const corners = frusta[k].map((corner) => this.project(corner));
        if (corners.some((corner) => !corner)) return;
        if (isInside(corners.slice(1), x, y) && corners[0].z < best.z) best = { z: corners[0].z, view: camera.view };
        const distance = Math.hypot(corners[0].x - x, corners[0].y - y);
        if (distance < near.distance) near = { distance, view: camera.view };
      });
    }
    return best.view ?? near.view;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.eye.aspect = width / height;
    // A tall, narrow canvas must not cut the scene at its sides.
    this.eye.fov = width < height ? (2 * Math.atan((Math.tan(Math.PI / 8) * height) / width) * 180) / Math.PI : 45;
    this.eye.updateProjectionMatrix();
    if (state.turn.split(',').length < 3) this.look();
    this.renderer.render(this.scene, this.eye);  // at once: the new size has cleared the canvas
  }

  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.renderer.render(this.scene, this.eye); });
  }

  // For paper: in light colours, whatever those of the screen are.
  picture() {
    const { classList } = document.documentElement;
    classList.add('paper');
    this.build();
    this.renderer.render(this.scene, this.eye);
    const url = this.canvas.toDataURL('image/png');
    classList.remove('paper');
    this.build();
    return url;
  }
}

const defaultPointSize = (count) => (count > 50000 ? 1.5 : count > 10000 ? 2.5 : 3.5);

function shiftOf(camera, anchor, factor) {
  if (!anchor || !factor) return new THREE.Vector3();
  return new THREE.Vector3(...camera.centre).sub(new THREE.Vector3(...anchor)).multiplyScalar(factor - 1);
}

// So that the usual move is seen as 4 % of the scene; a round number, never below 1.
function suggestedFactor(radius) {
  const [before, after] = chosenPair();
  const centres = new Map(camerasOf(after).map((camera) => [camera.view, camera.centre]));
  const moves = camerasOf(before).filter((camera) => centres.has(camera.view)).map((camera) => {
    const to = centres.get(camera.view);
    return Math.hypot(...camera.centre.map((value, k) => value - to[k]));
  });
  const wanted = (0.04 * radius) / Math.max(median(moves) || 0, 1e-6 * radius);
  return kFactors.reduce((best, factor) => (factor <= wanted ? factor : best), 1);
}

const kFactors = [1, 2, 5, 10, 20, 50, 100];

function isInside(corners, x, y) {
  let inside = false;
  corners.forEach((p, i) => {
    const q = corners[(i + 3) % 4];
    if (p.y > y !== q.y > y && x < ((q.x - p.x) * (y - p.y)) / (q.y - p.y) + p.x) inside = !inside;
  });
  return inside;
}

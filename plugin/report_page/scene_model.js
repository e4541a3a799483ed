// SPDX-License-Identifier: BSD-3-Clause
// One model as objects of the 3D library, in the world of the data.

// Half of the image plane at z = 1 in camera axes (x right, y down, z forward).
const planeOf = (camera) => [Math.tan(((camera.fov_x_deg || 60) * Math.PI) / 360), Math.tan(((camera.fov_y_deg || 45) * Math.PI) / 360)];

const quaternionOf = ([w, x, y, z]) => new THREE.Quaternion(x, y, z, w).normalize();

// Apex and the four corners of the image plane in the world: top left, top right, bottom right, bottom left.
function frustum(camera, size, shift) {
  const [half_x, half_y] = planeOf(camera);
  const rotation = quaternionOf(camera.rotation_wxyz);
  const apex = new THREE.Vector3(...camera.centre).add(shift);
  const corner = (x, y) => new THREE.Vector3(x * half_x, y * half_y, 1).multiplyScalar(size).applyQuaternion(rotation).add(apex);
  return [apex, corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
}

// Pairs of corners to join, and a triangle above the upper edge that tells which way is up.
const kFrustumEdges = [0, 1, 0, 2, 0, 3, 0, 4, 1, 2, 2, 3, 3, 4, 4, 1];

function lines(vectors, color) {
  const geometry = new THREE.BufferGeometry().setFromPoints(vectors);
  const object = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color }));
  object.frustumCulled = false;
  return object;
}

function frustaLines(frusta, color) {
  const vectors = [];
  for (const corners of frusta) {
    for (const k of kFrustumEdges) vectors.push(corners[k]);
    const tip = corners[1].clone().lerp(corners[2], 0.5).add(corners[1].clone().sub(corners[4]).multiplyScalar(0.22));
    vectors.push(corners[1], tip, tip, corners[2]);
  }
  return lines(vectors, color);
}

// Three numbers a point: each is stored as 16 bits, x = min + step * q.
function pointPositions(points) {
  const xyz = decodeBase64(points.xyz);
  const bits = new DataView(xyz.buffer);
  const positions = new Float32Array(Math.min(points.count, Math.floor(xyz.length / 6)) * 3);
  for (let i = 0; i < positions.length; ++i) positions[i] = points.min[i % 3] + points.step[i % 3] * bits.getUint16(i * 2, true);
  return positions;
}

// At most `count` of the points, evenly chosen.
function somePoints(points, count) {
  const positions = pointPositions(points);
  const stride = 3 * Math.max(1, Math.floor(positions.length / 3 / count));
  const chosen = [];
  for (let i = 0; i < positions.length; i += stride) chosen.push([positions[i], positions[i + 1], positions[i + 2]]);
  return chosen;
}

// The points, each with its own colour, or all with `color`.
function pointCloud(points, color, size) {
  const positions = pointPositions(points);
  const rgb = decodeBase64(points.rgb);
  const count = positions.length / 3;
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  const colored = !color && rgb.length >= count * 3;
  if (colored) geometry.setAttribute('color', new THREE.BufferAttribute(rgb.subarray(0, count * 3), 3, true));
  const material = new THREE.PointsMaterial({ size, sizeAttenuation: false, color: color || (colored ? 0xffffff : 0x888888),
    vertexColors: colored ? THREE.VertexColors : THREE.NoColors });
  const object = new THREE.Points(geometry, material);
  object.frustumCulled = false;
  return object;
}

// One texture with every photo, so that hundreds of them are one mesh and one call.
const kAtlasSize = 2048;
function makeAtlas(onChange) {
  const columns = Math.max(2, Math.ceil(Math.sqrt(views.length)));
  const tile = Math.min(320, Math.floor(kAtlasSize / columns));
  const canvas = el('canvas', { width: kAtlasSize, height: kAtlasSize });
  const texture = new THREE.CanvasTexture(canvas);
  texture.minFilter = THREE.LinearFilter;
  texture.generateMipmaps = false;
  const pen = canvas.getContext('2d');
  const loads = views.map((view, i) => new Promise((resolve) => {
    if (!view.thumbnail) { resolve(); return; }
    const image = new Image();
    image.onload = () => {
      pen.drawImage(image, (i % columns) * tile, Math.floor(i / columns) * tile, tile, tile);
      resolve();
    };
    image.onerror = resolve;
    image.src = view.thumbnail;
  }));
  Promise.all(loads).then(() => { texture.needsUpdate = true; onChange(); });
  // Half a pixel inside, so that a tile's neighbour does not shine through.
  const at = (i) => {
    const x = (i % columns) * tile + 0.5;
    const y = Math.floor(i / columns) * tile + 0.5;
    return [x / kAtlasSize, 1 - y / kAtlasSize, (x + tile - 1) / kAtlasSize, 1 - (y + tile - 1) / kAtlasSize];
  };
  return { texture, at };
}

function photoMesh(cameras, frusta, atlas) {
  const positions = [];
  const uvs = [];
  cameras.forEach((camera, k) => {
    if (!views[camera.view] || !views[camera.view].thumbnail) return;
    const [, a, b, c, d] = frusta[k];
    for (const corner of [a, d, b, b, d, c]) positions.push(corner.x, corner.y, corner.z);
    const [left, top, right, bottom] = atlas.at(camera.view);
    uvs.push(left, top, left, bottom, right, top, right, top, left, bottom, right, bottom);
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute('uv', new THREE.BufferAttribute(new Float32Array(uvs), 2));
  const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ map: atlas.texture, side: THREE.DoubleSide }));
  mesh.frustumCulled = false;
  return mesh;
}

// Half of the usual distance between neighbours, so that frusta stand apart, within bounds that stay visible.
function frustumSize(cameras, radius) {
  const centres = cameras.map((camera) => camera.centre);
  const nearest = centres.map((p, i) => {
    let best = Infinity;
    centres.forEach((q, j) => { if (i !== j) best = Math.min(best, Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2])); });
    return best;
  });
  return clamp((median(nearest) || 0.2 * radius) * 0.6, 0.03 * radius, 0.15 * radius);
}

function disposeAll(group) {
  group.traverse((object) => {
    if (object.geometry) object.geometry.dispose();
    if (object.material) object.material.dispose();
  });
  group.remove(...group.children);
}

'use strict';
// Bodies as lit solids: three.js draws their shapes with the camera of a Stage, into a picture that
// the stage lays among its lines. Without three.js or WebGL the stage draws outlines.

const EDGE_ANGLE = 30;  // degrees between faces from which on their edge is drawn

// Gives the stage its solids, once `bring` has made THREE; otherwise says why there are none.
async function startSolids(stage, bring) {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('webgl2', {alpha: true, antialias: true});
  if (!context) {
    stage.flat = 'outlines only: this browser has no WebGL';
    return;
  }
  try {
    await bring();
    stage.solids = new Solids(canvas, context);
  } catch (error) {
    stage.flat = `outlines only: ${error?.message ?? 'three.js cannot be loaded'}`;
  }
}

class Solids {
  constructor(canvas, context) {
    this.renderer = new THREE.WebGLRenderer({canvas, context});
    this.renderer.setClearAlpha(0);
    this.scene = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera();
    this.camera.matrixAutoUpdate = false;
    this.key = new THREE.DirectionalLight(0xffffff, 0.6);
    this.fill = new THREE.DirectionalLight(0xffffff, 0.2);
    this.scene.add(new THREE.AmbientLight(0xffffff, 0.42), this.key, this.fill);
    this.parts = [];  // one of each shape, in the order of the groups
    this.geometries = new Map();  // of a kind, or of a mesh: [faces, edges]
  }

  // The picture of groups of shapes, of the size of the stage; null while the graphics are lost.
  picture(stage, groups) {
    const {renderer, parts, scene} = this;
    if (renderer.getContext().isContextLost()) return null;
    const {width, height, axes: [, , eye], middle} = stage;
    let count = 0, reach = 0;
    for (const {points, shapes, color, opacity} of groups) {
      shapes.forEach((shape, n) => {
        if (shape.kind === 'mesh' && !shape.mesh) return;  // has not come yet
        const ends = points.slice(12 * n, 12 * n + 12);
        const part = this.part(count, shape, color, opacity ?? 1);
        count++;
        part.visible = ends.length === 12 && ends.every(Number.isFinite);
        if (!part.visible) return;
        const [x, y, z] = ends, axis = (k) => [ends[3 * k] - x, ends[3 * k + 1] - y, ends[3 * k + 2] - z];
        const [a, b, c] = [1, 2, 3].map(axis);
        part.matrix.set(a[0], b[0], c[0], x, a[1], b[1], c[1], y, a[2], b[2], c[2], z, 0, 0, 0, 1);
        part.matrixWorldNeedsUpdate = true;
        const depth = [x, y, z].reduce((sum, place, k) => sum + eye[k] * (place - middle[k]), 0);
        reach = Math.max(reach, Math.abs(depth) + Math.hypot(...a) + Math.hypot(...b) + Math.hypot(...c));
      });
    }
    for (const part of parts.splice(count)) this.remove(part);
    this.aim(stage, reach);
    this.resize(width, height, devicePixelRatio || 1);
    renderer.render(scene, this.camera);
    return renderer.domElement;
  }

  // Only for another size: three.js gives the picture new memory each time it is told one.
  resize(...size) {
    if (size.join() === this.size) return;
    this.size = size.join();
    const [width, height, ratio] = size;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
  }

  // The stage's own camera: what it projects to a place on the screen, this one does too.
  aim({width, height, scale, camera: {x, y}, axes: [right, up, eye], middle}, reach) {
    const {camera} = this;
    const [u, v, w] = [right, up, eye].map((axis) => new THREE.Vector3(...axis));
    camera.matrix.makeBasis(u, v, w).setPosition(...middle);
    camera.matrixWorldNeedsUpdate = true;
    const far = 1.01 * reach || 1;
    Object.assign(camera, {
      left: (-width / 2 - x) / scale, right: (width / 2 - x) / scale,
      top: (height / 2 + y) / scale, bottom: (-height / 2 + y) / scale, near: -far, far,
    });
    camera.updateProjectionMatrix();
    // The lights move with the eye: from above on the left, and weakly from the right.
    this.key.position.copy(w).addScaledVector(u, -0.5).addScaledVector(v, 0.8);
    this.fill.position.copy(w).addScaledVector(u, 1.2).addScaledVector(v, -0.3);
  }

  // The part at a place in the list: made anew where another shape was there.
  part(place, shape, color, opacity) {
    const own = shape.color ?? (shape.mesh?.colors ? null : color);
    const name = [shape.kind, own, opacity].join();
    const known = this.parts[place];
    if (known?.userData.name === name && known.userData.mesh === shape.mesh) return known;
    if (known) this.remove(known);
    const [faces, edges] = this.geometry(shape.kind, shape.mesh);
    const paint = new THREE.Color(1, 1, 1);
    if (Array.isArray(own)) paint.setRGB(...own); else if (own) paint.set(own);
    const seen = opacity * (shape.color?.[3] ?? 1);
    const clear = {transparent: seen < 1, opacity: seen, depthWrite: seen === 1};
    const part = new THREE.Mesh(faces, new THREE.MeshPhongMaterial({
      ...clear, color: paint, specular: 0x181818, shininess: 25, side: THREE.DoubleSide,
      vertexColors: !own, flatShading: shape.kind === 'mesh',
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    }));
    if (edges) part.add(new THREE.LineSegments(edges, new THREE.LineBasicMaterial({...clear, color: own ? paint.clone().multiplyScalar(0.55) : 0x444444})));
    part.matrixAutoUpdate = false;
    part.userData = {name, mesh: shape.mesh};
    this.parts[place] = part;
    this.scene.add(part);
    return part;
  }

  remove(part) {
    this.scene.remove(part);
    part.traverse((each) => each.material.dispose());
  }

  // Faces and edges of a shape whose half axes are one.
  geometry(kind, mesh) {
    const key = mesh ?? kind;
    if (!this.geometries.has(key)) {
      const faces = mesh ? triangles(mesh) : {
        box: () => new THREE.BoxGeometry(2, 2, 2),
        cylinder: () => new THREE.CylinderGeometry(1, 1, 2, 40).rotateX(Math.PI / 2),
        sphere: () => new THREE.SphereGeometry(1, 32, 20),
      }[kind]();
      this.geometries.set(key, [faces, kind === 'sphere' ? null : edges(faces, mesh ? mesh.edges : [1, 1, 1])]);
    }
    return this.geometries.get(key);
  }
}

// Edges between faces of a unit shape, as they are in a shape of these half axes (m).
function edges(faces, halves) {
  if (!halves) return null;
  const most = Math.max(...halves), parts = halves.map((half) => half / most || 1);
  const found = new THREE.EdgesGeometry(faces.clone().scale(...parts), EDGE_ANGLE);
  return found.scale(...parts.map((part) => 1 / part));
}

function triangles({vertices, faces, colors}) {
  const found = new THREE.BufferGeometry();
  found.setAttribute('position', new THREE.BufferAttribute(vertices, 3));
  if (colors) found.setAttribute('color', new THREE.BufferAttribute(colors, 3));
  found.setIndex(new THREE.BufferAttribute(faces, 1));
  return found;
}

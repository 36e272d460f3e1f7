'use strict';
// The mechanism on a canvas, seen with a camera that hand and wheel move. No library.

const colors = {};

function readColors() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['ink', 'faint', 'line', 'link', 'body', 'joint', 'reaction', 'applied', 'energy', 'error', 'grid', 'sheet', 'back', 'bad', 'warn', 'good']) {
    colors[name] = style.getPropertyValue(`--${name}`).trim();
  }
}

function sheet(canvas) {
  const scale = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
  if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
  const pen = canvas.getContext('2d');
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = '12px system-ui, sans-serif';
  return {pen, width, height};
}

function shown(x) {
  if (x === undefined || x === null || Number.isNaN(x)) return '–';
  const size = Math.abs(x);
  if (!size) return '0';
  return size < 1e-3 || size >= 1e5 ? x.toExponential(2) : x.toPrecision(4);
}

// For JSON.parse: {f32: text} and {u32: text} are arrays of numbers in base64, from `base` on.
function unpacked(key, value) {
  const text = value?.f32 ?? value?.u32;
  if (text === undefined) return value;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  if (value.f32 === undefined) return new Uint32Array(bytes.buffer);
  const numbers = new Float32Array(bytes.buffer);
  return value.base === undefined ? numbers : Float64Array.from(numbers, (x) => x + value.base);
}

function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((n) => n * power >= least);
}

function triples(list) {
  const found = [];
  for (let n = 0; n + 2 < (list?.length ?? 0); n += 3) found.push(list.slice(n, n + 3));
  return found;
}

// The ends of half axes on the other side, of shapes with twelve numbers each: middle and three ends.
function otherEnds(points) {
  return points.map((x, n) => (x === null ? null : 2 * points[n - n % 12 + n % 3] - x));
}

// The convex hull of places on the screen, in order (Andrew's monotone chain).
function hull(places) {
  const sorted = [...places].sort((one, other) => one[0] - other[0] || one[1] - other[1]);
  const chain = (found, place) => {
    const turn = ([a, b], [c, d]) => (c - a) * (place[1] - b) - (d - b) * (place[0] - a);
    while (found.length > 1 && turn(found.at(-2), found.at(-1)) <= 0) found.pop();
    found.push(place);
    return found;
  };
  const [below, above] = [sorted, sorted.toReversed()].map((each) => each.reduce(chain, []).slice(0, -1));
  return [...below, ...above];
}

class Stage {
  // `changed` is called when hand or wheel moved the camera.
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.box = null;  // [low, high] of what is shown, m
    this.solids = null;  // draws bodies that have shapes, where it can
    this.flat = '';  // why it cannot
    this.strength = 1;  // of lines
    this.reset(false);
    canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
    canvas.onpointermove = (event) => {
      if (!event.buttons) return;
      const camera = this.camera;
      if (this.spatial && !event.shiftKey && event.buttons === 1) {
        camera.yaw -= 0.008 * event.movementX;
        camera.pitch = Math.max(-1.55, Math.min(1.55, camera.pitch + 0.008 * event.movementY));
      } else {
        camera.x += event.movementX;
        camera.y += event.movementY;
      }
      changed();
    };
    canvas.onwheel = (event) => {
      event.preventDefault();
      const zoom = this.camera.zoom * Math.exp(-0.0012 * event.deltaY);
      this.camera.zoom = Math.max(0.05, Math.min(100, zoom));
      changed();
    };
    canvas.ondblclick = () => { Object.assign(this.camera, {zoom: 1, x: 0, y: 0}); changed(); };
  }

  reset(spatial) {
    this.spatial = spatial;
    this.camera = spatial ? {yaw: -0.9, pitch: 0.45} : {yaw: 0, pitch: Math.PI / 2};
    Object.assign(this.camera, {zoom: 1, x: 0, y: 0});
  }

  get size() {
    return Math.hypot(...this.box[1].map((high, k) => high - this.box[0][k])) || 1;
  }

  // Clear the canvas, and draw the ground and the scale; what is drawn next lies on them.
  begin() {
    Object.assign(this, sheet(this.canvas));
    if (!this.box) return false;
    this.aim();
    this.drawScale(this.drawGrid());
    return true;
  }

  // `project`: world (m) to screen: [x, y, depth]; depth grows towards the eye. `axes`: directions
  // in the world of right, up and the eye; `scale`: pixels per m; `middle` (m) is in the centre of
  // the screen until a hand moves it.
  aim() {
    const {width, height, box} = this;
    const {yaw, pitch, zoom, x, y} = this.camera;
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const middle = this.middle = box[0].map((low, k) => (low + box[1][k]) / 2);
    const axes = this.axes = [[cy, sy, 0], [-sp * sy, sp * cy, cp], [cp * sy, -cp * cy, sp]];
    const turn = (px, py, pz) => axes.map(([a, b, c]) => a * px + b * py + c * pz);
    // Room for every corner of the box, so that turning changes nothing in size while playing.
    const spans = [0, 0];
    for (let corner = 0; corner < 8; corner++) {
      const place = turn(...middle.map((m, k) => box[corner >> k & 1][k] - m));
      for (const k of [0, 1]) spans[k] = Math.max(spans[k], Math.abs(place[k]));
    }
    const floor = 0.1 * this.size;
    const fit = Math.min(width / Math.max(spans[0], floor), height / Math.max(spans[1], floor));
    const scale = this.scale = 0.36 * zoom * fit;
    this.project = (px, py, pz) => {
      const [u, v, depth] = turn(px - middle[0], py - middle[1], pz - middle[2]);
      return [width / 2 + x + scale * u, height / 2 + y - scale * v, depth];
    };
  }

  drawGrid() {
    const {pen, project, scale, box, spatial} = this;
    const step = niceStep(60 / scale);
    const floor = spatial ? box[0][2] : 0;
    const reach = spatial ? 0.5 * this.size : Math.max(this.size, 1.5 * this.width / scale);
    const ends = [0, 1].map((k) => {
      const middle = (box[0][k] + box[1][k]) / 2;
      return [Math.floor((middle - reach) / step), Math.ceil((middle + reach) / step)];
    });
    pen.strokeStyle = colors.grid;
    pen.lineWidth = 1;
    pen.beginPath();
    for (let k = 0; k < 2; k++) {
      for (let n = ends[k][0]; n <= ends[k][1]; n++) {
        for (const end of ends[1 - k]) {
          const place = k ? [end * step, n * step] : [n * step, end * step];
          const [u, v] = project(...place, floor);
          if (end === ends[1 - k][0]) pen.moveTo(u, v); else pen.lineTo(u, v);
        }
      }
    }
    pen.stroke();
    return step;
  }

  drawScale(step) {
    const {pen} = this, [right, low] = [this.width - 16, this.height - 14];
    pen.strokeStyle = pen.fillStyle = colors.faint;
    pen.textAlign = 'right';
    pen.fillText(`${Number(step.toPrecision(1))} m`, right, low - 6);
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(right - step * this.scale, low);
    pen.lineTo(right, low);
    pen.stroke();
  }

  // `trail`: pictures in turn, each the places of the same points.
  drawTrails(trail, color = colors.link) {
    const {pen} = this;
    pen.strokeStyle = color;
    pen.lineWidth = 1;
    pen.globalAlpha = 0.35;
    pen.beginPath();
    for (let n = 0; n + 2 < (trail[0]?.length ?? 0); n += 3) {
      trail.forEach((places, k) => {
        const [u, v] = this.project(...places.slice(n, n + 3));
        if (k) pen.lineTo(u, v); else pen.moveTo(u, v);
      });
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  // Of each wheel its centre and two places on its rim, a right angle apart; a mark shows it turn.
  drawWheels(list, color = colors.link) {
    const {pen} = this, places = triples(list);
    pen.strokeStyle = color;
    pen.globalAlpha = this.strength;
    pen.lineWidth = 1.5;
    for (let n = 0; n + 2 < places.length; n += 3) {
      const [centre, a, b] = places.slice(n, n + 3);
      pen.beginPath();
      pen.moveTo(...this.project(...centre.map((x, i) => x + 0.7 * (a[i] - x))).slice(0, 2));
      for (let k = 0; k <= 72; k++) {
        const [c, s] = [Math.cos(k * Math.PI / 36), Math.sin(k * Math.PI / 36)];
        const at = centre.map((x, i) => x + c * (a[i] - x) + s * (b[i] - x));
        pen.lineTo(...this.project(...at).slice(0, 2));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  // What the picture of bodies lacks: `missing` meshes, and why there are outlines only.
  drawNotes(missing) {
    const {pen} = this, notes = this.flat ? [this.flat] : [];
    if (missing) notes.push(missing === 1 ? '1 mesh is not drawn' : `${missing} meshes are not drawn`);
    pen.fillStyle = colors.faint;
    pen.textAlign = 'left';
    notes.forEach((note, n) => pen.fillText(note, 12, this.height - 14 - 16 * n, this.width - 120));
  }

  // Bodies of groups {points, shapes, color, opacity}, and the lines that `drawLines` draws. Of
  // each shape `points` has its middle and the ends of its three half axes. Lines under solid
  // bodies shine through.
  drawBodies(groups, drawLines) {
    const some = groups.some(({shapes}) => shapes.length);
    const picture = some && this.solids ? this.solids.picture(this, groups) : null;
    if (!picture) for (const {points, shapes, color} of groups) this.drawOutlines(points, shapes, color);
    drawLines();
    if (!picture) return;
    this.pen.drawImage(picture, 0, 0, this.width, this.height);
    this.strength = 0.35;
    drawLines();
    this.strength = 1;
  }

  // Translucent outlines of shapes. What overlaps in one colour is filled once.
  drawOutlines(list, shapes, color) {
    const {pen} = this, places = triples(list), fills = new Map();
    shapes.forEach((shape, n) => {
      const ends = places.slice(4 * n, 4 * n + 4);
      if (shape.kind === 'mesh' && !shape.mesh) return;  // has not come yet
      if (ends.length < 4 || ends.flat().some((x) => !Number.isFinite(x))) return;
      const [r, g, b, opacity] = shape.color ?? [];
      const own = shape.color ? `rgb(${[r, g, b].map((x) => Math.round(255 * x)).join(' ')})` : color;
      const key = `${own} ${opacity ?? 1}`;
      if (!fills.has(key)) fills.set(key, {own, opacity: opacity ?? 1, path: new Path2D()});
      const {path} = fills.get(key);
      hull(this.silhouette(shape, ends)).forEach(([u, v], k) => path[k ? 'lineTo' : 'moveTo'](u, v));
      path.closePath();
    });
    pen.lineWidth = 1;
    for (const {own, opacity, path} of fills.values()) {
      pen.fillStyle = pen.strokeStyle = own;
      pen.globalAlpha = 0.25 * opacity;
      pen.fill(path);
      pen.globalAlpha = 0.25 + 0.45 * opacity;
      pen.stroke(path);
    }
    pen.globalAlpha = 1;
  }

  // Places on the screen whose convex hull is the outline of a shape.
  silhouette({kind, mesh}, [middle, ...ends]) {
    const axes = ends.map((end) => end.map((x, k) => x - middle[k]));
    const at = (a, b, c) => this.project(...middle.map((x, k) => x + a * axes[0][k] + b * axes[1][k] + c * axes[2][k]));
    const turns = Array.from({length: 48}, (_, k) => [Math.cos(k * Math.PI / 24), Math.sin(k * Math.PI / 24)]);
    if (mesh) return triples([...mesh.extremes]).map((place) => at(...place));
    if (kind === 'box') return Array.from({length: 8}, (_, k) => at(...[0, 1, 2].map((axis) => k >> axis & 1 ? 1 : -1)));
    if (kind === 'cylinder') return turns.flatMap(([c, s]) => [at(c, s, 1), at(c, s, -1)]);
    const [u, v] = this.project(...middle), radius = this.scale * Math.hypot(...axes[0]);
    return turns.map(([c, s]) => [u + radius * c, v + radius * s]);
  }

  // Ends of thin lines in turn.
  drawLines(list, color = colors.link) {
    const {pen} = this, ends = triples(list);
    pen.strokeStyle = color;
    pen.globalAlpha = this.strength;
    pen.lineWidth = 1.5;
    pen.beginPath();
    for (let n = 0; n + 1 < ends.length; n += 2) {
      pen.moveTo(...this.project(...ends[n]).slice(0, 2));
      pen.lineTo(...this.project(...ends[n + 1]).slice(0, 2));
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  // Ends of lines in turn, and joints. What is farther away first, and a little paler. Lines are
  // thin where shapes show the bodies.
  drawLinks(links, joints, color = colors.link, thin = false) {
    const {pen, spatial, size} = this;
    const ends = triples(links).map((place) => this.project(...place));
    const parts = [];
    for (let n = 0; n + 1 < ends.length; n += 2) {
      parts.push({depth: (ends[n][2] + ends[n + 1][2]) / 2, line: [ends[n], ends[n + 1]]});
    }
    for (const place of triples(joints)) {
      const at = this.project(...place);
      parts.push({depth: at[2] + 1e-3 * size, at});
    }
    parts.sort((one, other) => one.depth - other.depth);
    pen.lineCap = 'round';
    pen.strokeStyle = color;
    pen.fillStyle = colors.joint;
    for (const {depth, line, at} of parts) {
      pen.globalAlpha = this.strength * (spatial ? 0.78 + 0.22 * Math.tanh(4 * depth / size) : 1);
      pen.lineWidth = at ? 2.5 : thin ? 2 : 6;
      pen.beginPath();
      if (at) {
        pen.arc(at[0], at[1], thin ? 3.5 : 5.5, 0, 2 * Math.PI);
        pen.fill();
      } else {
        pen.moveTo(line[0][0], line[0][1]);
        pen.lineTo(line[1][0], line[1][1]);
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  // Tails and tips in turn. Near singular positions forces have no limit: arrows have.
  drawArrows(list, color, factor) {
    const {pen} = this, places = triples(list);
    pen.strokeStyle = pen.fillStyle = color;
    pen.lineWidth = 2;
    for (let n = 0; n + 1 < places.length; n += 2) {
      const [tail, tip] = [places[n], places[n + 1]];
      const vector = tip.map((x, k) => factor * (x - tail[k]));
      const length = Math.hypot(...vector);
      if (!(length > 0)) continue;
      const part = Math.min(1, this.size / length);
      const [from, to] = [tail, tail.map((x, k) => x + part * vector[k])].map((place) => this.project(...place));
      const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
      const drawn = Math.hypot(to[0] - from[0], to[1] - from[1]);
      if (drawn < 2) continue;
      const head = Math.min(11, 0.5 * drawn);
      const barb = (turn) => [to[0] - head * Math.cos(angle + turn), to[1] - head * Math.sin(angle + turn)];
      pen.beginPath();
      pen.moveTo(from[0], from[1]);
      pen.lineTo(to[0] - 0.7 * head * Math.cos(angle), to[1] - 0.7 * head * Math.sin(angle));
      pen.stroke();
      pen.beginPath();
      pen.moveTo(to[0], to[1]);
      pen.lineTo(...barb(0.4));
      pen.lineTo(...barb(-0.4));
      pen.fill();
    }
  }
}

'use strict';
// The live view: pictures come as server-sent events, commands go back as posts. No library.

const $ = (id) => document.getElementById(id);
const WINDOW = 20;  // simulated seconds in a plot
const TRAIL = 90, BOXES = 300;  // pictures
const colors = {};
let about = {joints: [], reacting: [], reports: [], scenes: [], run: -1, state: 'connecting'};
let picture = null;
let record = [];  // {t, energy, error}
let trail = [];  // positions of all joints
let boxes = [];  // [low, high] of each picture
let box = null;  // of the last of them together: what travels far is followed
let camera = {};

// ------------------------------------------------------------------------------------- commands

let complaint = '';

async function ask(what, value) {
  complaint = '';
  try {
    const headers = {'Content-Type': 'application/json'};
    const body = JSON.stringify({do: what, value});
    const answer = await (await fetch('command', {method: 'POST', headers, body})).json();
    if (!answer.done) complaint = answer.said;
  } catch {
    complaint = 'the view does not answer';
  }
  showReports();
}

// A slider gives more values than are worth sending: one at a time, and always the last.
const efforts = {};
let pushing = false;

async function push() {
  if (pushing) return;
  pushing = true;
  while (Object.keys(efforts).length) {
    const sent = {...efforts};
    for (const name in sent) delete efforts[name];
    await ask('effort', sent);
  }
  pushing = false;
}

$('pause').onclick = () => ask(about.state === 'playing' ? 'pause' : 'play');
$('step').onclick = () => ask('step', Number($('ticks').value));
$('reset').onclick = () => ask('reset');
$('speed').onchange = () => ask('speed', Number($('speed').value));
$('scenes').onchange = () => ask('scene', $('scenes').value);
$('range').onchange = rangeJoints;
$('zero').onclick = () => {
  for (const slider of document.querySelectorAll('#joints input')) setSlider(slider, 0);
  push();
};
document.onkeydown = (event) => {
  if (event.target !== document.body) return;
  const button = {' ': 'pause', ArrowRight: 'step', r: 'reset'}[event.key];
  if (button) $(button).click();
};

// ------------------------------------------------------------------------------- words and lists

function setSlider(slider, value) {
  slider.value = value;
  slider.parentNode.lastChild.textContent = shown(Number(slider.value));
  efforts[slider.dataset.joint] = Number(slider.value);
}

function listJoints() {
  $('joints').replaceChildren(...about.joints.map((name) => {
    const item = document.createElement('div');
    item.className = 'joint';
    item.innerHTML = '<div class="row"><b></b><span class="reaction"></span></div>' +
      '<div class="numbers"><span></span><span></span><span></span></div>' +
      '<div class="row"><input type="range" step="any"><output>0</output></div>';
    item.querySelector('b').textContent = name;
    const slider = item.querySelector('input');
    slider.dataset.joint = name;
    slider.setAttribute('aria-label', `effort on ${name}`);
    slider.oninput = () => { setSlider(slider, slider.value); push(); };
    slider.ondblclick = () => { setSlider(slider, 0); push(); };
    return item;
  }));
  rangeJoints();
}

function rangeJoints() {
  const most = Math.abs(Number($('range').value)) || 1;
  for (const slider of document.querySelectorAll('#joints input')) {
    const value = slider.value;
    Object.assign(slider, {min: -most, max: most, value: slider.dataset.set ? value : 0});
    slider.dataset.set = 'yes';
  }
}

function showJoints() {
  [...$('joints').children].forEach((item, n) => {
    const [at, rate, effort] = item.querySelectorAll('.numbers span');
    at.textContent = shown(picture.position?.[n]);
    rate.textContent = `${shown(picture.velocity?.[n])} /s`;
    effort.textContent = `effort ${shown(picture.effort?.[n])}`;
    const place = about.reacting.indexOf(about.joints[n]);
    const force = picture.force?.[place];
    item.querySelector('.reaction').textContent = force === undefined ? '' : `${shown(force)} N`;
  });
}

function shown(x) {
  if (x === undefined || x === null) return '–';
  const size = Math.abs(x);
  if (!size) return '0';
  return size < 1e-3 || size >= 1e5 ? x.toExponential(2) : x.toPrecision(4);
}

function showReports() {
  const reports = about.reports.map(([task, level, message]) => {
    const span = document.createElement('span');
    span.className = `l${level}`;
    span.textContent = `${task}: ${message}`;
    return span;
  });
  if (complaint) {
    const said = document.createElement('span');
    said.className = 'said';
    said.textContent = complaint;
    reports.unshift(said);
  }
  $('reports').replaceChildren(...reports);
}

// ---------------------------------------------------------------------------------------- events

function forget() {
  record = [];
  trail = [];
  boxes = [];
  box = null;
  picture = null;
  camera = about.spatial ? {yaw: -0.9, pitch: 0.45} : {yaw: 0, pitch: Math.PI / 2};
  Object.assign(camera, {zoom: 1, x: 0, y: 0});
  for (const name in efforts) delete efforts[name];
}

function onAbout(found) {
  const before = about;
  about = found;
  const names = (list) => list.join('\n');
  if (found.run !== before.run) forget();
  if (found.run !== before.run || names(found.joints) !== names(before.joints)) listJoints();
  if (names(found.scenes) !== names(before.scenes)) {
    const first = new Option('load …', '');
    $('scenes').replaceChildren(first, ...found.scenes.map((name) => new Option(name, name)));
  }
  $('scenes').value = found.scenes.includes(found.scene) ? found.scene : '';
  $('scene').textContent = found.scene || 'alf_ros';
  document.title = found.scene ? `${found.scene} · alf_ros` : 'alf_ros';
  $('state').textContent = found.state === 'away' ? `no ${found.simulator}` : found.state;
  $('state').className = `badge ${found.state}`;
  $('pause').textContent = found.state === 'playing' ? 'Pause' : 'Play';
  const known = !['away', 'no view'].includes(found.state);
  $('pause').disabled = $('reset').disabled = !known;
  $('step').disabled = !known || found.state === 'playing';
  showReports();
  draw();
}

function onPicture(found) {
  const first = !picture;
  picture = found;
  const last = record.at(-1);
  if (last && found.t < last.t) {
    forget();
    listJoints();
    picture = found;
  }
  if (found.t !== undefined && found.t !== record.at(-1)?.t) {
    record.push({t: found.t, energy: found.energy, error: found.violation?.[0]});
    while (record[0].t < found.t - WINDOW) record.shift();
    if (found.joints) trail.push(found.joints);
    if (trail.length > TRAIL) trail.shift();
  }
  if (found.links) enclose([...found.links, ...found.joints ?? []]);
  if (first || $('range').dataset.run !== String(about.run)) suggestRange();
  $('time').textContent = found.t === undefined ? '' : `${found.t.toFixed(3)} s`;
  showJoints();
  draw();
}

// The reactions say how large efforts are here: forces times lengths.
function suggestRange() {
  if (!picture.force || !box) return;
  const most = Math.max(...picture.force.map(Math.abs)) * size() || 1;
  const power = 10 ** Math.floor(Math.log10(most));
  $('range').value = power * [1, 2, 5, 10].find((n) => n * power >= 0.99 * most);
  $('range').dataset.run = about.run;
  rangeJoints();
}

function connect() {
  const source = new EventSource('events');
  source.addEventListener('about', (event) => onAbout(JSON.parse(event.data)));
  source.addEventListener('picture', (event) => onPicture(JSON.parse(event.data)));
  // The browser tries again by itself; another view may have another count of runs.
  source.onerror = () => onAbout({...about, run: -1, state: 'no view', reports: []});
}

// --------------------------------------------------------------------------------------- drawing

function enclose(places) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  places.forEach((x, n) => {
    low[n % 3] = Math.min(low[n % 3], x ?? Infinity);
    high[n % 3] = Math.max(high[n % 3], x ?? -Infinity);
  });
  boxes.push([low, high]);
  if (boxes.length > BOXES) boxes.shift();
  const extreme = (end, pick) => [0, 1, 2].map((k) => pick(...boxes.map((each) => each[end][k])));
  box = [extreme(0, Math.min), extreme(1, Math.max)];
}

const size = () => Math.hypot(...box[1].map((high, k) => high - box[0][k])) || 1;

function sheet(id) {
  const canvas = $(id), scale = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
  if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
  const pen = canvas.getContext('2d');
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = '12px system-ui, sans-serif';
  return {pen, width, height};
}

// World (m) to screen: [x, y, depth]; depth grows towards the eye.
function projector(width, height) {
  const {yaw, pitch, zoom, x, y} = camera;
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  const middle = box[0].map((low, k) => (low + box[1][k]) / 2);
  const turn = (px, py, pz) => {
    const along = -sy * px + cy * py;
    return [cy * px + sy * py, sp * along + cp * pz, -cp * along + sp * pz];
  };
  // Room for every corner of the box, so that turning changes nothing in size while playing.
  const spans = [0, 0];
  for (let corner = 0; corner < 8; corner++) {
    const place = turn(...middle.map((m, k) => box[corner >> k & 1][k] - m));
    for (const k of [0, 1]) spans[k] = Math.max(spans[k], Math.abs(place[k]));
  }
  const floor = 0.1 * size();
  const fit = Math.min(width / Math.max(spans[0], floor), height / Math.max(spans[1], floor));
  const scale = 0.36 * zoom * fit;
  const project = (px, py, pz) => {
    const [u, v, depth] = turn(px - middle[0], py - middle[1], pz - middle[2]);
    return [width / 2 + x + scale * u, height / 2 + y - scale * v, depth];
  };
  return {project, scale};
}

function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((n) => n * power >= least);
}

function drawGrid(pen, project, scale, width) {
  const step = niceStep(60 / scale);
  const floor = about.spatial ? box[0][2] : 0;
  const reach = about.spatial ? 0.5 * size() : Math.max(size(), 1.5 * width / scale);
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

function drawStage() {
  const {pen, width, height} = sheet('stage');
  if (!picture?.links || !box) {
    pen.fillStyle = colors.faint;
    pen.textAlign = 'center';
    pen.fillText(about.state === 'away' ? `waiting for ${about.simulator} …` : '', width / 2, height / 2);
    return;
  }
  const {project, scale} = projector(width, height);
  const step = drawGrid(pen, project, scale, width);
  drawScale(pen, step, scale, width, height);
  if ($('trails').checked) drawTrails(pen, project);
  drawLinks(pen, project);
  if ($('reactions').checked) drawArrows(pen, project, picture.reactions, colors.reaction);
  drawArrows(pen, project, picture.applied, colors.applied);
}

function drawScale(pen, step, scale, width, height) {
  const [right, low] = [width - 16, height - 14];
  pen.strokeStyle = pen.fillStyle = colors.faint;
  pen.textAlign = 'right';
  pen.fillText(`${Number(step.toPrecision(1))} m`, right, low - 6);
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(right - step * scale, low);
  pen.lineTo(right, low);
  pen.stroke();
}

function triples(list) {
  const found = [];
  for (let n = 0; n + 2 < (list?.length ?? 0); n += 3) found.push(list.slice(n, n + 3));
  return found;
}

function drawTrails(pen, project) {
  pen.strokeStyle = colors.link;
  pen.lineWidth = 1;
  pen.globalAlpha = 0.35;
  pen.beginPath();
  for (let n = 0; n + 2 < (trail[0]?.length ?? 0); n += 3) {
    trail.forEach((places, k) => {
      const [u, v] = project(...places.slice(n, n + 3));
      if (k) pen.lineTo(u, v); else pen.moveTo(u, v);
    });
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

// What is farther away first, and a little paler.
function drawLinks(pen, project) {
  const ends = triples(picture.links).map((place) => project(...place));
  const parts = [];
  for (let n = 0; n + 1 < ends.length; n += 2) {
    parts.push({depth: (ends[n][2] + ends[n + 1][2]) / 2, line: [ends[n], ends[n + 1]]});
  }
  for (const place of triples(picture.joints)) {
    const at = project(...place);
    parts.push({depth: at[2] + 1e-3 * size(), at});
  }
  parts.sort((one, other) => one.depth - other.depth);
  pen.lineCap = 'round';
  pen.strokeStyle = colors.link;
  pen.fillStyle = colors.joint;
  for (const {depth, line, at} of parts) {
    pen.globalAlpha = about.spatial ? 0.78 + 0.22 * Math.tanh(4 * depth / size()) : 1;
    pen.lineWidth = at ? 2.5 : 6;
    pen.beginPath();
    if (at) {
      pen.arc(at[0], at[1], 5.5, 0, 2 * Math.PI);
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
function drawArrows(pen, project, list, color) {
  const factor = 10 ** Number($('scale').value), longest = size();
  const places = triples(list);
  pen.strokeStyle = pen.fillStyle = color;
  pen.lineWidth = 2;
  for (let n = 0; n + 1 < places.length; n += 2) {
    const [tail, tip] = [places[n], places[n + 1]];
    const vector = tip.map((x, k) => factor * (x - tail[k]));
    const length = Math.hypot(...vector);
    if (!(length > 0)) continue;
    const part = Math.min(1, longest / length);
    const [from, to] = [project(...tail), project(...tail.map((x, k) => x + part * vector[k]))];
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

// `value` of an entry is drawn, on a height of at least `least`; `now` and `span` put it in words.
function drawPlot(id, {title, color, value, least, now, span}) {
  const {pen, width, height} = sheet(id);
  const found = record.filter((entry) => Number.isFinite(value(entry)));
  pen.fillStyle = colors.faint;
  pen.textAlign = 'left';
  pen.fillText(title, 12, 18);
  if (!found.length) return;
  let low = Math.min(...found.map(value)), high = Math.max(...found.map(value));
  const room = 1.15 * Math.max(high - low, least(Math.max(Math.abs(low), Math.abs(high))));
  [low, high] = [(low + high - room) / 2, (low + high + room) / 2];
  const [left, right, top, bottom] = [12, width - 12, 28, height - 18];
  const last = found.at(-1).t, first = Math.max(found[0].t, last - WINDOW);
  const until = Math.max(last, first + 1);
  const u = (t) => left + (right - left) * (t - first) / (until - first);
  const v = (x) => bottom - (bottom - top) * (x - low) / (high - low);
  pen.strokeStyle = colors.grid;
  pen.lineWidth = 1;
  pen.strokeRect(left, top, right - left, bottom - top);
  pen.strokeStyle = color;
  pen.lineWidth = 1.5;
  pen.beginPath();
  found.forEach((entry, n) => pen[n ? 'lineTo' : 'moveTo'](u(entry.t), v(value(entry))));
  pen.stroke();
  pen.fillText(`${first.toFixed(1)} s`, left, height - 4);
  pen.textAlign = 'right';
  pen.fillText(`${until.toFixed(1)} s`, right, height - 4);
  pen.fillText(span(low, high), right, 18);
  pen.fillStyle = color;
  pen.font = '600 12px system-ui, sans-serif';
  pen.textAlign = 'left';
  pen.fillText(now(found.at(-1)), 12 + pen.measureText(title).width + 14, 18);
}

function drawPlots() {
  drawPlot('energy', {
    title: 'energy',
    color: colors.energy,
    value: (entry) => entry.energy ?? NaN,
    least: (most) => 1e-6 * most || 1e-6,
    now: (entry) => `${Number(entry.energy.toPrecision(9))} J`,
    span: (low, high) => `height ${shown(high - low)} J`,
  });
  drawPlot('violation', {
    title: 'largest |Φ|',
    color: colors.error,
    value: (entry) => Math.log10(Math.max(entry.error, 1e-17)),
    least: () => 2,
    now: (entry) => entry.error.toExponential(1),
    span: (low, high) => `1e${Math.ceil(low)} to 1e${Math.floor(high)}`,
  });
}

let drawing = false;

function draw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    drawStage();
    drawPlots();
  });
}

function readColors() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['ink', 'faint', 'line', 'link', 'joint', 'reaction', 'applied', 'energy', 'error', 'grid']) {
    colors[name] = style.getPropertyValue(`--${name}`);
  }
  draw();
}

// -------------------------------------------------------------------------------- hand and wheel

$('stage').onpointerdown = (event) => event.target.setPointerCapture(event.pointerId);
$('stage').onpointermove = (event) => {
  if (!event.buttons) return;
  if (about.spatial && !event.shiftKey && event.buttons === 1) {
    camera.yaw -= 0.008 * event.movementX;
    camera.pitch = Math.max(-1.55, Math.min(1.55, camera.pitch + 0.008 * event.movementY));
  } else {
    camera.x += event.movementX;
    camera.y += event.movementY;
  }
  draw();
};
$('stage').onwheel = (event) => {
  event.preventDefault();
  camera.zoom = Math.max(0.05, Math.min(100, camera.zoom * Math.exp(-0.0012 * event.deltaY)));
  draw();
};
$('stage').ondblclick = () => { Object.assign(camera, {zoom: 1, x: 0, y: 0}); draw(); };
for (const id of ['reactions', 'trails', 'scale']) $(id).oninput = draw;
matchMedia('(prefers-color-scheme: dark)').onchange = readColors;
onresize = draw;
forget();
readColors();
connect();

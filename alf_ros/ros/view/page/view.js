'use strict';
// The live view: pictures come as server-sent events, commands go back as posts.

const $ = (id) => document.getElementById(id);
const WINDOW = 20;  // simulated seconds in a plot
const TRAIL = 90, BOXES = 300;  // pictures
let about = {joints: [], units: [], driven: [], balls: [], drives: [], drive_units: [], reacting: [], reports: [],
  scenes: [], run: -1, state: 'connecting'};
let picture = null;
let record = [];  // {t, energy, error}
let trail = [];  // positions of all joints
let boxes = [];  // [low, high] of each picture; the last of them together are shown: what travels far is followed
const stage = new Stage($('stage'), () => draw());

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
    const fixed = about.driven.includes(name) ? 'driven' : about.balls.includes(name) ? 'of a ball' : '';
    if (fixed) {
      item.lastChild.remove();
      item.querySelector('b').dataset.note = fixed;
      return item;
    }
    const slider = item.querySelector('input');
    slider.dataset.joint = name;
    slider.setAttribute('aria-label', `effort on ${name}`);
    slider.oninput = () => { setSlider(slider, slider.value); push(); };
    slider.ondblclick = () => { setSlider(slider, 0); push(); };
    return item;
  }));
  $('drives').replaceChildren(...about.drives.map((name) => {
    const item = document.createElement('div');
    item.className = 'joint row';
    item.innerHTML = '<b></b><span></span>';
    item.querySelector('b').textContent = name;
    return item;
  }));
  $('drives').hidden = !about.drives.length;
  rangeJoints();
}

// A number with its unit; the unit of a scene that could not be read is not known.
const quantity = (x, unit) => (unit ? `${shown(x)} ${unit}` : shown(x));

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
    const unit = about.units[n];
    at.textContent = quantity(picture.position?.[n], unit);
    rate.textContent = unit ? `${shown(picture.velocity?.[n])} ${unit}/s` : `${shown(picture.velocity?.[n])} /s`;
    effort.textContent = `effort ${quantity(picture.effort?.[n], {rad: 'N m', m: 'N'}[unit])}`;
    const place = about.reacting.indexOf(about.joints[n]);
    const force = picture.force?.[place];
    item.querySelector('.reaction').textContent = force === undefined ? '' : `reaction ${shown(force)} N`;
  });
  [...$('drives').children].forEach((item, n) => {
    item.lastChild.textContent = `effort ${quantity(picture.drives?.[n], about.drive_units[n])}`;
  });
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
  $('reports').classList.toggle('gone', gone());
}

// ---------------------------------------------------------------------------------------- events

// Whether nobody reports: what is shown is old.
const gone = () => ['away', 'no view', 'connecting'].includes(about.state);

function forget() {
  record = [];
  trail = [];
  boxes = [];
  stage.box = null;
  picture = null;
  stage.reset(about.spatial);
  for (const name in efforts) delete efforts[name];
}

function onAbout(found) {
  const before = about;
  about = found;
  const names = (list) => list.join('\n');
  if (found.run !== before.run) forget();
  const listed = (each) => names([...each.joints, '', ...each.driven, '', ...each.balls, '', ...each.drives]);
  if (found.run !== before.run || listed(found) !== listed(before)) listJoints();
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
  const known = !gone();
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
  const ends = found.shape_points ?? [];
  if (found.links) enclose([...found.links, ...found.joints ?? [], ...found.wheels ?? [], ...ends, ...otherEnds(ends)]);
  if (first || $('range').dataset.run !== String(about.run)) suggestRange();
  $('time').textContent = found.t === undefined ? '' : `${found.t.toFixed(3)} s`;
  showJoints();
  wantSolids();
  draw();
}

// The reactions say how large efforts are here: forces times lengths.
function suggestRange() {
  if (!picture.force || !stage.box) return;
  const most = Math.max(...picture.force.map(Math.abs)) * stage.size || 1;
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

// ---------------------------------------------------------------------------------------- solids

const meshes = new Map();  // by name; null until it came
let asked = false;

// three.js is loaded for the first scene whose bodies have shapes.
function wantSolids() {
  if (asked || !picture.shapes?.length) return;
  asked = true;
  if (about.flat) stage.flat = about.flat;
  else startSolids(stage, bringThree).then(draw);
}

function bringThree() {
  return new Promise((done, failed) => {
    const script = document.createElement('script');
    Object.assign(script, {src: 'three.js', onload: done, onerror: () => failed(new Error('three.js does not come'))});
    document.head.append(script);
  });
}

function meshOf(name) {
  if (name && !meshes.has(name)) {
    meshes.set(name, null);
    fetch(`mesh/${name}`).then((answer) => answer.text())
      .then((text) => { meshes.set(name, JSON.parse(text, unpacked)); draw(); })
      .catch(() => meshes.delete(name));
  }
  return meshes.get(name);
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
  stage.box = [extreme(0, Math.min), extreme(1, Math.max)];
}

function drawStage() {
  const known = stage.begin();
  if (!known || !picture?.links) {
    const {pen, width, height} = stage;
    pen.fillStyle = colors.faint;
    pen.textAlign = 'center';
    pen.fillText(about.state === 'away' ? `waiting for ${about.simulator} …` : '', width / 2, height / 2);
    return;
  }
  const factor = 10 ** Number($('scale').value);
  if ($('trails').checked) stage.drawTrails(trail);
  stage.drawNotes(picture.missing);
  const shapes = (picture.shapes ?? []).map((shape) => ({...shape, mesh: meshOf(shape.mesh)}));
  stage.drawBodies([{points: picture.shape_points ?? [], shapes, color: colors.body}], () => {
    stage.drawLines(picture.wheels);
    stage.drawLines(picture.symbols);
    stage.drawLinks(picture.links, picture.joints, colors.link, shapes.length > 0);
  });
  if ($('reactions').checked) stage.drawArrows(picture.reactions, colors.reaction, factor);
  stage.drawArrows(picture.applied, colors.applied, factor);
}

// `value` of an entry is drawn, on a height of at least `least`; `now` and `span` put it in words.
function drawPlot(id, {title, color, value, least, now, span}) {
  const {pen, width, height} = sheet($(id));
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
  const [said, about_it] = [now(found.at(-1)), span(low, high)];
  pen.font = '600 12px system-ui, sans-serif';
  const used = 12 + pen.measureText(title).width + 14 + pen.measureText(said).width + 14;
  pen.font = '12px system-ui, sans-serif';
  if (used + pen.measureText(about_it).width < right) pen.fillText(about_it, right, 18);
  pen.fillStyle = color;
  pen.font = '600 12px system-ui, sans-serif';
  pen.textAlign = 'left';
  pen.fillText(said, 12 + pen.measureText(title).width + 14, 18);
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

function onColors() {
  readColors();
  draw();
}

for (const id of ['reactions', 'trails', 'scale']) $(id).oninput = draw;
matchMedia('(prefers-color-scheme: dark)').onchange = onColors;
onresize = draw;
forget();
onColors();
connect();

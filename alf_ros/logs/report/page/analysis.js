'use strict';
// One analysis of logs: the mechanism, plots and lists, with one cursor in time.

const $ = (id) => document.getElementById(id);
const SMOOTH = 0.05;  // s between frames, up to which what lies between them is drawn
const TRAIL = 2;  // s
const data = JSON.parse($('data').textContent, unpacked);

const letter = (n) => String.fromCharCode(65 + n % 26);

// ---------------------------------------------------------------------------------------- motion

// What is there at time t of frames (numbers of `width` each): the frame before, or between two.
function frameAt({t, values, width}, time) {
  const last = t.length - 1, k = Math.max(0, Math.min(last, below(t, time + 1e-6) - 1));
  const one = values.subarray(k * width, (k + 1) * width);
  if (k === last || t[k + 1] - t[k] > SMOOTH || time <= t[k]) return one;
  const part = (time - t[k]) / (t[k + 1] - t[k]), other = (k + 1) * width;
  return one.map((x, n) => x + part * (values[other + n] - x));
}

class Motion {
  constructor(log, number) {
    const {motion} = log;
    Object.assign(this, motion, {number, D: motion.spatial ? 3 : 2, first: log.first});
    this.untraced = new Set([...motion.wheels, ...motion.symbols, ...motion.shapePoints]);
    for (const shape of this.shapes) shape.mesh = motion.meshes[shape.mesh];
    this.moving = new Map(motion.moving.map((point, n) => [point, n]));
    const box = this.extent(0, this.frames.t.length), one = this.extent(0, 1);
    this.box = box;
    const size = ([low, high]) => Math.hypot(...high.map((x, k) => x - low[k]));
    this.travels = size(box) > 5 * size(one);
    this.half = one[1].map((x, k) => Math.max(0.75 * (x - one[0][k]), 0.1 * size(one)));
  }

  // [low, high] of frames `from` up to `to`, with the fixed points
  extent(from, to) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const note = (x, n) => { low[n % 3] = Math.min(low[n % 3], x); high[n % 3] = Math.max(high[n % 3], x); };
    const {values, width} = this.frames;
    for (let k = from; k < to; k++) {
      const found = this.placesOf(values.subarray(k * width, (k + 1) * width));
      found.forEach(note);
      otherEnds(this.pick(found, this.shapePoints)).forEach(note);
    }
    return [low, high];
  }

  // Places of all points, three numbers each.
  places(time) {
    return this.placesOf(frameAt(this.frames, time - this.first));
  }

  placesOf(frame) {
    const found = Float32Array.from(this.still), {D} = this;
    for (const [point, n] of this.moving) {
      for (let k = 0; k < D; k++) found[3 * point + k] = frame[n * D + k];
    }
    return found;
  }

  pick(places, points) {
    return points.flatMap((point) => [...places.subarray(3 * point, 3 * point + 3)]);
  }

  reactions(places, time) {
    const {D, scale} = this;
    return this.forces.flatMap((each) => {
      const [first, last] = [each.t[0], each.t.at(-1)];
      if (time - this.first < first || time - this.first > last + 1) return [];
      const force = frameAt(each, time - this.first);
      return each.at.flatMap((point, n) => {
        const tail = [...places.subarray(3 * point, 3 * point + 3)];
        return [...tail, ...tail.map((x, k) => x + (k < D ? scale * force[n * D + k] : 0))];
      });
    });
  }

  applied(time) {
    if (!this.held) return [];
    const {t} = this.frames, {values, width} = this.held, found = [];
    const k = Math.max(0, below(t, time - this.first + 1e-6) - 1);
    for (let n = k * width; n < (k + 1) * width; n += 6) {
      if (Number.isNaN(values[n])) continue;
      const tail = [...values.subarray(n, n + 3)];
      found.push(...tail, ...tail.map((x, i) => x + this.scale * values[n + 3 + i]));
    }
    return found;
  }
}

const motions = data.logs.flatMap((log, n) => log.motion ? [new Motion(log, n)] : []);
const stage = new Stage($('stage'), draw);

function aim() {
  if (!motions.length) return;
  const follows = motions.some((motion) => motion.travels);
  const boxes = motions.map((motion) => {
    if (!follows) return motion.box;
    const moving = motion.places(view.t), low = [0, 0, 0];
    const points = [...motion.moving.keys()];
    points.forEach((point) => low.forEach((_, k) => { low[k] += moving[3 * point + k] / points.length; }));
    return [low.map((x, k) => x - motion.half[k]), low.map((x, k) => x + motion.half[k])];
  });
  const extreme = (end, pick) => [0, 1, 2].map((k) => pick(...boxes.map((box) => box[end][k])));
  stage.box = [extreme(0, Math.min), extreme(1, Math.max)];
}

function drawStage() {
  aim();
  if (!stage.begin()) {
    const {pen, width, height} = stage;
    pen.fillStyle = colors.faint;
    pen.textAlign = 'center';
    pen.fillText('no animation: see below', width / 2, height / 2);
    return;
  }
  const factor = 10 ** Number($('scale').value);
  stage.drawNotes(motions.reduce((sum, motion) => sum + motion.missing, 0));
  const seen = motions.map((motion) => ({
    motion,
    places: motion.places(view.t),
    color: motion.number ? colorOf(`log ${letter(motion.number)}`) : colors.link,
  }));
  if ($('trails').checked) for (const {motion, color} of seen) stage.drawTrails(trail(motion), color);
  const bodies = seen.map(({motion, places, color}) => ({
    points: motion.pick(places, motion.shapePoints),
    shapes: motion.shapes,
    color: motion.number ? color : colors.body,
    opacity: motion.number ? 0.5 : 1,
  }));
  stage.drawBodies(bodies, () => {
    for (const {motion, places, color} of seen) {
      stage.drawWheels(motion.pick(places, motion.wheels), color);
      stage.drawLines(motion.pick(places, motion.symbols), color);
      stage.drawLinks(motion.pick(places, motion.links), motion.pick(places, motion.pins), color, motion.shapes.length > 0);
    }
  });
  for (const {motion, places} of seen) {
    if ($('reactions').checked) stage.drawArrows(motion.reactions(places, view.t), colors.reaction, factor);
    stage.drawArrows(motion.applied(view.t), colors.applied, factor);
  }
}

function trail(motion) {
  const found = [], points = [...motion.moving.keys()].filter((point) => !motion.untraced.has(point));
  for (let n = 0; n <= 120; n++) {
    const t = view.t - TRAIL * (1 - n / 120);
    if (t >= data.logs[motion.number].first) found.push(motion.pick(motion.places(t), points));
  }
  return found;
}

async function bringThree() {
  const packed = Uint8Array.from(atob(data.three), (letter) => letter.charCodeAt(0));
  const text = new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'));
  const script = document.createElement('script');
  script.textContent = await new Response(text).text();
  document.head.append(script);
}

// -------------------------------------------------------------------------------------- timeline

class Timeline {
  constructor(host) {
    const section = document.createElement('section');
    section.className = 'plot';
    section.dataset.panel = 'timeline';
    section.innerHTML = '<header><h2>Timeline</h2><span class="help">drag: time · Shift + drag: zoom to it · Ctrl + wheel: zoom · double click: all</span></header>';
    host.append(section);
    const several = data.logs.length > 1;
    this.rows = data.logs.flatMap((log, n) => {
      const before = several ? `${letter(n)} ` : '';
      return [
        ...log.levels.map((each) => ({...each, label: `${before}${each.task}`, kind: 'level', end: log.last})),
        ...(log.passes.length ? [{label: `${before}singular`, kind: 'passes', passes: log.passes}] : []),
        ...log.orders.map((each) => ({...each, label: `${before}${each.label}`, kind: 'orders'})),
      ];
    });
    this.area = new Area(section, Math.max(2, this.rows.length) * 15 + MARGIN.top + MARGIN.bottom + 2);
    section.hidden = !this.rows.length;
  }

  draw() {
    const {pen, width, height} = sheet(this.area.canvas);
    if (!width) return;
    drawTimeAxis(pen, width, height);
    const within = (draw) => {
      pen.save();
      pen.beginPath();
      pen.rect(MARGIN.left - 1, 0, width - MARGIN.left - MARGIN.right + 2, height);
      pen.clip();
      draw();
      pen.restore();
    };
    this.rows.forEach((row, n) => {
      const y = MARGIN.top + 15 * n + 3;
      if (row.kind === 'level') within(() => this.drawLevels(pen, row, y, width));
      pen.font = '11px system-ui, sans-serif';
      pen.fillStyle = colors.faint;
      pen.textAlign = 'left';
      const room = MARGIN.left - 6;
      const long = pen.measureText(row.label).width;
      if (long > room) {
        pen.fillStyle = colors.sheet;
        pen.globalAlpha = 0.8;
        pen.fillRect(4, y - 2, long + 4, 13);
        pen.globalAlpha = 1;
        pen.fillStyle = colors.faint;
      }
      pen.fillText(row.label, 4, y + 8);
      // Marks are thin: over a long label, which would hide the first ones.
      if (row.kind === 'passes') within(() => this.drawPasses(pen, row.passes, y, width));
      if (row.kind === 'orders') within(() => this.drawMarks(pen, row.t, y, width, colors.applied));
    });
  }

  drawLevels(pen, {t, high, end}, y, width) {
    for (let k = 0; k < t.length; k++) {
      const until = k + 1 < t.length ? t[k + 1] : end;
      if (until < view.from || t[k] > view.to) continue;
      pen.fillStyle = [colors.good, colors.warn, colors.bad][Math.min(2, at(high, k))];
      const x = xOf(t[k], width);
      pen.fillRect(x, y, Math.max(1, xOf(until, width) - x + 0.5), 8);
    }
  }

  drawPasses(pen, passes, y, width) {
    pen.fillStyle = colors.warn;
    for (const [from, to] of passes) {
      const x = xOf(from, width);
      if (to >= view.from && from <= view.to) pen.fillRect(x - 1, y, Math.max(2, xOf(to, width) - x), 9);
    }
  }

  drawMarks(pen, times, y, width, color) {
    pen.fillStyle = color;
    let last = -1;
    for (const t of times) {
      const x = Math.round(xOf(t, width));
      if (x !== last && t >= view.from && t <= view.to) pen.fillRect(x - 1, y, 2, 9);
      last = x;
    }
  }

  showCursor() { this.area.showCursor(); }
}

// ------------------------------------------------------------------------------------ text and time

function element(kind, text, name) {
  const found = document.createElement(kind);
  found.textContent = text;
  if (name) found.className = name;
  return found;
}

const lists = [];

function describe(log, n) {
  const host = $('about'), several = data.logs.length > 1;
  host.append(element('h2', `${several ? `${letter(n)}: ` : ''}${log.name}`));
  const list = document.createElement('dl');
  for (const [key, value] of log.about) list.append(element('dt', key), element('dd', value));
  for (const note of log.notes) list.append(element('dt', 'note'), element('dd', note));
  for (const fault of log.faults) list.append(element('dt', 'wrong'), element('dd', fault, 'damage'));
  host.append(list);
  if (!log.texts.length) return;
  host.append(element('h2', 'Commands, passes and warnings'));
  const told = document.createElement('ul');
  told.append(...log.texts.map(([t, level, text]) => {
    const item = element('li', `${t.toFixed(3)} s  ${text}`, `l${level}`);
    item.onclick = () => goTo(t);
    return item;
  }));
  host.append(told);
  lists.push({items: [...told.children], times: log.texts.map(([t]) => t)});
}

function legend() {
  if (data.logs.length < 2) return;
  $('logs').append(...data.logs.map((log, n) => {
    const span = element('span', '', 'log');
    span.innerHTML = `<svg><line x1="0" y1="3" x2="26" y2="3" stroke="currentColor" stroke-width="2" stroke-dasharray="${DASHES[n % DASHES.length].join(' ')}"/></svg>`;
    const name = element('b', letter(n));
    name.style.color = n ? colorOf(`log ${letter(n)}`) : colors.link;
    span.append(name, log.name);
    return span;
  }));
}

function showTime() {
  $('time').textContent = `${view.t.toFixed(3)} s`;
  $('scrub').value = view.t;
  for (const plot of plots) plot.showCursor();
  for (const {items, times} of lists) {
    const now = below(times, view.t + 1e-9) - 1;
    const before = items.find((item) => item.classList.contains('now'));
    if (before === items[now]) continue;
    before?.classList.remove('now');
    items[now]?.classList.add('now');
  }
  draw();
}

let drawing = false;

function draw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => { drawing = false; drawStage(); });
}

function drawPlots() {
  for (const plot of plots) { plot.draw(); plot.showCursor(); }
}

function goTo(t) {
  view.t = Math.max(view.first, Math.min(view.last, t));
  showTime();
}

function zoomTo(from, to) {
  const least = Math.max(1e-9, 1e-6 * (view.last - view.first));
  if (to - from < least) to = from + least;
  Object.assign(view, {from: Math.max(view.first, from), to: Math.min(view.last, to)});
  drawPlots();
}

function zoomBy(factor, middle = view.t) {
  const around = Math.max(view.from, Math.min(view.to, middle));
  zoomTo(around - factor * (around - view.from), around + factor * (view.to - around));
}

// ------------------------------------------------------------------------------------------ play

let playing = false, before = 0;

function play(now) {
  if (!playing) return;
  const t = view.t + Number($('speed').value) * Math.min(0.1, (now - before) / 1000);
  before = now;
  goTo(t >= view.to ? view.from : Math.max(t, view.from));
  requestAnimationFrame(play);
}

$('play').onclick = () => {
  playing = !playing;
  $('play').textContent = playing ? 'Pause' : 'Play';
  before = performance.now();
  if (playing) requestAnimationFrame(play);
};
$('in').onclick = () => zoomBy(0.5);
$('out').onclick = () => zoomBy(2);
$('all').onclick = () => zoomTo(view.first, view.last);
$('scrub').oninput = () => goTo(Number($('scrub').value));
for (const id of ['reactions', 'trails', 'scale']) $(id).oninput = draw;
document.onkeydown = (event) => {
  if (/^(INPUT|SELECT)$/.test(event.target.tagName)) return;
  const button = {' ': 'play', '+': 'in', '-': 'out', '0': 'all'}[event.key];
  if (button) { event.preventDefault(); $(button).click(); }
  const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
  if (step) goTo(view.t + step * (view.to - view.from) / 500);
};

// ----------------------------------------------------------------------------------------- begin

function onColors() {
  readColors();
  draw();
  drawPlots();
}

// Float32 times count from the first instant of their log.
for (const log of data.logs) {
  for (const each of [...log.traces, ...log.levels, ...log.orders]) each.t = Float64Array.from(each.t, (t) => t + log.first);
}
view.first = Math.min(...data.logs.map((log) => log.first));
view.last = Math.max(...data.logs.map((log) => log.last), view.first + 1e-6);
Object.assign(view, {t: view.first, from: view.first, to: view.last});
Object.assign($('scrub'), {min: view.first, max: view.last});
$('title').textContent = document.title = data.title;
readColors();
stage.reset(motions.some((motion) => motion.spatial));
const curves = data.logs.flatMap((log, n) => log.traces.flatMap((trace) =>
  trace.curves.map((curve) => ({...curve, log: n, t: trace.t, group: trace.group}))));
const plots = [new Timeline($('plots')), ...data.panels.map((panel) =>
  new Plot($('plots'), panel, curves.filter((curve) => curve.panel === panel.key)))];
data.logs.forEach(describe);
legend();
if (data.three) startSolids(stage, bringThree).then(draw);
else stage.flat = data.flat;
matchMedia('(prefers-color-scheme: dark)').onchange = onColors;
new ResizeObserver(onColors).observe($('plots'));
new ResizeObserver(draw).observe($('stage'));
onColors();
showTime();

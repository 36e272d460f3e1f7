'use strict';
// The modes of a mechanism at rest: a table, and the chosen mode in slow motion. No library.

const $ = (id) => document.getElementById(id);
const PERIOD = 2;  // s, of every mode on the screen
const data = JSON.parse($('data').textContent, unpacked);
const stage = new Stage($('stage'), draw);
let chosen = 0, phase = 0.25, before = 0, playing = !matchMedia('(prefers-reduced-motion: reduce)').matches;

// Places of all points, three numbers each, at a part of the amplitude from -1 to 1.
function places({frames, count}, part) {
  const width = frames.length / count, at = (part + 1) / 2 * (count - 1);
  const k = Math.max(0, Math.min(count - 2, Math.floor(at)));
  const [one, other] = [k, k + 1].map((n) => frames.subarray(n * width, (n + 1) * width));
  return one.map((x, n) => x + (at - k) * (other[n] - x));
}

function picked(all, points) {
  return points.flatMap((point) => [...all.subarray(3 * point, 3 * point + 3)]);
}

function draw() {
  if (!stage.begin() || !data.modes.length) return;
  const mode = data.modes[chosen], now = places(mode, $('amplitude').value * Math.sin(2 * Math.PI * phase));
  stage.drawLinks(picked(places(mode, 0), data.links), [], colors.line);
  stage.drawLinks(picked(now, data.links), picked(now, data.pins));
}

function choose(n) {
  if (!data.modes.length) return;
  chosen = (n + data.modes.length) % data.modes.length;
  [...$('modes').rows].forEach((row, k) => row.setAttribute('aria-selected', k === chosen));
  $('modes').rows[chosen].scrollIntoView({block: 'nearest'});
  $('shown').textContent = `mode ${chosen + 1}: ${data.modes[chosen].frequency}${data.modes[chosen].falls ? '' : ' Hz'}`;
  draw();
}

function play(now) {
  if (!playing) return;
  phase += Math.min(0.1, (now - before) / 1000) / PERIOD;
  before = now;
  draw();
  requestAnimationFrame(play);
}

function begin() {
  $('play').textContent = playing ? 'Pause' : 'Play';
  before = performance.now();
  if (playing) requestAnimationFrame(play);
}

function cell(row, text, className, small) {
  const found = row.insertCell();
  found.textContent = text;
  found.className = className;
  if (small) {
    const more = document.createElement('small');
    more.textContent = small;
    found.append(more);
  }
}

$('title').textContent = document.title = data.title;
$('notes').textContent = data.notes.join('; ');
data.modes.forEach((mode, n) => {
  const row = $('modes').insertRow();
  cell(row, n + 1, 'number');
  cell(row, mode.frequency, 'number');
  cell(row, mode.damping, 'number');
  cell(row, mode.kinetic, '', mode.potential);
  row.onclick = () => choose(n);
});
$('play').onclick = () => { playing = !playing; begin(); };
$('amplitude').oninput = draw;
document.onkeydown = (event) => {
  const step = {ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1}[event.key];
  if (event.target.tagName === 'INPUT') return;
  if (step) { event.preventDefault(); choose(chosen + step); }
  if (event.key === ' ') { event.preventDefault(); $('play').click(); }
};
readColors();
stage.reset(data.spatial);
stage.box = data.box;
matchMedia('(prefers-color-scheme: dark)').onchange = () => { readColors(); draw(); };
new ResizeObserver(draw).observe($('stage'));
choose(0);
begin();

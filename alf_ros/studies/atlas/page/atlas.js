// The map of an atlas: curves of positions, the mechanism at the chosen one, and the tables.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($('data').textContent);
const {pieces, series, marks} = data;
const stage = new Stage($('stage'), draw);
let chosen = {piece: 0, n: 0};
let frame = null;

const name = (k) => series[k].unit ? `${series[k].name}, ${series[k].unit}` : series[k].name;
const colour = (circuit) => `var(--c${(circuit - 1) % 8})`;
const painted = (circuit) => getComputedStyle(document.documentElement).getPropertyValue(`--c${(circuit - 1) % 8}`).trim();
const onSheet = (item) => $('sheet').value === 'all' || item.sheet === Number($('sheet').value);
const visible = () => pieces.filter(onSheet);
const turn = 2 * Math.PI;
// Angles of the map lie from -π to π.
const wrapped = (k, x) => series[k].angle ? x - turn * Math.floor(x / turn + 0.5) : x;

function extent(k) {
  if (series[k].angle) return [-Math.PI, Math.PI];
  const found = visible().flatMap((piece) => piece.values[k]).filter(Number.isFinite).sort((a, b) => a - b);
  if (!found.length) return [0, 1];
  // what has no limit, such as an advantage, must not flatten the rest
  const cut = series[k].unbounded ? Math.floor(0.03 * found.length) : 0;
  const [low, high] = [found[cut], found[found.length - 1 - cut]];
  const room = 0.04 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - room, high + room];
}

function axes() {
  const [a, b] = [Number($('across').value), Number($('up').value)];
  const {pen, width, height} = sheet($('map'));
  const [left, right, top, low] = [58, 12, 26, 34];
  const [x, y] = [extent(a), extent(b)];
  const across = (v) => left + (v - x[0]) / (x[1] - x[0]) * (width - left - right);
  const up = (v) => height - low - (v - y[0]) / (y[1] - y[0]) * (height - top - low);
  return {a, b, pen, width, height, left, right, top, low, x, y, across, up};
}

function drawAxes(f) {
  const {pen} = f;
  pen.lineWidth = 1;
  for (const [k, range, at] of [[f.a, f.x, f.across], [f.b, f.y, f.up]]) {
    const flat = k === f.a && at === f.across;
    const step = niceStep((range[1] - range[0]) / (flat ? f.width / 90 : f.height / 55));
    for (let v = Math.ceil(range[0] / step) * step; v <= range[1]; v += step) {
      const place = at(v);
      pen.strokeStyle = colors.grid;
      pen.beginPath();
      if (flat) { pen.moveTo(place, f.top); pen.lineTo(place, f.height - f.low); } else { pen.moveTo(f.left, place); pen.lineTo(f.width - f.right, place); }
      pen.stroke();
      pen.fillStyle = colors.faint;
      pen.textAlign = flat ? 'center' : 'right';
      pen.fillText(Number(v.toPrecision(6)), flat ? place : f.left - 6, flat ? f.height - f.low + 14 : place + 4);
    }
  }
  pen.fillStyle = colors.ink;
  pen.textAlign = 'right';
  pen.fillText(name(f.a), f.width - f.right, f.height - 4);
  pen.textAlign = 'left';
  pen.fillText(name(f.b), 6, f.top - 11);  // above the map, where no curve is
}

function drawCurves(f) {
  const {pen} = f;
  pen.save();
  pen.beginPath();
  pen.rect(f.left, f.top, f.width - f.left - f.right, f.height - f.top - f.low);
  pen.clip();
  for (const piece of visible()) {
    pen.strokeStyle = painted(piece.circuit);
    pen.lineWidth = piece === pieces[chosen.piece] ? 2.6 : 1.4;
    pen.setLineDash(piece.singular ? [5, 4] : []);
    pen.beginPath();
    let before = null;
    for (let n = 0; n < piece.values[f.a].length; n++) {
      const [u, v] = [wrapped(f.a, piece.values[f.a][n]), wrapped(f.b, piece.values[f.b][n])];
      if (!Number.isFinite(u) || !Number.isFinite(v)) { before = null; continue; }
      const far = before && ((series[f.a].angle && Math.abs(u - before[0]) > 3) || (series[f.b].angle && Math.abs(v - before[1]) > 3));
      if (before && !far) pen.lineTo(f.across(u), f.up(v)); else pen.moveTo(f.across(u), f.up(v));
      before = [u, v];
    }
    pen.stroke();
  }
  pen.setLineDash([]);
  for (const mark of marks.filter(onSheet)) {
    const [u, v] = [wrapped(f.a, mark.values[f.a]), wrapped(f.b, mark.values[f.b])];
    if (!Number.isFinite(u) || !Number.isFinite(v)) continue;
    pen.strokeStyle = colors[mark.colour];
    pen.fillStyle = colors.sheet;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(f.across(u), f.up(v), mark.kind === 'node' ? 5 : 3.4, 0, turn);
    pen.fill();
    pen.stroke();
  }
  const here = pieces[chosen.piece];
  const [u, v] = [f.a, f.b].map((k) => wrapped(k, here.values[k][chosen.n]));
  if (Number.isFinite(u) && Number.isFinite(v)) {
    pen.fillStyle = colors.ink;
    pen.beginPath();
    pen.arc(f.across(u), f.up(v), 4.5, 0, turn);
    pen.fill();
  }
  pen.restore();
}

function drawStage() {
  const piece = pieces[chosen.piece];
  const pick = (places, list) => list.flatMap((n) => places.slice(3 * n, 3 * n + 3));
  if (!stage.begin()) return;
  const places = chosen.places ?? piece.places[chosen.n];
  const every = Math.max(1, Math.floor(piece.places.length / 200));
  stage.drawTrails(piece.places.filter((_, n) => n % every === 0), painted(piece.circuit));
  stage.drawLinks(pick(places, data.links), pick(places, data.pins));
}

function draw() {
  const f = axes();
  drawAxes(f);
  drawCurves(f);
  drawStage();
  const piece = pieces[chosen.piece];
  const told = series.map((each, k) => `${each.name} ${shown(each.angle ? wrapped(k, piece.values[k][chosen.n]) : piece.values[k][chosen.n])}${each.unit ? ` ${each.unit}` : ''}`);
  $('reading').textContent = `circuit ${piece.circuit}, piece ${piece.number}: ${told.join(' · ')}`;
}

function redraw() {
  if (frame === null) frame = requestAnimationFrame(() => { frame = null; draw(); });
}

function choose(event) {
  const f = axes(), box = $('map').getBoundingClientRect();
  const [px, py] = [event.clientX - box.left, event.clientY - box.top];
  let best = Infinity;
  pieces.forEach((piece, p) => {
    if (!onSheet(piece)) return;
    for (let n = 0; n < piece.places.length; n++) {
      const far = Math.hypot(f.across(wrapped(f.a, piece.values[f.a][n])) - px, f.up(wrapped(f.b, piece.values[f.b][n])) - py);
      if (far < best) { best = far; chosen = {piece: p, n}; }
    }
  });
  redraw();
}

function along(event) {
  const by = {ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1}[event.key];
  if (!by) return;
  event.preventDefault();
  const count = pieces[chosen.piece].places.length;
  chosen = {piece: chosen.piece, n: (chosen.n + by + count) % count};
  redraw();
}

function table(title, head, rows) {
  if (!rows.length) return;
  const part = document.createElement('div'), heading = document.createElement('h2');
  heading.textContent = title;
  const made = document.createElement('table');
  made.append(row(head.map((text) => ({text})), 'th'));
  for (const each of rows) {
    const line = row(each.cells, 'td');
    if (each.mark) {
      line.className = 'at';
      line.onclick = () => { chosen = {piece: each.mark.piece, n: each.mark.n, places: each.mark.places}; redraw(); };
    }
    made.append(line);
  }
  part.append(heading, made);
  $('tables').append(part);
}

function row(cells, tag) {
  const line = document.createElement('tr');
  for (const {text, own, wide} of cells) {
    const cell = document.createElement(tag);
    if (wide) cell.className = 'text';
    if (own) {
      const mark = document.createElement('i');
      mark.className = 'mark';
      mark.style.setProperty('--own', own);
      cell.append(mark);
    }
    cell.append(text);
    line.append(cell);
  }
  return line;
}

function begin() {
  document.title = $('title').textContent = data.title;
  for (const [id, first] of [['across', 0], ['up', data.up]]) {
    series.forEach((_, k) => $(id).append(new Option(name(k), k)));
    $(id).value = first;
    $(id).onchange = redraw;
  }
  $('sheet').append(new Option('all', 'all'));
  data.sheets.forEach((text, n) => $('sheet').append(new Option(text, n)));
  $('level').hidden = data.sheets.length < 2;
  $('sheet').onchange = () => { chosen = {piece: Math.max(0, pieces.findIndex(onSheet)), n: 0}; redraw(); };
  const corners = [[], []];
  for (let k = 0; k < 3; k++) {
    corners[0][k] = Math.min(...pieces.map((piece) => piece.box[0][k]));
    corners[1][k] = Math.max(...pieces.map((piece) => piece.box[1][k]));
  }
  stage.box = corners;
  stage.reset(data.spatial);
  for (const each of data.tables) table(each.title, each.head, each.rows.map((cells) => ({cells: cells.map((text) => ({text, wide: text.length > 40}))})));
  const rows = marks.map((mark) => ({mark, cells: [{text: mark.what, own: `var(--${mark.colour})`}, ...mark.cells.map((text) => ({text, wide: text.length > 40}))]}));
  table('Singular positions', data.markHead, rows.slice(0, 200));
  for (const text of data.notes) {
    const note = document.createElement('p');
    note.textContent = text;
    $('tables').append(note);
  }
  readColors();
  $('map').onpointermove = choose;
  $('map').onpointerdown = choose;
  $('map').onkeydown = along;
  addEventListener('resize', redraw);
  matchMedia('(prefers-color-scheme: dark)').onchange = () => { readColors(); redraw(); };
  draw();
}

begin();

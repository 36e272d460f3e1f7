'use strict';
// Plots over one common time. What is drawn of many values in one pixel is the lowest and highest.

const MARGIN = {left: 58, right: 12, top: 6, bottom: 16};
const LEAST = 1e-18;  // of a plot over decades
const MOST_SHOWN = 8;  // curves of a panel that are shown at first
const DASHES = [[], [6, 4], [2, 3], [9, 3, 2, 3]];
const view = {t: 0, from: 0, to: 1, first: 0, last: 1};
const palette = new Map();  // name -> number of its colour: the same in all panels

const colorOf = (name) => {
  if (!palette.has(name)) palette.set(name, palette.size % 8);
  return getComputedStyle(document.documentElement).getPropertyValue(`--c${palette.get(name)}`).trim();
};

// Number of values below t.
function below(times, t) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < t) low = middle + 1; else high = middle;
  }
  return low;
}

const at = (values, k) => typeof values === 'number' ? values : values[k];
const xOf = (t, width) => MARGIN.left + (width - MARGIN.left - MARGIN.right) * (t - view.from) / (view.to - view.from);
const timeOf = (x, width) => view.from + (view.to - view.from) * (x - MARGIN.left) / (width - MARGIN.left - MARGIN.right);

// Where along the time axis something is drawn, and the gestures there.
class Area {
  constructor(host, height) {
    this.element = document.createElement('div');
    this.element.className = 'area';
    this.element.style.height = `${height}px`;
    this.canvas = document.createElement('canvas');
    [this.cursor, this.choice] = ['cursor', 'choice'].map((name) => {
      const line = document.createElement('div');
      line.className = name;
      return line;
    });
    this.element.append(this.canvas, this.choice, this.cursor);
    host.append(this.element);
    this.element.onpointerdown = (event) => this.press(event);
    this.element.onpointermove = (event) => this.move(event);
    this.element.onpointerup = (event) => this.release(event);
    this.element.ondblclick = () => zoomTo(view.first, view.last);
    this.element.onwheel = (event) => {
      if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
      event.preventDefault();
      zoomBy(Math.exp(0.002 * (event.deltaY || event.deltaX)), this.time(event));
    };
  }

  time(event) {
    const box = this.element.getBoundingClientRect();
    const t = timeOf(event.clientX - box.left, box.width);
    return Math.max(view.from, Math.min(view.to, t));
  }

  press(event) {
    this.element.setPointerCapture(event.pointerId);
    if (event.shiftKey) this.start = this.time(event);
    this.move(event);
  }

  move(event) {
    if (!event.buttons) return;
    if (this.start === undefined) { goTo(this.time(event)); return; }
    const [x, y] = [this.start, this.time(event)].map((t) => xOf(t, this.element.clientWidth)).sort((a, b) => a - b);
    Object.assign(this.choice.style, {display: 'block', left: `${x}px`, width: `${y - x}px`});
  }

  release(event) {
    if (this.start === undefined) return;
    const [from, to] = [this.start, this.time(event)].sort((a, b) => a - b);
    this.start = undefined;
    this.choice.style.display = 'none';
    if (to > from) zoomTo(from, to);
  }

  showCursor() {
    const inside = view.t >= view.from && view.t <= view.to;
    this.cursor.style.display = inside ? 'block' : 'none';
    this.cursor.style.transform = `translateX(${xOf(view.t, this.element.clientWidth)}px)`;
  }
}

// Multiples of 1, 2 or 5 between two numbers, about `count` of them.
function ticks(low, high, count) {
  const step = niceStep((high - low) / count || 1);
  const found = [];
  for (let n = Math.ceil(low / step); n * step <= high + 1e-9 * step && found.length < 50; n++) found.push(n * step);
  return {step, found};
}

function drawTimeAxis(pen, width, height) {
  const {step, found} = ticks(view.from, view.to, Math.max(2, width / 110));
  const digits = Math.max(0, Math.min(9, Math.ceil(-Math.log10(step) - 1e-9)));
  pen.strokeStyle = colors.grid;
  pen.fillStyle = colors.faint;
  pen.lineWidth = 1;
  pen.textAlign = 'center';
  pen.font = '11px system-ui, sans-serif';
  pen.beginPath();
  found.forEach((t, n) => {
    const x = xOf(t, width);
    pen.moveTo(x, MARGIN.top);
    pen.lineTo(x, height - MARGIN.bottom);
    if (x < width - 24) pen.fillText(`${t.toFixed(digits)}${n ? '' : ' s'}`, x, height - 3);
  });
  pen.stroke();
}

// Passes through singular positions, of all logs, as thin lines behind the curves, if their times
// are known and there is room.
function drawPasses(pen, width, height) {
  const times = data.logs.flatMap((log) => log.passes.filter(([from, to]) => from === to).map(([t]) => t))
    .filter((t) => t >= view.from && t <= view.to);
  if (times.length > width / 8) return;
  pen.strokeStyle = colors.warn;
  pen.lineWidth = 1;
  pen.globalAlpha = 0.5;
  pen.setLineDash([2, 3]);
  pen.beginPath();
  for (const t of times) {
    pen.moveTo(xOf(t, width), MARGIN.top);
    pen.lineTo(xOf(t, width), height - MARGIN.bottom);
  }
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

// x, lowest and highest of what is in view: one by one, or one for each pixel column.
function columns(curve, width) {
  const {t, low, high, steps} = curve;
  const [begin, end] = [Math.max(0, below(t, view.from) - 1), Math.min(t.length, below(t, view.to) + 1)];
  const found = {x: [], low: [], high: []};
  const put = (x, l, h) => { found.x.push(x); found.low.push(l); found.high.push(h); };
  if (end - begin <= 1.5 * width) {
    for (let k = begin; k < end; k++) {
      const x = xOf(t[k], width);
      if (steps && found.x.length) put(x, found.low.at(-1), found.high.at(-1));
      put(x, at(low, k), at(high, k));
    }
    if (steps && found.x.length) put(xOf(view.to, width), found.low.at(-1), found.high.at(-1));
    return found;
  }
  let column = NaN;
  for (let k = begin; k < end; k++) {
    const x = Math.round(xOf(t[k], width)), [l, h] = [at(low, k), at(high, k)];
    if (x !== column) { put(x, l, h); column = x; continue; }
    const last = found.x.length - 1;
    // What is no number loses against what is one.
    if (!(found.low[last] <= l)) found.low[last] = Number.isNaN(l) ? found.low[last] : l;
    if (!(found.high[last] >= h)) found.high[last] = Number.isNaN(h) ? found.high[last] : h;
  }
  return found;
}

class Plot {
  // `curves`: {name, part, log (number), t, low, high, group}
  constructor(host, panel, curves) {
    Object.assign(this, {panel, curves});
    const section = document.createElement('section');
    section.className = 'plot';
    section.dataset.panel = panel.key;
    section.innerHTML = '<header><h2></h2><span class="chips"></span></header>';
    const title = section.querySelector('h2'), unit = document.createElement('small');
    title.textContent = `${panel.title} `;
    unit.textContent = panel.unit;
    title.append(unit);
    this.chips = section.querySelector('.chips');
    this.parts = [...new Set(curves.map((curve) => curve.part))];
    this.part = this.parts[0];
    if (this.parts.length > 1) {
      const select = document.createElement('select');
      select.setAttribute('aria-label', 'component');
      select.append(...this.parts.map((part) => new Option(part, part)));
      select.onchange = () => { this.part = select.value; this.draw(); this.showCursor(); };
      title.after(select);
    }
    host.append(section);
    this.area = new Area(section, 132);
    this.names = [...new Set(curves.map((curve) => curve.name))];
    const largest = (name) => Math.max(...curves.filter((curve) => curve.name === name).map((curve) => curve.largest));
    const ranked = this.names.length > MOST_SHOWN ? [...this.names].sort((a, b) => largest(b) - largest(a)) : this.names;
    this.shown = new Set(ranked.slice(0, MOST_SHOWN));
    this.values = new Map();
    this.chips.append(...this.names.map((name) => this.chip(name)));
  }

  chip(name) {
    const chip = document.createElement('button'), value = document.createElement('b');
    chip.className = 'chip';
    chip.append(document.createElement('i'), name, value);
    chip.style.setProperty('--own', `var(--c${(colorOf(name), palette.get(name))})`);
    chip.setAttribute('aria-pressed', this.shown.has(name));
    chip.onclick = () => {
      if (!this.shown.delete(name)) this.shown.add(name);
      chip.setAttribute('aria-pressed', this.shown.has(name));
      this.draw();
      this.showCursor();
    };
    this.values.set(name, value);
    return chip;
  }

  get visible() {
    return this.curves.filter((curve) => this.shown.has(curve.name) && curve.part === this.part);
  }

  draw() {
    const {pen, width, height} = sheet(this.area.canvas);
    if (!width) return;
    drawTimeAxis(pen, width, height);
    drawPasses(pen, width, height);
    const drawn = this.visible.map((curve) => ({curve, found: columns({...curve, steps: this.panel.steps}, width)}));
    const scale = this.scale(drawn);
    if (!scale) return;
    const y = (value) => height - MARGIN.bottom - (height - MARGIN.top - MARGIN.bottom) *
      ((this.panel.log ? Math.log10(Math.max(value, scale.floor)) : value) - scale.low) / (scale.high - scale.low);
    this.drawValueAxis(pen, width, scale, y);
    pen.save();
    pen.beginPath();
    pen.rect(MARGIN.left, 0, width - MARGIN.left - MARGIN.right, height - MARGIN.bottom + 1);
    pen.clip();
    for (const {curve, found} of drawn) this.drawCurve(pen, curve, found, y);
    pen.restore();
  }

  scale(drawn) {
    let [low, high] = [Infinity, -Infinity];
    for (const {found} of drawn) {
      found.x.forEach((_, k) => {
        for (const value of [found.low[k], found.high[k]]) {
          if (!Number.isFinite(value) || (this.panel.log && value <= 0)) continue;
          if (value < low) low = value;
          if (value > high) high = value;
        }
      });
    }
    if (low > high) return this.panel.log && drawn.length ? {low: -18, high: -15, floor: LEAST} : null;
    if (this.panel.log) {
      const ends = [Math.floor(Math.log10(Math.max(low, LEAST))), Math.ceil(Math.log10(Math.max(high, LEAST)))];
      if (ends[1] <= ends[0]) ends[1] = ends[0] + 1;
      return {low: ends[0], high: ends[1], floor: 10 ** ends[0]};
    }
    const room = low === high ? Math.abs(low) || 2 : 1.12 * (high - low);
    const middle = (low + high) / 2;
    return {low: middle - room / 2, high: middle + room / 2};
  }

  drawValueAxis(pen, width, scale, y) {
    const {step, found} = this.panel.log
      ? ticks(scale.low, scale.high, Math.min(4, scale.high - scale.low))
      : ticks(scale.low, scale.high, 4);
    // Ticks that differ in late digits are told from the middle one: 13.6034, +2e-5, +4e-5.
    const middle = found.length >> 1;
    const base = !this.panel.log && step < 1e-5 * Math.max(Math.abs(scale.low), Math.abs(scale.high)) ? found[middle] : 0;
    pen.strokeStyle = colors.grid;
    pen.fillStyle = colors.faint;
    pen.textAlign = 'right';
    pen.beginPath();
    found.forEach((value, n) => {
      if (this.panel.log && Math.abs(value - Math.round(value)) > 1e-9) return;
      const place = y(this.panel.log ? 10 ** value : value);
      pen.moveTo(MARGIN.left, place);
      pen.lineTo(width - MARGIN.right, place);
      const offset = `${n > middle ? '+' : '−'}${shortly(Math.abs(n - middle) * step, step)}`;
      const told = base ? (n === middle ? base.toPrecision(6) : offset) : shortly(value, step);
      pen.fillText(this.panel.log ? `1e${Math.round(value)}` : told, MARGIN.left - 5, place + 4);
    });
    pen.stroke();
  }

  drawCurve(pen, curve, {x, low, high}, y) {
    pen.strokeStyle = pen.fillStyle = colorOf(curve.name);
    pen.lineWidth = 1.4;
    pen.lineJoin = 'round';
    pen.setLineDash(DASHES[curve.log % DASHES.length]);
    const band = low.some((value, k) => value < high[k]);
    for (let begin = 0; begin < x.length; begin++) {
      if (Number.isNaN(low[begin])) continue;
      let end = begin;
      while (end < x.length && !Number.isNaN(low[end])) end++;
      if (band) {
        pen.beginPath();
        for (let k = begin; k < end; k++) pen.lineTo(x[k], y(high[k]));
        for (let k = end - 1; k >= begin; k--) pen.lineTo(x[k], y(low[k]));
        pen.globalAlpha = 0.45;
        pen.fill();
        pen.globalAlpha = 1;
        pen.lineWidth = 1;
      }
      for (const values of band ? [high, low] : [high]) {
        pen.beginPath();
        for (let k = begin; k < end; k++) pen.lineTo(x[k], y(values[k]));
        if (end - begin === 1) pen.lineTo(x[begin] + 1.5, y(values[begin]));
        pen.stroke();
      }
      begin = end;
    }
    pen.setLineDash([]);
  }

  showCursor() {
    this.area.showCursor();
    for (const name of this.shown) {
      const curves = this.curves.filter((curve) => curve.name === name && curve.part === this.part);
      this.values.get(name).textContent = curves.map((curve) => {
        const k = below(curve.t, view.t + 1e-6 * (view.to - view.from)) - 1;
        if (k < 0) return '–';
        const [low, high] = [at(curve.low, k), at(curve.high, k)];
        return low < high && shown(low) !== shown(high) ? `${shown(low)} … ${shown(high)}` : shown(high);
      }).join(' | ');
    }
  }
}

function shortly(value, step) {
  const size = Math.max(Math.abs(value), step);
  if (size >= 1e5 || size < 1e-3) return Math.abs(value) < 1e-9 * step ? '0' : Number(value.toPrecision(3)).toExponential();
  return value.toFixed(Math.max(0, Math.min(8, Math.ceil(-Math.log10(step) - 1e-9))));
}

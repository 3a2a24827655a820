'use strict';
// Curves that zoom: wheel about the pointer, drag a span, shift-drag moves, double click resets. Panels share time.
(() => {
  const block = document.getElementById('curves');
  if (!block) return;
  const data = JSON.parse(block.textContent);
  const arrays = data.arrays.map(text => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
    return new Float64Array(bytes.buffer);
  });
  const LEFT = 74, RIGHT = 12, TOP = 22, BOTTOM = 34, SVG = 'http://www.w3.org/2000/svg';

  const element = (parent, name, attributes, text) => {
    const made = document.createElementNS(SVG, name);
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    if (text !== undefined) made.textContent = text;
    parent.appendChild(made);
    return made;
  };

  // first index whose value is not below x
  const place = (values, x) => {
    let a = 0, b = values.length;
    while (a < b) { const m = (a + b) >> 1; if (values[m] < x) a = m + 1; else b = m; }
    return a;
  };

  const number = (value, digits) => {
    if (!Number.isFinite(value)) return '–';
    const text = value.toPrecision(digits);
    return text.includes('e') || !text.includes('.') ? text : text.replace(/\.?0+$/, '');
  };

  const ticks = (low, high, count) => {
    const raw = (high - low) / count, size = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map(k => k * size).find(s => s >= raw * (1 - 1e-9));
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step && found.length < 2 * count + 2; k++) {
      found.push(k * step);
    }
    const largest = Math.max(...found.map(Math.abs), step);
    const digits = Math.min(Math.floor(Math.log10(Math.max(largest / step, 1)) + 1e-9) + 2, 15);
    return found.map(v => [v, data.lg ? number(10 ** v, 2) : number(v, digits)]);
  };

  class Group {
    constructor(low, high) { this.whole = [low, high]; this.panels = []; this.reset(); }
    reset() { this.low = this.whole[0]; this.high = this.whole[1]; }
    span(low, high) {
      const least = 1e-12 * Math.max(Math.abs(low), Math.abs(high), this.whole[1] - this.whole[0]);
      if (!(high - low > least)) return;
      if (high - low >= this.whole[1] - this.whole[0]) return this.show(...this.whole);
      const shift = Math.max(this.whole[0] - low, 0) - Math.max(high - this.whole[1], 0);
      this.show(low + shift, high + shift);
    }
    show(low, high) { this.low = low; this.high = high; for (const panel of this.panels) panel.draw(); }
  }

  class Panel {
    constructor(figure, given, group) {
      this.figure = figure; this.group = group; this.name = given.name; this.unit = given.unit;
      this.curves = given.curves.map(c => ({...c, time: arrays[c.time], values: arrays[c.values], shown: true}));
      this.height = given.height || 250;
      this.svg = element(figure, 'svg', {height: this.height, role: 'img', 'aria-label': given.label});
      this.key = figure.appendChild(document.createElement('div'));
      this.key.className = 'key';
      for (const curve of this.curves) this.entry(curve);
      this.listen();
      group.panels.push(this);
      this.draw();
    }

    entry(curve) {
      const button = this.key.appendChild(document.createElement('button'));
      const line = button.appendChild(document.createElement('i'));
      line.style.borderTopColor = curve.colour;
      line.style.borderTopStyle = curve.dash ? 'dashed' : 'solid';
      button.appendChild(document.createElement('span')).textContent = curve.label;
      curve.output = button.appendChild(document.createElement('output'));
      button.addEventListener('click', () => {
        curve.shown = !curve.shown;
        button.classList.toggle('off', !curve.shown);
        this.draw();
      });
    }

    across(t) { return LEFT + (t - this.group.low) / (this.group.high - this.group.low) * this.wide; }
    time(x) { return this.group.low + (x - LEFT) / this.wide * (this.group.high - this.group.low); }

    // points that can be seen: all of them, or least and largest of each column of pixels
    visible(curve) {
      const {time, values} = curve, found = [];
      const a = Math.max(place(time, this.group.low) - 1, 0);
      const b = Math.min(place(time, this.group.high) + 2, time.length);
      if (b - a <= 3 * this.wide) {
        for (let k = a; k < b; k++) found.push([time[k], values[k]]);
        return found;
      }
      for (let k = a, column = NaN, low, high; k <= b; k++) {
        const next = k < b ? Math.floor(this.across(time[k])) : NaN;
        if (next !== column || k === b) {
          if (low !== undefined) {
            found.push(...(low < high ? [low, high] : [high, low]).map(j => [time[j], values[j]]));
          }
          column = next; low = high = k < b ? k : undefined;
        } else if (!Number.isFinite(values[k])) {
          found.push([time[k], NaN]);
        } else {
          if (!(values[k] >= values[low])) low = k;
          if (!(values[k] <= values[high])) high = k;
        }
      }
      return found;
    }

    draw() {
      const svg = this.svg, group = this.group, width = Math.max(this.figure.clientWidth, 240);
      svg.setAttribute('viewBox', `0 0 ${width} ${this.height}`);
      svg.replaceChildren();
      this.wide = width - LEFT - RIGHT;
      const base = this.height - BOTTOM;
      const lines = this.curves.map(c => c.shown ? this.visible(c) : []);
      let bottom = Infinity, top = -Infinity;
      for (const line of lines) {
        for (const [t, v] of line) {
          if (Number.isFinite(v) && t >= group.low && t <= group.high) {
            bottom = Math.min(bottom, v); top = Math.max(top, v);
          }
        }
      }
      if (!(bottom <= top)) { bottom = 0; top = 1; }
      const margin = 0.06 * (top - bottom) || 0.06 * Math.abs(top) || 1;
      bottom -= margin; top += margin;
      const down = v => base - (v - bottom) / (top - bottom) * (base - TOP);
      for (const [value, text] of ticks(group.low, group.high, Math.max(2, Math.min(8, this.wide / 90)))) {
        const x = this.across(value);
        element(svg, 'line', {class: 'grid', x1: x, x2: x, y1: TOP, y2: base});
        element(svg, 'text', {x, y: base + 14, 'text-anchor': 'middle'}, text);
      }
      for (const [value, text] of ticks(bottom, top, 5)) {
        const y = down(value);
        element(svg, 'line', {class: 'grid', x1: LEFT, x2: width - RIGHT, y1: y, y2: y});
        element(svg, 'text', {x: LEFT - 6, y: y + 4, 'text-anchor': 'end'}, text);
      }
      element(svg, 'text', {x: width - RIGHT, y: this.height - 4, 'text-anchor': 'end'}, data.across || `time, ${data.unit}`);
      element(svg, 'text', {class: 'name', x: 4, y: 11}, [this.name, this.unit].filter(Boolean).join(', '));
      const clip = `clip${this.group.panels.indexOf(this)}`;
      const path = element(element(svg, 'defs', {}), 'clipPath', {id: clip});
      element(path, 'rect', {x: LEFT, y: TOP - 4, width: this.wide, height: base - TOP + 8});
      lines.forEach((line, k) => {
        let d = '', pen = false;
        for (const [t, v] of line) {
          if (!Number.isFinite(v)) { pen = false; continue; }
          d += `${pen ? 'L' : 'M'}${this.across(t).toFixed(2)} ${down(v).toFixed(2)}`;
          pen = true;
        }
        const shape = {d, fill: 'none', stroke: this.curves[k].colour, 'stroke-width': 1.6, 'clip-path': `url(#${clip})`};
        if (this.curves[k].dash) shape['stroke-dasharray'] = '6 4';
        if (d && !this.curves[k].dots) element(svg, 'path', shape);
        for (const [t, v] of this.curves[k].marks || this.curves[k].dots ? line : []) {
          if (!(t >= group.low && t <= group.high)) continue;
          const size = this.curves[k].dots || 3;
          element(svg, 'circle', {cx: this.across(t), cy: down(v), r: size, fill: size > 3 ? 'none' : this.curves[k].colour, stroke: this.curves[k].colour, 'stroke-width': 1.6});
        }
      });
      this.mark = element(svg, 'line', {class: 'mark', y1: TOP, y2: base, visibility: 'hidden'});
      this.box = element(svg, 'rect', {class: 'box', y: TOP, height: base - TOP, visibility: 'hidden'});
      this.figure.dataset.low = group.low;
      this.figure.dataset.high = group.high;
    }

    // the values of all curves at an instant
    read(t) {
      const x = this.across(t), inside = t >= this.group.low && t <= this.group.high;
      this.mark.setAttribute('visibility', inside ? 'visible' : 'hidden');
      this.mark.setAttribute('x1', x); this.mark.setAttribute('x2', x);
      for (const {time, values, output} of this.curves) {
        const k = place(time, t);
        if (!inside || k === 0 && time[0] > t || k >= time.length) { output.textContent = ''; continue; }
        const j = Math.max(k - 1, 0), h = time[k] - time[j];
        const value = h > 0 ? values[j] + (values[k] - values[j]) * (t - time[j]) / h : values[k];
        output.textContent = data.lg ? '' : number(value, 6);
      }
    }

    listen() {
      const svg = this.svg, group = this.group;
      const at = event => (event.clientX - svg.getBoundingClientRect().left);
      let from = null, moved = null;
      svg.addEventListener('wheel', event => {
        event.preventDefault();
        const t = this.time(at(event)), factor = Math.exp(0.0016 * Math.max(-240, Math.min(240, event.deltaY)));
        group.span(t - (t - group.low) * factor, t + (group.high - t) * factor);
      }, {passive: false});
      svg.addEventListener('pointerdown', event => {
        if (event.button) return;
        svg.setPointerCapture(event.pointerId);
        from = at(event);
        moved = event.shiftKey ? [group.low, group.high] : null;
      });
      svg.addEventListener('pointermove', event => {
        const x = at(event);
        if (from !== null && moved) {
          const shift = (from - x) / this.wide * (moved[1] - moved[0]);
          group.span(moved[0] + shift, moved[1] + shift);
        } else if (from !== null) {
          this.box.setAttribute('x', Math.min(from, x));
          this.box.setAttribute('width', Math.abs(x - from));
          this.box.setAttribute('visibility', 'visible');
        }
        for (const panel of group.panels) panel.read(this.time(x));
      });
      svg.addEventListener('pointerup', event => {
        const x = at(event), start = from;
        this.box.setAttribute('visibility', 'hidden');
        from = null;
        if (start !== null && !moved && Math.abs(x - start) > 4) {
          const ends = [this.time(start), this.time(x)].sort((a, b) => a - b);
          group.span(Math.max(ends[0], group.low), Math.min(ends[1], group.high));
        }
      });
      svg.addEventListener('pointercancel', () => { from = null; this.box.setAttribute('visibility', 'hidden'); });
      svg.addEventListener('pointerleave', () => { for (const panel of group.panels) panel.read(NaN); });
      svg.addEventListener('dblclick', () => group.show(...group.whole));
    }
  }

  const group = new Group(...data.span);
  for (const figure of document.querySelectorAll('figure.plot')) {
    new Panel(figure, data.panels[Number(figure.dataset.panel)], group);
  }
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if (window.innerWidth !== width) { width = window.innerWidth; group.show(group.low, group.high); }
  });
})();

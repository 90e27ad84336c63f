"use strict";
// The slider over time: outline, force and residuals at one instant. No library, no network; every shape is an
// SVG element with a class, coloured by the page's style sheet.
(() => {
  const data = JSON.parse(document.getElementById("instrument-data").textContent);
  const root = document.getElementById("instrument");
  const slider = document.getElementById("instant");
  const said = document.getElementById("instant-said");
  const play = document.getElementById("instant-play");
  const picture = document.getElementById("instant-picture");
  const SVG = root.querySelector("svg").namespaceURI;
  const times = data.outlines.length ? data.outlines.map((frame) => frame.time) : data.force.time;
  if (!times.length) return;

  const finite = (values) => values.filter((value) => value !== null);
  const reach = (lists) => {
    let low = Infinity, high = -Infinity;
    for (const list of lists) for (const value of finite(list)) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    return low < high ? [low, high] : [low - 1, low + 1];
  };
  const nearest = (list, value) => {
    let best = 0;
    list.forEach((x, i) => { if (Math.abs(x - value) < Math.abs(list[best] - value)) best = i; });
    return best;
  };
  const ticks = ([low, high], most) => {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12); k += 1) {
      found.push(Number((k * step).toPrecision(6)));
    }
    return found;
  };

  // A panel: axes with ticks, and what is drawn in it by name.
  class Panel {
    constructor(id, x, y, labels, margin = 0.04) {
      this.node = document.getElementById(id);
      this.box = [46, 8, 404, 222];
      const wide = ([a, b]) => [a - margin * (b - a), b + margin * (b - a)];
      [this.x, this.y] = [wide(x), wide(y)];
      this.marks = {};
      const [left, top, right, bottom] = this.box;
      this.add("frame", "rect", { x: left, y: top, width: right - left, height: bottom - top });
      for (const value of ticks(this.x, 6)) {
        this.add("tick", "line", { x1: this.px(value), x2: this.px(value), y1: bottom, y2: bottom - 4 });
        this.text(value, this.px(value), bottom + 13, "middle");
      }
      for (const value of ticks(this.y, 5)) {
        this.add("tick", "line", { x1: left, x2: left + 4, y1: this.py(value), y2: this.py(value) });
        this.text(value, left - 4, this.py(value) + 3.5, "end");
      }
      this.text(labels[0], (left + right) / 2, bottom + 29, "middle");
      const side = this.text(labels[1], 11, (top + bottom) / 2, "middle");
      side.setAttribute("transform", `rotate(-90 11 ${(top + bottom) / 2})`);
    }
    px(value) { return this.box[0] + (value - this.x[0]) / (this.x[1] - this.x[0]) * (this.box[2] - this.box[0]); }
    py(value) { return this.box[3] - (value - this.y[0]) / (this.y[1] - this.y[0]) * (this.box[3] - this.box[1]); }
    add(kind, tag, attributes) {
      const made = document.createElementNS(SVG, tag);
      made.setAttribute("class", kind);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      this.node.append(made);
      return made;
    }
    text(words, x, y, anchor) {
      const made = this.add("label", "text", { x, y, "text-anchor": anchor });
      made.textContent = typeof words === "number" ? String(words).replace("-", "−") : words;
      return made;
    }
    path(xs, ys) {
      let pen = "M", text = "";
      xs.forEach((x, i) => {
        if (x === null || ys[i] === null) { pen = "M"; return; }
        text += `${pen}${this.px(x).toFixed(2)} ${this.py(ys[i]).toFixed(2)}`;
        pen = "L";
      });
      return text;
    }
    // A line or points that may change; `name` is also its class.
    line(name, xs, ys) {
      this.marks[name] ??= this.add(name, "path", {});
      this.marks[name].setAttribute("d", this.path(xs, ys));
    }
    dots(name, xs, ys) {
      this.marks[name] ??= this.add(name, "g", {});
      this.marks[name].replaceChildren(...xs.flatMap((x, i) => {
        if (x === null || ys[i] === null) return [];
        const dot = document.createElementNS(SVG, "circle");
        for (const [key, value] of [["cx", this.px(x)], ["cy", this.py(ys[i])], ["r", 2]]) {
          dot.setAttribute(key, value.toFixed(2));
        }
        return [dot];
      }));
    }
  }

  root.hidden = false;
  const { force, outlines, simulated } = data;
  const gap = force.model.map((value, i) => value === null ? null : value - force.measured[i]);
  const band = force.sigma.map((value) => 2 * value);
  const F = new Panel("instant-force", reach([force.time]), reach([force.measured, force.model]),
    ["Time (ms)", "Force (N)"]);
  F.line("measured", force.time, force.measured);
  F.line("model", force.time, force.model);
  const R = new Panel("instant-gap", reach([force.time]), reach([gap, band, band.map((v) => -v)]),
    ["Time (ms)", "Simulated − measured force (N)"]);
  R.line("band", [...force.time, ...[...force.time].reverse()], [...band, ...[...band].reverse().map((v) => -v)]);
  R.line("model", force.time, gap);
  let O = null, Q = null;
  if (outlines.length) {
    const heights = reach([...outlines.map((f) => f.y), ...simulated.y]);
    O = new Panel("instant-outline", reach([...outlines.map((f) => f.Z), ...simulated.r]), heights,
      ["Radius (mm)", "Height (mm)"]);
    Q = new Panel("instant-residual", reach([...outlines.map((f) => f.residual), [0]]), heights,
      ["Simulated − measured radius (µm)", "Height (mm)"]);
    Q.line("zero", [0, 0], heights);
  } else {
    for (const id of ["instant-outline", "instant-residual"]) document.getElementById(id).parentNode.hidden = true;
  }

  const show = () => {
    const k = Number(slider.value), time = times[k];
    for (const panel of [F, R]) panel.line("cursor", [time, time], panel.y);
    const i = nearest(force.time, time);
    F.dots("now", [force.time[i], force.time[i]], [force.measured[i], force.model[i]]);
    const words = [`t = ${time.toFixed(3)} ms`];
    if (force.model[i] !== null) {
      words.push(`force: measured ${force.measured[i].toFixed(2)} N, simulated ${force.model[i].toFixed(2)} N`);
    }
    if (O) {
      const frame = outlines[k], j = nearest(simulated.time, time);
      O.line("model", simulated.r[j], simulated.y[j]);
      O.dots("measured", frame.Z, frame.y);
      Q.dots("model", frame.residual, frame.y);
      const known = finite(frame.residual);
      if (known.length) {
        const rms = Math.sqrt(known.reduce((sum, v) => sum + v * v, 0) / known.length);
        words.push(`outline: ${rms.toFixed(1)} µm rms`);
      }
    }
    if (picture && data.pictures.jpeg.length) {
      const p = nearest(data.pictures.time, time);
      picture.src = `data:image/jpeg;base64,${data.pictures.jpeg[p]}`;
      picture.alt = `Camera 0 at ${data.pictures.time[p].toFixed(3)} ms`;
    }
    const text = words.join("; ").replaceAll("-", "−");
    said.textContent = text;
    slider.setAttribute("aria-valuetext", text);
  };

  let timer = null;
  const stop = () => { clearInterval(timer); timer = null; play.textContent = "Play"; };
  play.addEventListener("click", () => {
    if (timer !== null) { stop(); return; }
    if (Number(slider.value) >= times.length - 1) slider.value = 0;
    play.textContent = "Stop";
    timer = setInterval(() => {
      slider.value = Number(slider.value) + 1;
      show();
      if (Number(slider.value) >= times.length - 1) stop();
    }, 60);
  });
  slider.max = times.length - 1;
  slider.value = Math.floor(times.length / 2);
  slider.addEventListener("input", show);
  show();
})();

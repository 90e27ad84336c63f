"use strict";

const byId = (id) => document.getElementById(id);
const canvas = byId("canvas");
const pen = canvas.getContext("2d");
const COLOURS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7"];
const NEAR = 8; // px on the screen within which a corner is taken hold of
let state = null;
let drawn = {}; // key -> list of {corners, frame}
let kind = 0;
let which = 0;
let frame = 0;
let cross = { x: 0, y: 0 };
let held = -1;
const picture = new Image();

const wanted = () => state.wanted[kind];
const shapes = () => (drawn[wanted().key] ??= []);
const scale = () => {
  const zoom = Number(byId("zoom").value);
  if (zoom) return zoom;
  const room = Math.max(200, byId("view").clientWidth - 4);
  const high = Math.max(200, window.innerHeight * 0.82);
  return Math.min(room / state.columns, high / state.rows);
};

function current(make) {
  const list = shapes();
  if (make && which >= list.length) list.push({ corners: [], frame: home() });
  return list[which];
}

function home() {
  return wanted().framed ? frame : wanted().home;
}

function say(lines, good) {
  const box = byId("said");
  box.textContent = lines.join("\n");
  box.className = good ? "good" : "bad";
}

function show() {
  const s = scale();
  canvas.width = Math.round(state.columns * s);
  canvas.height = Math.round(state.rows * s);
  pen.imageSmoothingEnabled = s < 1;
  if (picture.complete && picture.naturalWidth) pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
  const at = ([x, y]) => [(x + 0.5) * s, (y + 0.5) * s]; // whole numbers are pixel centres
  state.wanted.forEach((one, k) => {
    (drawn[one.key] ?? []).forEach((shape, number) => {
      const here = shape.frame === frame;
      const active = k === kind && number === which;
      pen.strokeStyle = pen.fillStyle = COLOURS[k % COLOURS.length];
      pen.globalAlpha = here ? 1 : 0.35;
      pen.lineWidth = active ? 2.5 : 1.5;
      pen.setLineDash(here ? [] : [6, 4]);
      pen.beginPath();
      shape.corners.forEach((corner, i) => (i ? pen.lineTo(...at(corner)) : pen.moveTo(...at(corner))));
      if (shape.corners.length > 2) pen.closePath();
      pen.stroke();
      shape.corners.forEach((corner) => {
        const [x, y] = at(corner);
        const size = one.point ? 7 : active ? 4 : 2.5;
        pen.fillRect(x - size, y - 1, 2 * size, 2);
        pen.fillRect(x - 1, y - size, 2, 2 * size);
      });
    });
  });
  pen.globalAlpha = 1;
  pen.setLineDash([]);
  if (document.activeElement === canvas) {
    const [x, y] = at([cross.x, cross.y]);
    pen.strokeStyle = "#e69f00";
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(x - 12, y);
    pen.lineTo(x + 12, y);
    pen.moveTo(x, y - 12);
    pen.lineTo(x, y + 12);
    pen.stroke();
  }
  byId("place").textContent = `x ${cross.x}, y ${cross.y} px; frame ${frame} of ${state.frames}`;
}

function list() {
  const shape = current(false);
  byId("corners").value = shape ? shape.corners.map((c) => c.join(", ")).join("\n") : "";
  byId("another").hidden = !wanted().many;
  show();
}

function add(x, y) {
  const one = wanted();
  if (!one.framed && frame !== one.home) {
    say([`${one.key} belongs into frame ${one.home}: choose that frame`], false);
    return;
  }
  const shape = current(true);
  if (shape.frame !== frame && shape.corners.length) {
    say([`${one.key} is drawn in frame ${shape.frame}: go there, or clear it first`], false);
    return;
  }
  shape.frame = home();
  if (one.point) shape.corners = [];
  shape.corners.push([x, y]);
  list();
}

function place(event) {
  const box = canvas.getBoundingClientRect();
  const s = scale();
  const bound = (value, most) => Math.min(Math.max(Math.round(value), 0), most - 1);
  return {
    x: bound((event.clientX - box.left - 1) / s - 0.5, state.columns),
    y: bound((event.clientY - box.top - 1) / s - 0.5, state.rows),
  };
}

function goTo(number) {
  frame = Math.min(Math.max(number, 0), state.frames - 1);
  byId("frame").value = String(frame);
  byId("frame-shown").textContent = String(frame);
  picture.src = `frames/${frame}.png`;
  show();
}

function content() {
  const sent = {};
  for (const one of state.wanted) {
    const full = (drawn[one.key] ?? []).filter((shape) => shape.corners.length);
    if (full.length) sent[one.key] = full;
  }
  return sent;
}

async function ask(address, body) {
  try {
    const answer = await fetch(address, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    return await answer.json();
  } catch {
    return { problems: ["the program that serves this page has ended"] };
  }
}

canvas.addEventListener("pointerdown", (event) => {
  canvas.focus();
  cross = place(event);
  const shape = current(false);
  const near = NEAR / scale();
  held = shape && shape.frame === frame
    ? shape.corners.findIndex(([x, y]) => Math.hypot(x - cross.x, y - cross.y) <= near)
    : -1;
  if (held < 0) add(cross.x, cross.y);
  else canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener("pointermove", (event) => {
  if (held < 0) return;
  cross = place(event);
  current(true).corners[held] = [cross.x, cross.y];
  list();
});
canvas.addEventListener("pointerup", () => (held = -1));
canvas.addEventListener("focus", show);
canvas.addEventListener("blur", show);
canvas.addEventListener("keydown", (event) => {
  const step = event.shiftKey ? 10 : 1;
  const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
  if (moves[event.key]) {
    cross.x = Math.min(Math.max(cross.x + moves[event.key][0], 0), state.columns - 1);
    cross.y = Math.min(Math.max(cross.y + moves[event.key][1], 0), state.rows - 1);
    show();
  } else if (event.key === "Enter") add(cross.x, cross.y);
  else if (event.key === "Backspace") {
    current(false)?.corners.pop();
    list();
  } else if (event.key === "PageUp") goTo(frame - 1);
  else if (event.key === "PageDown") goTo(frame + 1);
  else return;
  event.preventDefault();
});
byId("frame").addEventListener("input", (event) => goTo(Number(event.target.value)));
byId("zoom").addEventListener("change", show);
window.addEventListener("resize", () => state && show());
picture.addEventListener("load", show);
picture.addEventListener("error", () => say([`frame ${frame} cannot be read`], false));
byId("corners").addEventListener("change", (event) => {
  const rows = event.target.value.split("\n").filter((row) => row.trim());
  const corners = rows.map((row) => row.split(/[,;\s]+/).filter(Boolean).map(Number));
  if (corners.some((c) => c.length !== 2 || c.some((v) => !Number.isFinite(v)))) {
    say(["write one corner a line, as 12, 34"], false);
    return;
  }
  const shape = current(true);
  if (!shape.corners.length) shape.frame = home();
  shape.corners = corners;
  show();
});
byId("another").addEventListener("click", () => {
  which = shapes().length;
  list();
  canvas.focus();
});
byId("clear").addEventListener("click", () => {
  shapes().splice(which, 1);
  which = Math.max(0, Math.min(which, shapes().length - 1));
  list();
});
byId("check").addEventListener("click", async () => {
  const { problems } = await ask("check", content());
  say(problems.length ? problems : ["all of this can be saved"], !problems.length);
});
byId("save").addEventListener("click", async () => {
  const { problems, saved } = await ask("save", content());
  say(problems.length ? problems : [`saved into ${state.file}: ${saved.join(", ")}`], !problems.length);
});
byId("close").addEventListener("click", async () => {
  await ask("close", {});
  say(["the page has ended; close this window"], true);
});

async function begin() {
  state = await (await fetch("state.json")).json();
  drawn = state.drawn;
  byId("name").textContent = state.name;
  byId("file").textContent = state.file;
  byId("frame").max = String(state.frames - 1);
  state.wanted.forEach((one, k) => {
    const label = document.createElement("label");
    const button = document.createElement("input");
    button.type = "radio";
    button.name = "kind";
    button.checked = k === 0;
    button.addEventListener("change", () => {
      kind = k;
      which = 0;
      if (current(false)) goTo(current(false).frame);
      else if (!one.framed) goTo(one.home);
      list();
    });
    label.append(button, ` ${one.title}`);
    byId("kinds").append(label);
  });
  cross = { x: Math.floor(state.columns / 2), y: Math.floor(state.rows / 2) };
  goTo(current(false)?.frame ?? home());
  list();
}

begin();

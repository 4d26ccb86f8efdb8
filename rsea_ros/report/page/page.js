"use strict";
/* Draws the figures of the page. An overlay holds all samples and is drawn anew from them on every zoom. */

const CONFIG = { responsive: true, displaylogo: false, displayModeBar: false };
const MOST_POINTS = 3000;
const LONGEST_CELL = 36; /* characters: a longer text of a card is prose, below the title of its column */
const PRINTED = 900; /* px: width of a picture whose names have no room on the screen */

async function gunzipped(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
}

/* What report/figures/overlay.py has packed: low bytes, then high bytes, of steps about a line. */
async function unpacked({ first, slope, step, data }) {
  const planes = new Uint8Array(await (await gunzipped(data)).arrayBuffer()), n = planes.length / 2;
  return Float64Array.from({ length: n }, (_, k) => {
    const whole = planes[k] + 256 * planes[n + k];
    return whole === 65535 ? NaN : first + slope * k + step * whole;
  });
}

/* Least and largest value of each block, in the order in which they come. */
function coarse(t, y, from, to) {
  const block = Math.max(1, Math.ceil((2 * (to - from)) / MOST_POINTS));
  const x = [], v = [];
  if (block < 3) {
    for (let i = from; i < to; i++) { x.push(t[i]); v.push(y[i]); }
    return [x, v];
  }
  for (let i = from; i < to; i += block) {
    let low = i, high = i;
    for (let k = i; k < Math.min(i + block, to); k++) {
      if (Number.isNaN(y[k])) { low = high = k; break; }
      if (y[k] < y[low]) low = k;
      if (y[k] > y[high]) high = k;
    }
    for (const k of low < high ? [low, high] : [high, low]) { x.push(t[k]); v.push(y[k]); }
  }
  return [x, v];
}

function below(t, value) {
  let low = 0, high = t.length;
  while (low < high) { const middle = (low + high) >> 1; if (t[middle] < value) low = middle + 1; else high = middle; }
  return low;
}

/* Stamps with the pauses that report/figures/overlay.py has taken out of them. */
function paused(t, pauses) {
  for (const [k, seconds] of pauses) for (let i = k; i < t.length; i++) t[i] += seconds;
  return t;
}

async function traces({ t, pauses, measured, residuals }) {
  const y = await unpacked(measured.y);
  const off = await Promise.all(residuals.map((r) => unpacked(r.y)));
  return { t: paused(await unpacked(t), pauses), all: [
    { name: "measured", colour: measured.colour, y, axis: "y" },
    ...residuals.map((r, i) => ({ name: r.name, colour: r.colour, axis: "y", y: y.map((v, k) => v - off[i][k]) })),
    ...residuals.map((r, i) => ({ name: "residual, " + r.name, colour: r.colour, axis: "y2", y: off[i] })),
  ] };
}

async function overlay(node, figure) {
  const { t, all } = figure.traces = await traces(figure.extra);
  const drawn = ([from, to]) => {
    const a = Math.max(0, below(t, from) - 1), b = Math.min(t.length, below(t, to) + 1);
    return all.map((s) => coarse(t, s.y, a, b));
  };
  const data = drawn(figure.layout.xaxis.range).map(([x, y], i) => ({
    type: "scatter", mode: "lines", x, y, name: all[i].name, yaxis: all[i].axis,
    line: { color: all[i].colour, width: i === 0 ? 4.5 : all[i].axis === "y" ? 1.4 : 1 },
    opacity: i === 0 ? 0.55 : 1, hovertemplate: "%{y:.4g} " + figure.extra.unit,
  }));
  return Plotly.newPlot(node, data, figure.layout, CONFIG).then(() => {
    node.on("plotly_relayout", (change) => {
      const whole = change["xaxis.autorange"];
      const range = whole ? [t[0], t[t.length - 1]] : [change["xaxis.range[0]"], change["xaxis.range[1]"]];
      if (!whole && range[0] === undefined) return;
      const next = drawn(range);
      Plotly.update(node, { x: next.map((s) => s[0]), y: next.map((s) => s[1]) }, { "xaxis.range": range });
    });
  });
}

/* In the dark the colours of text, grid and background change places; those with a meaning stay. */
const DARK = { "#1f2933": "#e4e7eb", "#66717d": "#9aa5b1", "#e6e9ec": "#323f4b", "#ffffff": "#1b232b", "#1864ab": "#4dabf7" };

function button(text, about, act) {
  const made = document.createElement("button");
  made.type = "button"; made.textContent = text; made.title = about;
  made.addEventListener("click", () => act(made));
  return made;
}

/* A name without its marks; a break between two lines is a space. */
function plain(name) { return new DOMParser().parseFromString(String(name).replace(/<br>/g, " "), "text/html").body.textContent; }

/* The title of the axis of a curve, which ends in the unit: of "x2" that of xaxis2, or of the next one with a title. */
function quantity(layout, axis) {
  const [letter, number = ""] = [axis[0], axis.slice(1)];
  const title = (name) => layout[name]?.title?.text;
  const any = () => Object.keys(layout).filter((name) => name.startsWith(letter + "axis")).map(title).find(Boolean);
  return title(`${letter}axis${number}`) || title(`${letter}axis`) || any() || letter;
}

/* A value with seven digits; a date as it is, nothing for a gap. */
function cell(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "";
  return Number.isNaN(+value) ? `"${String(value).replace(/"/g, '""')}"` : String(+(+value).toPrecision(7));
}

/* All samples of an overlay, the drawn points of any other figure: a column pair for each curve or row, with units. */
function csv(node, figure) {
  const times = figure.traces?.t.map((t) => Math.round(1e7 * t) / 1e7); /* without what the packing adds */
  const curves = figure.kind === "overlay"
    ? figure.traces.all.map((s) => ({ name: s.name, x: times, y: s.y, yaxis: s.axis }))
    : node.data.flatMap((d) => (d.z && d.showscale !== false ? d.y.map((name, k) => ({ name, x: d.x, y: d.z[k] })) : d.x && d.y && d.name ? [d] : []));
  const quoted = (s) => '"' + plain(s).replace(/"/g, '""') + '"';
  const title = (c, letter) => quoted(`${c.name}: ${quantity(figure.layout, c[letter + "axis"] || letter)}`);
  const head = curves.flatMap((c) => [title(c, "x"), title(c, "y")]).join(",");
  const rows = Array.from({ length: Math.max(0, ...curves.map((c) => c.x.length)) }, (_, i) =>
    curves.flatMap((c) => (i < c.x.length ? [cell(c.x[i]), cell(c.y[i])] : ["", ""])).join(","));
  return [head, ...rows].join("\n") + "\n";
}

/* The figure as it is zoomed and switched, with the names that a narrow screen leaves out beside it. */
function picture(node, figure) {
  const { annotations = [], margin } = figure.printed;
  const names = annotations.filter(beside);
  const narrow = names.length > (node.layout.annotations || []).filter(beside).length;
  const paper = { paper_bgcolor: getComputedStyle(document.body).backgroundColor };
  const layout = { ...node.layout, ...paper, ...(narrow ? { annotations, margin, autosize: false } : {}) };
  return Plotly.downloadImage({ data: node.data, layout }, {
    format: "png", scale: 2, width: narrow ? PRINTED : node.clientWidth, height: node.clientHeight, filename: node.id });
}

function save(name, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name; link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/* A piece of a curve, with which its switch is its legend as well. */
function swatch({ line, marker, mode, fillcolor, fill }) {
  const made = document.createElement("i");
  const colour = fill && fillcolor || line && line.color || marker && marker.color;
  const dash = { dot: "dotted", dash: "dashed" }[line && line.dash] || "solid";
  made.className = mode === "markers" ? "dot" : "";
  made.style.borderTop = `${fill || made.className ? 7 : 2}px ${dash} ${typeof colour === "string" ? colour : "transparent"}`;
  return made;
}

/* Whether an annotation is a name beside the curves. */
function beside(a) { return a.xref === "paper" && a.x >= 1 && a.xanchor === "left"; }

/* On a narrow screen a figure has the whole width; names beside the curves give way to the switches below. */
function fitted(figure) {
  if (!LOOKS[2].matches) return figure;
  const { margin, annotations = [], scene } = figure.layout;
  const names = new Set((figure.data || []).map((d) => d.name).filter(Boolean));
  const switched = figure.kind === "overlay" || names.size > 1;
  const kept = annotations.filter((a) => !(switched && beside(a)));
  const wide = kept.some(beside) ? {} : { r: Math.min(margin.r, 14) };
  const layout = { ...figure.layout, annotations: kept, margin: { ...margin, ...wide } };
  return { ...figure, layout: scene ? { ...layout, scene: further(scene) } : layout };
}

/* A scene seen from further away: its labels do not get smaller with the screen. */
function further(scene) {
  const eye = Object.fromEntries(Object.entries(scene.camera.eye).map(([axis, value]) => [axis, 1.9 * value]));
  return { ...scene, camera: { ...scene.camera, eye } };
}

/* Under a figure: a switch for each named curve, the picture, the numbers. */
function tools(node, figure) {
  const bar = document.createElement("div");
  bar.className = "tools";
  const names = [...new Set(node.data.map((d) => d.name).filter(Boolean))];
  if (names.length > 1) for (const name of names) {
    const curves = node.data.map((d, i) => (d.name === name ? i : -1)).filter((i) => i >= 0);
    const toggle = button(plain(name), "show or hide this curve", (self) => {
      const hide = self.getAttribute("aria-pressed") === "true";
      self.setAttribute("aria-pressed", String(!hide));
      Plotly.restyle(node, { visible: !hide }, curves);
    });
    toggle.setAttribute("aria-pressed", "true");
    toggle.prepend(swatch(node.data[curves[0]]));
    bar.append(toggle);
  }
  bar.append(
    button("PNG", "this figure as a picture", () => picture(node, figure)),
    button("CSV", "the numbers of this figure", () => save(node.id + ".csv", csv(node, figure))));
  node.after(bar);
}

const LOOKS = [matchMedia("(prefers-color-scheme: dark)"), matchMedia("print"), matchMedia("(max-width: 640px)")];

function inTheDark(text) {
  const [dark, print] = LOOKS;
  return dark.matches && !print.matches ? text.replace(/#[0-9a-f]{6}/g, (colour) => DARK[colour] || colour) : text;
}

/* Draws all figures; once more when the colours or the width class of the screen change, or the page is printed. */
let drawings = 0;
function draw() {
  const drawing = ++drawings;
  for (const node of document.querySelectorAll(".figure")) {
    if (node.dataset.drawn) { Plotly.purge(node); node.nextElementSibling.remove(); delete node.dataset.drawn; }
    const whole = JSON.parse(inTheDark(document.getElementById(node.id + "-data").textContent));
    const figure = { ...fitted(whole), printed: whole.layout };
    const done = figure.kind === "overlay" ? overlay(node, figure) : Plotly.newPlot(node, figure.data, figure.layout, CONFIG);
    done.then(() => {
      if (drawing !== drawings) return; /* a later one draws its tools */
      tools(node, figure); node.dataset.drawn = "yes";
    });
  }
}

/* On a narrow screen each row of a table is a card; its cells say of which column they are. What a cell holds is
   one box beside that, or below it where it is prose. */
function labelCells() {
  for (const table of document.querySelectorAll("table")) {
    const heads = [...table.querySelectorAll("thead th")].map((th) => th.textContent);
    for (const row of table.tBodies[0]?.rows || []) [...row.cells].forEach((cell, i) => {
      cell.dataset.label = heads[i] || "";
      if (!cell.childNodes.length) return;
      const held = document.createElement("div");
      held.append(...cell.childNodes); cell.append(held);
      cell.classList.toggle("prose", !cell.matches(".number") && held.textContent.length > LONGEST_CELL);
    });
  }
}

/* An option such as --rig stays in one piece: browsers break lines behind its hyphens. */
function keepOptions() {
  const walker = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT), texts = [];
  while (walker.nextNode()) if (walker.currentNode.data.includes("--") && !walker.currentNode.parentElement.closest("script, style, svg")) texts.push(walker.currentNode);
  for (const text of texts) text.replaceWith(...text.data.split(/(--[a-z][\w-]*)/).filter(Boolean).map((piece) => {
    if (!/^--[a-z]/.test(piece)) return piece;
    const option = document.createElement("span");
    option.className = "option"; option.textContent = piece;
    return option;
  }));
}

/* plotly.js lies in the page compressed: a third of its size. */
async function unpackPlotly() {
  const script = document.createElement("script");
  script.textContent = await (await gunzipped(document.getElementById("plotly").textContent)).text();
  document.head.append(script);
}

labelCells();
keepOptions();
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
if (document.querySelector(".figure")) unpackPlotly().then(() => {
  draw();
  LOOKS.forEach((look) => look.addEventListener("change", draw));
}, (error) => {
  document.querySelectorAll(".figure").forEach((node) => { node.textContent = "This browser is too old to draw the figures: " + error; });
});

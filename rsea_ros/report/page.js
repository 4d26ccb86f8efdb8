"use strict";
/* Draws the figures of the page. An overlay holds all samples and is drawn anew from them on every zoom. */

const CONFIG = { responsive: true, displaylogo: false, displayModeBar: false };
const MOST_POINTS = 3000;

function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
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

function traces(extra) {
  const t = unpacked(extra.t);
  const all = extra.series.map((s) => ({ name: s.name, colour: s.colour, y: unpacked(s.y), axis: "y" }));
  const residuals = all.slice(1).map((s) => ({
    name: "residual, " + s.name, colour: s.colour, axis: "y2", y: all[0].y.map((v, i) => v - s.y[i]),
  }));
  return { t, all: all.concat(residuals) };
}

function overlay(node, figure) {
  const { t, all } = traces(figure.extra);
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

for (const node of document.querySelectorAll(".figure")) {
  const figure = JSON.parse(document.getElementById(node.id + "-data").textContent);
  const done = figure.kind === "overlay" ? overlay(node, figure) : Plotly.newPlot(node, figure.data, figure.layout, CONFIG);
  done.then(() => { node.dataset.drawn = "yes"; });
}

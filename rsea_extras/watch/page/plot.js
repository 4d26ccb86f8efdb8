"use strict";
/* Lines over time on a canvas: the newest at the right, extremes of each batch as they come. */

const SECONDS = 60, PER_SECOND = 62;

/* Time and value of what came last; the oldest goes first. */
class Trace {
  constructor(name, text, shown = true) {
    this.name = name; this.text = text; this.shown = shown;
    this.size = 2 ** Math.ceil(Math.log2(SECONDS * PER_SECOND));
    this.t = new Float64Array(this.size); this.v = new Float64Array(this.size); this.count = 0;
  }
  add(t, v) { const k = this.count++ % this.size; this.t[k] = t; this.v[k] = v; }
  get last() { return this.count ? this.v[(this.count - 1) % this.size] : NaN; }
  /* Call f(t, v) for what is not before a time, and the one sample before it. */
  since(from, f) {
    let k = this.count, first = Math.max(0, this.count - this.size);
    while (k > first && this.t[(k - 1) % this.size] >= from) k--;
    for (k = Math.max(first, k - 1); k < this.count; k++) f(this.t[k % this.size], this.v[k % this.size]);
  }
  at(time) {
    let best = NaN, gap = 0.1;
    this.since(time - gap, (t, v) => { if (Math.abs(t - time) < gap) { gap = Math.abs(t - time); best = v; } });
    return best;
  }
  clear() { this.count = 0; }
}

function niceStep(span, most) {
  const raw = span / most, power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((m) => m * power >= raw);
}

function sized(canvas) {
  const ratio = devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0); pen.clearRect(0, 0, w, h);
  return [pen, w, h];
}

class Plot {
  constructor(canvas, traces, least) {
    this.canvas = canvas; this.traces = traces; this.least = least; this.range = [-least, least]; this.pointer = null;
    canvas.addEventListener("pointermove", (e) => { this.pointer = e.offsetX; });
    canvas.addEventListener("pointerleave", () => { this.pointer = null; });
  }
  /* The range grows at once and shrinks slowly, so that the picture stands still. */
  fit(from) {
    let low = Infinity, high = -Infinity;
    for (const trace of this.traces) if (trace.shown) trace.since(from, (t, v) => { if (v < low) low = v; if (v > high) high = v; });
    if (!(low <= high)) return;
    const middle = (low + high) / 2, half = Math.max(0.56 * (high - low), this.least);
    const [a, b] = this.range, aim = [middle - half, middle + half];
    this.range = [aim[0] < a ? aim[0] : a + 0.04 * (aim[0] - a), aim[1] > b ? aim[1] : b + 0.04 * (aim[1] - b)];
  }
  /* Draw up to a time; return the time under the pointer. */
  draw(now, span, colours) {
    const [pen, w, h] = sized(this.canvas), left = 52, bottom = 22, [low, high] = this.range;
    const x = (t) => left + (w - left) * (1 - (now - t) / span), y = (v) => (h - bottom) * (1 - (v - low) / (high - low)) + 1;
    this.fit(now - span);
    pen.font = "12px system-ui, sans-serif"; pen.fillStyle = colours.quiet; pen.strokeStyle = colours.line; pen.lineWidth = 1;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    const step = niceStep(high - low, (h - bottom) / 36), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(w, y(v)); pen.stroke();
      if (y(v) > 6 && y(v) < h - bottom + 1) pen.fillText(Math.abs(v) < step / 2 ? "0" : v.toFixed(digits).replace("-", "−"), left - 8, y(v));
    }
    pen.textBaseline = "alphabetic";
    for (let k = 0, every = niceStep(span, w / 90); k * every <= span; k++) {
      pen.textAlign = k ? "center" : "right";
      if (x(now - k * every) > left + 12) pen.fillText(k ? `−${+(k * every).toFixed(1)} s` : "now", x(now - k * every), h - 5);
    }
    pen.save(); pen.beginPath(); pen.rect(left, 0, w - left, h - bottom + 2); pen.clip(); pen.lineJoin = "round";
    for (const trace of this.traces) if (trace.shown) this.line(pen, trace, now - span, x, y, colours[trace.name]);
    pen.restore();
    if (this.pointer === null || this.pointer < left) return null;
    pen.strokeStyle = colours.quiet; pen.beginPath(); pen.moveTo(this.pointer, 0); pen.lineTo(this.pointer, h - bottom); pen.stroke();
    return now - span * (1 - (this.pointer - left) / (w - left));
  }
  /* A pause of more than a quarter of a second is a gap. */
  line(pen, trace, from, x, y, colour) {
    pen.strokeStyle = colour; pen.lineWidth = trace.name === "ft" ? 3 : 1.5; pen.globalAlpha = trace.name === "ft" ? 0.6 : 1;
    pen.beginPath();
    let before = -Infinity;
    trace.since(from, (t, v) => { if (t - before > 0.25) pen.moveTo(x(t), y(v)); else pen.lineTo(x(t), y(v)); before = t; });
    pen.stroke(); pen.globalAlpha = 1;
  }
}

/* Where a flag was up: a strip of colour. */
function strip(canvas, trace, now, span, colours) {
  const [pen, w, h] = sized(canvas), left = 52, x = (t) => left + (w - left) * Math.max(0, 1 - (now - t) / span);
  pen.font = "12px system-ui, sans-serif"; pen.textAlign = "right"; pen.textBaseline = "middle";
  pen.fillStyle = colours.quiet; pen.fillText("pure", left - 8, h / 2);
  pen.fillStyle = colours.line; pen.fillRect(left, 3, w - left, h - 6);
  pen.fillStyle = colours.good;
  let begin = null, before = null;
  const end = () => { if (begin !== null) pen.fillRect(x(begin), 3, x(before) - x(begin), h - 6); begin = null; };
  trace.since(now - span, (t, v) => { if (!v || (before !== null && t - before > 0.25)) end(); if (v && begin === null) begin = t; before = t; });
  end();
}

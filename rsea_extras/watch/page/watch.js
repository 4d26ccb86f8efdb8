"use strict";
/* The page: what the socket brings is drawn and listed, what is pressed goes out as wishes. */

const $ = (id) => document.getElementById(id);
history.replaceState(null, "", "/"); /* the token leaves the address: it is in the cookie now */

const TORQUES = [
  new Trace("command", "command", false), new Trace("ft", "F/T"), new Trace("motor", "motor"),
  new Trace("proximal", "T_p"), new Trace("distal", "T_d"), new Trace("disturbance", "disturbance", false)];
const DEFLECTION = new Trace("deflection", "spring"), PURE = new Trace("pure", "pure torque");
const BY_NAME = Object.fromEntries([...TORQUES, DEFLECTION].map((t) => [t.name, t]));
const SCALE = { deflection: 1e3 };
const torque = new Plot($("torque"), TORQUES, 0.5), deflection = new Plot($("deflection"), [DEFLECTION], 0.2);
let span = 10, now = 0, frozen = null, socket = null, colours = {}, dirty = true;

function element(tag, text, parts = {}) {
  const made = Object.assign(document.createElement(tag), parts);
  if (text !== undefined) made.textContent = text;
  return made;
}

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["quiet", "line", "good", ...Object.keys(BY_NAME)]) colours[name] = style.getPropertyValue("--" + name).trim();
  dirty = true;
}

function choice(place, items, chosen, act) {
  const buttons = items.map(([value, text]) => {
    const made = element("button", text, { type: "button" });
    made.addEventListener("click", () => { mark(value); act(value); });
    made.dataset.value = value;
    return made;
  });
  const mark = (value) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b.dataset.value === String(value))));
  place.replaceChildren(...buttons); mark(chosen);
}

function names(place, traces) {
  for (const trace of traces) {
    const made = element("button", trace.text, { type: "button", title: "show or hide" });
    made.style.setProperty("--colour", `var(--${trace.name})`);
    made.setAttribute("aria-pressed", String(trace.shown));
    trace.label = made.appendChild(element("b", "–"));
    made.addEventListener("click", () => { trace.shown = !trace.shown; made.setAttribute("aria-pressed", String(trace.shown)); dirty = true; });
    place.append(made);
  }
}

function draw() {
  requestAnimationFrame(draw);
  if (!dirty && torque.pointer === null && deflection.pointer === null) return;
  dirty = false;
  const end = frozen ?? now;
  const read = [torque.draw(end, span, colours), deflection.draw(end, span, colours)].find((t) => t !== null);
  strip($("flag"), PURE, end, span, colours);
  for (const trace of [...TORQUES, DEFLECTION]) {
    const value = read === undefined ? (now && trace.count && now - trace.t[(trace.count - 1) % trace.size] < 1 ? trace.last : NaN) : trace.at(read);
    trace.label.textContent = Number.isNaN(value) ? "–" : value.toFixed(2).replace(/^-0\.00$/, "0.00").replace("-", "−");
  }
}

const REST = 1; /* s without a command but zero */
let driven = -Infinity; /* s, the last command that was not zero */
function forget() { for (const t of [...TORQUES, DEFLECTION, PURE]) t.clear(); now = 0; driven = -Infinity; }

function onFrame(frame) {
  if (frame.t0 < now - 2) forget(); /* a bag that is played anew */
  for (const [name, row] of Object.entries(frame)) {
    const trace = BY_NAME[name];
    if (trace) for (let k = 0; k < row.length; k += 2) {
      const t = frame.t0 + row[k] / 1e3;
      trace.add(t, row[k + 1] * (SCALE[name] || 1));
      if (name === "command" && row[k + 1] !== 0) driven = t;
      if (name !== "command") now = Math.max(now, t); /* a command is of the time to come */
    }
  }
  if (frame.pure !== null) PURE.add(frame.t0, frame.pure ? 1 : 0);
  const pill = $("pure");
  const idle = !frame.pure && now > driven + REST; /* without torque there is none to be pure */
  pill.textContent = frame.pure === null ? "no flag" : idle ? "no torque commanded" : frame.pure ? "pure torque" : "not pure torque";
  pill.className = frame.pure === null || idle ? "pill" : frame.pure ? "pill good" : "pill warn";
  dirty = true;
}

/* Lists are made anew only when what they say has changed: what is open or pressed stays. */
const shown = {};
function onceChanged(name, value, make) {
  const text = JSON.stringify(value);
  if (shown[name] !== text) { shown[name] = text; make(value); }
}

const LEVELS = ["var(--good)", "var(--warn)", "var(--bad)", "var(--quiet)"];
function health(statuses) {
  const open = new Set([...document.querySelectorAll("#health details[open]")].map((d) => d.dataset.name));
  $("health").replaceChildren(...statuses.map(({ name, level, message, values }) => {
    const made = element("details"), head = made.appendChild(element("summary")), list = made.appendChild(element("dl"));
    made.dataset.name = name; made.open = open.has(name);
    head.style.setProperty("--colour", LEVELS[level]);
    head.append(element("b", name.replace(/^\/\w+\//, "")), element("span", message));
    for (const [key, value] of values) list.append(element("dt", key), element("dd", value));
    const item = element("li"); item.append(made); return item;
  }));
}

function recorder(running) {
  $("record").textContent = running ? `Stop (${running.seconds.toFixed(0)} s)` : "Record";
  $("record").className = running ? "on" : "";
}

function recordings(list) {
  const busy = list.some((r) => Object.values(r.jobs).some((j) => j.state === "running"));
  $("recordings").replaceChildren(...list.map((r) => {
    const item = element("li"), head = item.appendChild(element("div"));
    head.append(element("span", r.name), element("span", r.running ? "recording" : `${r.seconds.toFixed(1)} s`, { className: "quiet" }));
    if (r.words) item.append(element("p", r.words));
    if (r.running || r.words) return item;
    const acts = item.appendChild(element("div", undefined, { className: "acts" }));
    for (const verb of ["identify", "diagnose"]) {
      const job = r.jobs[verb];
      if (job?.state === "done") acts.append(element("a", `${verb}: page`, { href: `/report/${r.name}/${verb}`, target: "_blank", rel: "noopener" }));
      else {
        const act = acts.appendChild(element("button", job?.state === "running" ? `${verb} …` : verb, { type: "button", disabled: busy }));
        act.addEventListener("click", () => send({ do: "evaluate", recording: r.name, verb }));
      }
      if (job?.words) item.append(element("p", job.words.split("; next:")[0], { className: job.state === "failed" ? "" : "quiet" }));
    }
    return item;
  }));
}

function onState({ bench, health: statuses, rates, command: may, recordings: list }) {
  $("bench").textContent = bench;
  $("rates").textContent = Object.entries(rates).map(([topic, hz]) => `${topic} ${hz} Hz`).join(" · ");
  if (statuses.length) onceChanged("health", statuses, health);
  recorder(list.find((r) => r.running));
  onceChanged("recordings", list.map((r) => (r.running ? { ...r, seconds: 0 } : r)), recordings);
  onceChanged("command", may, command.show);
}

function onMessage(event) {
  const message = JSON.parse(event.data);
  if (message.error) say(message.error);
  else if (message.state) onState(message.state);
  else onFrame(message);
}

let silence = 0;
function say(text) {
  $("message").textContent = text; $("message").hidden = false;
  clearTimeout(silence); silence = setTimeout(() => { $("message").hidden = true; }, 6000);
  command.stop();
}

function send(words) { if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(words)); }

/* The command is a heartbeat: without it, with the tab hidden or the socket lost, the server goes to zero. */
const command = {
  beat: 0, kind: "constant",
  show(may) {
    $("command").hidden = !may;
    if (!may) return;
    $("limit").textContent = may.limit === null ? "" : `at most ${may.limit} N·m`;
    if (may.limit !== null) { $("amplitude").max = may.limit; $("amplitude").min = -may.limit; }
    $("why").textContent = may.why_not || (may.held && !command.beat ? "another page holds the command" : "");
    $("go").disabled = !command.beat && Boolean($("why").textContent);
    if (!$("kinds").children.length) choice($("kinds"), may.kinds.map((k) => [k, k]), command.kind, command.choose);
  },
  choose(kind) { command.kind = kind; $("frequency-row").hidden = kind === "constant"; },
  wish: () => ({ do: "hold", kind: command.kind, amplitude: $("amplitude").valueAsNumber, frequency: $("frequency").valueAsNumber || 1 }),
  start() {
    if (command.beat || !$("wish").reportValidity()) return;
    command.beat = setInterval(() => { if ($("wish").checkValidity()) send(command.wish()); }, 100);
    send(command.wish()); command.look();
  },
  stop() {
    if (command.beat) { clearInterval(command.beat); command.beat = 0; send({ do: "release" }); }
    command.look();
  },
  look() { $("go").textContent = command.beat ? "Stop" : "Start"; $("go").className = command.beat ? "on" : ""; },
};

function link(text, kind) { $("link").textContent = text; $("link").className = "pill " + kind; }

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.onopen = () => { link("live", "good"); forget(); };
  socket.onmessage = onMessage;
  socket.onclose = () => { link("lost", "bad"); command.stop(); setTimeout(connect, 1500); };
}

choice($("windows"), [[5, "5 s"], [10, "10 s"], [30, "30 s"], [60, "60 s"]], span, (s) => { span = +s; dirty = true; });
names($("torque-names"), TORQUES); names($("deflection-names"), [DEFLECTION]);
$("pause").addEventListener("click", () => { frozen = frozen === null ? now : null; $("pause").setAttribute("aria-pressed", String(frozen !== null)); dirty = true; });
$("record").addEventListener("click", () => send({ do: $("record").className ? "stop" : "record" }));
$("wish").addEventListener("submit", (e) => { e.preventDefault(); if (command.beat) command.stop(); else command.start(); });
document.addEventListener("visibilitychange", () => { if (document.hidden) command.stop(); });
addEventListener("pagehide", () => command.stop());
addEventListener("keydown", (e) => { if (e.key === "Escape") command.stop(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
addEventListener("resize", () => { dirty = true; });
readColours(); command.choose("constant"); connect(); draw();

"use strict";
const $ = (id) => document.getElementById(id);
const RENEW_EVERY_MS = 500, STREAM_HZ = 25, DRAW_EVERY_MS = 50;
let lease_ttl_ms = 3000, thruster = null, lease = null, socket = null, state = null, heard_ms = 0, paused_s = null, limitsOf = {}, recording = null, dragging = false, taken_ms = 0, drawn_ms = 0;

const charts = [
  new StripChart($("plot-thrust"), "thrust", "N", [
    { name: "commanded", color: "--quiet", dash: [5, 4], atLeast: 4 }, { name: "measured", color: "--blue" }, { name: "estimated", color: "--orange" }]),
  new StripChart($("plot-speed"), "shaft speed", "rad/s", [
    { name: "commanded", color: "--quiet", dash: [5, 4], atLeast: 4 }, { name: "measured", color: "--green" }]),
  new StripChart($("plot-current"), "motor current", "A", [
    { name: "commanded", color: "--quiet", dash: [5, 4], atLeast: 1 }, { name: "measured", color: "--purple" }]),
  new StripChart($("plot-flow"), "axial flow", "m/s", [
    { name: "measured", color: "--blue", atLeast: 0.4 }, { name: "estimated", color: "--orange" }, { name: "ambient, estimated", color: "--green", dash: [2, 3] }]),
];
const TILES = [
  ["thrust", "N", (s) => s.measured.thrust_n, 1], ["thrust, estimated", "N", (s) => s.estimated.thrust_n, 1],
  ["shaft speed", "rad/s", (s) => s.measured.shaft_speed_rad_s, 1], ["shaft speed", "rpm", (s) => scaled(s.measured.shaft_speed_rad_s, 30 / Math.PI), 0],
  ["motor current", "A", (s) => s.measured.current_a, 2], ["supply", "V", (s) => s.measured.supply_v, 1],
  ["flow, estimated", "m/s", (s) => s.estimated.flow_m_s, 2], ["ambient, estimated", "m/s", (s) => s.estimated.ambient_m_s, 2],
];
const scaled = (value, factor) => (value === null || value === undefined ? null : value * factor);
const text = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));

function log(message, bad) {
  const item = document.createElement("li");
  item.textContent = `${new Date().toLocaleTimeString()}  ${message}`;
  if (bad) item.className = "bad";
  $("log").prepend(item);
  while ($("log").children.length > 200) $("log").lastChild.remove();
}

// One request; a problem document becomes a line in the log and a thrown error.
async function call(method, path, body) {
  const headers = {};
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (lease) headers["Lease-Id"] = lease;
  let answer;
  try {
    answer = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
  } catch (error) {
    log(`${method} ${path}: the gateway does not answer`, true);
    throw error;
  }
  if (answer.status === 204) return null;
  const answered = await answer.json();
  if (!answer.ok) {
    log(`${answered.title}: ${answered.detail}${answered.hint ? ` (hint: ${answered.hint})` : ""}`, true);
    throw new Error(answered.title);
  }
  return answered;
}
const base = () => `/v1/thrusters/${encodeURIComponent(thruster)}`;
// A click whose failure is already in the log.
const click = (id, action) => $(id).addEventListener("click", () => action().catch(() => {}));

function connect() {
  if (socket) { socket.onclose = null; socket.close(); }
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}${base()}/stream?hz=${STREAM_HZ}`);
  socket.onmessage = (message) => {
    const next = JSON.parse(message.data);
    if (next.status && next.title) { log(`${next.title}: ${next.detail}`, true); return; }
    state = next; heard_ms = performance.now();
    record(state);
  };
  socket.onclose = () => setTimeout(connect, 1000);
}

function record(s) {
  const t = s.time_s, points = charts[0].points[0];
  if (points.length && t < points[points.length - 1][0]) charts.forEach((chart) => chart.clear());
  const set = s.setpoint || {}, cmd = s.commanded || {};
  charts[0].push(t, [set.thrust_n ?? cmd.thrust_cmd_n ?? null, s.measured.thrust_n, s.estimated.thrust_n]);
  charts[1].push(t, [set.speed_rad_s ?? cmd.speed_cmd_rad_s ?? null, s.measured.shaft_speed_rad_s]);
  charts[2].push(t, [cmd.current_cmd_a ?? null, s.measured.current_a]);
  charts[3].push(t, [s.measured.flow_m_s, s.estimated.flow_m_s, s.estimated.ambient_m_s]);
}

function show() {
  const live = state && performance.now() - heard_ms < 1500;
  chip("link", live ? "live" : "no link", live ? "good" : "bad");
  if (state) {
    const end_s = paused_s ?? state.time_s + (live ? Math.min(0.2, (performance.now() - heard_ms) / 1000) : 0);
    if (performance.now() - drawn_ms >= DRAW_EVERY_MS) { // not every frame: renewing the lease comes first
      drawn_ms = performance.now();
      charts.forEach((chart) => chart.draw(end_s, Number($("span").value)));
    }
    showState(state, live);
  }
  requestAnimationFrame(show);
}

let shown = 0;
function showState(s, live) {
  if (performance.now() - shown < 100) return;
  shown = performance.now();
  TILES.forEach(([, , value, digits], i) => { $("tiles").children[i].querySelector("i").textContent = text(value(s), digits); });
  $("time").textContent = `servo time ${s.time_s.toFixed(2)} s`;
  chip("armed", s.armed ? "armed" : "disarmed", s.armed ? "warn" : "");
  $("arm").disabled = s.armed || !live; $("disarm").disabled = !live;

  const mine = lease && s.lease;
  // A state that was on its way when the lease was granted does not know of it.
  if (lease && !s.lease && heard_ms > taken_ms + 500) { lease = null; log("the lease ran out", true); }
  $("lease-text").textContent = !s.lease ? "Nobody has the lease."
    : mine ? "You have the lease." : `“${s.lease.holder}” has the lease.`;
  $("lease-bar").style.width = s.lease ? `${Math.min(100, s.lease.expires_in_ms / lease_ttl_ms * 100)}%` : "0";
  $("take").disabled = Boolean(s.lease); $("give").disabled = !lease; $("send").disabled = !lease || !s.armed;
  $("setpoint-text").textContent = `in force: ${Object.entries(s.setpoint).map(([name, value]) => `${name} = ${value.toFixed(2)}`).join(", ")}`
    + (!lease ? " — take the lease to change it" : !s.armed ? " — arm to change it" : "");

  $("fault-chip").hidden = s.faults.length === 0;
  chip("fault-chip", s.faults.length === 1 ? "1 fault" : `${s.faults.length} faults`, "bad");
  $("faults").replaceChildren(...(s.faults.length ? s.faults.map(faultItem) : [none("No fault is latched.")]));
  $("limits").textContent = s.limits.length ? `limit in force: ${s.limits.map((limit) => limit.name ?? limit).join(", ")}` : "No limit is in force.";
  if (document.activeElement !== $("controller") && $("controller").dataset.running !== s.controller) loadController().catch(() => {});
  $("estimator-text").textContent = `observer ${s.observer ?? "–"} · estimator ${s.estimator ?? "–"}${s.estimator_frozen ? ", frozen for want of excitation" : ""}`;
  $("parameters").replaceChildren(...s.estimated.parameters.map((p) => cells([p.name, text(p.value, 4), text(p.std_error, 4), p.unit])));
}

function faultItem(fault) {
  const item = document.createElement("li"), link = document.createElement("a");
  link.href = `/v1/faults/${fault.code}`; link.target = "_blank"; link.textContent = `${fault.code} ${fault.name}`;
  item.append(link, document.createElement("br"), fault.help);
  return item;
}
function none(words) { const item = document.createElement("li"); item.className = "none"; item.textContent = words; return item; }
function cells(values) {
  const row = document.createElement("tr");
  for (const value of values) { const cell = document.createElement("td"); cell.append(...[value].flat().map((part) => part ?? "")); row.append(cell); }
  return row;
}
function chip(id, words, kind) { $(id).textContent = words; $(id).className = `chip ${kind}`; }

// Command ------------------------------------------------------------------------------------------------
click("take", async () => {
  const granted = await call("POST", `${base()}/lease`, { holder: $("holder").value, ttl_ms: lease_ttl_ms });
  lease = granted.lease_id; taken_ms = performance.now(); log(`lease taken as “${$("holder").value}”`);
});
click("give", async () => { // forgotten before the answer comes: what is being given up is not renewed
  const given = call("DELETE", `${base()}/lease`);
  lease = null;
  await given; log("lease given up");
});
setInterval(() => { if (lease) call("PUT", `${base()}/lease`).catch(() => { lease = null; }); }, RENEW_EVERY_MS);

click("arm", async () => { await call("POST", `${base()}/arm`); log("armed"); });
const disarm = async () => { await call("POST", `${base()}/disarm`); log("disarmed"); };
click("disarm", disarm); click("stop", disarm);
document.addEventListener("keydown", (event) => { if (event.key === "Escape") disarm().catch(() => {}); });
click("clear", async () => { await call("POST", `${base()}/clear-faults`); log("faults cleared"); });

const kind = () => document.querySelector("input[name=kind]:checked").value;
const send = async (value) => {
  const applied = await call("PUT", `${base()}/setpoint`, { [kind()]: value });
  $("entry").value = value; $("slider").value = value;
  return applied;
};
click("send", async () => { const value = Number($("entry").value); await send(value); log(`setpoint ${kind()} = ${value}`); });
click("zero-button", async () => { await send(0); log("setpoint zero"); });
$("entry").addEventListener("keydown", (event) => { if (event.key === "Enter") $("send").click(); });
$("slider").addEventListener("input", () => {
  $("entry").value = $("slider").value;
  if (!lease || !state || !state.armed || dragging) return;
  dragging = true; // at most one request at a time while the slider moves; the last value always goes out
  const value = Number($("slider").value);
  send(value).catch(() => {}).finally(() => { dragging = false; if (Number($("slider").value) !== value) $("slider").dispatchEvent(new Event("input")); });
});
document.querySelectorAll("input[name=kind]").forEach((radio) => radio.addEventListener("change", showKind));
function showKind() {
  const bound = limitsOf[kind()] ?? 100;
  $("unit").textContent = kind() === "thrust_n" ? "N" : "rad/s";
  const step = bound > 20 ? 0.5 : 0.01, end = Math.floor(bound / step) * step; // steps count from min: zero must be one
  $("slider").min = -end; $("slider").max = end; $("slider").step = step;
  $("slider").value = 0; $("entry").value = 0; $("entry").min = -bound; $("entry").max = bound;
}

async function loadController() {
  const answer = await call("GET", `${base()}/controller`);
  $("controller").dataset.running = answer.controller;
  $("controller").replaceChildren(...answer.available.map((name) => new Option(name, name, false, name === answer.controller)));
  $("law-parameters").replaceChildren(...answer.parameters.map((p) => {
    const entry = Object.assign(document.createElement("input"), { type: "number", step: "any", value: p.value, min: p.low, max: p.high, title: `${p.low} to ${p.high} ${p.unit}` });
    entry.addEventListener("change", () => call("PUT", `${base()}/controller`, { parameters: { [p.name]: Number(entry.value) } })
      .then(() => log(`${p.name} = ${entry.value} ${p.unit}`)).catch(() => { entry.value = p.value; }));
    return cells([p.name, entry, p.unit]);
  }));
}
click("switch", async () => {
  const answer = await call("PUT", `${base()}/controller`, { controller: $("controller").value });
  log(`control law ${answer.controller}`);
});

// Recordings ---------------------------------------------------------------------------------------------
async function loadRecordings() {
  const list = await call("GET", "/v1/recordings");
  recording = list.find((item) => item.state === "recording") ?? null;
  $("record").textContent = recording ? "Stop" : "Start";
  $("recording-text").textContent = recording ? `recording ${recording.name}: ${recording.rows} rows` : "";
  $("recordings").replaceChildren(...list.map((item) => cells([item.name, String(item.rows), `${item.duration_s.toFixed(1)} s`,
    ["csv", "mcap"].map((format) => Object.assign(document.createElement("a"),
      { href: `/v1/recordings/${encodeURIComponent(item.name)}?format=${format}`, textContent: format, download: `${item.name}.${format}` }))])));
}
click("record", async () => {
  if (recording) { const done = await call("DELETE", "/v1/recordings"); log(`recording ${done.name} stopped, ${done.rows} rows`); } else {
    const name = $("recording-name").value.trim();
    const started = await call("POST", "/v1/recordings", name ? { thruster, name } : { thruster });
    log(`recording ${started.name} started`);
  }
  await loadRecordings();
});
setInterval(() => { if (!document.hidden) loadRecordings().catch(() => {}); }, 2000);

click("pause", async () => {
  paused_s = paused_s === null && state ? state.time_s : null;
  $("pause").textContent = paused_s === null ? "Pause plots" : "Go on";
});
$("thruster").addEventListener("change", () => choose($("thruster").value));
async function choose(id) {
  thruster = id; lease = null; state = null; charts.forEach((chart) => chart.clear());
  limitsOf = (await call("GET", base())).range; showKind();
  connect(); await loadController();
}
async function start() {
  $("tiles").replaceChildren(...TILES.map(([name, unit]) => {
    const tile = document.createElement("div");
    tile.className = "tile"; tile.innerHTML = `<span></span><b><i style="font-style:normal">–</i> <small></small></b>`;
    tile.querySelector("span").textContent = name; tile.querySelector("small").textContent = unit;
    return tile;
  }));
  const list = await call("GET", "/v1/thrusters");
  $("thruster").replaceChildren(...list.map((item) => new Option(item.id, item.id)));
  loadRecordings().catch(() => {});
  await choose(list[0].id);
  show();
}
start().catch((error) => { log(`cannot start: ${error.message}`, true); setTimeout(() => location.reload(), 3000); });

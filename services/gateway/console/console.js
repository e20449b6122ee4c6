"use strict";
const $ = (id) => document.getElementById(id);
const RENEW_EVERY_MS = 500, STREAM_HZ = 50, DRAW_EVERY_MS = 50, STALE_MS = 700, WAIT_MS = 4000, HOLE_S = 0.5;
let lease_ttl_ms = 3000, thruster = null, lease = null, socket = null, state = null, heard_ms = 0, paused_s = null, limitsOf = null, taken_ms = 0, drawn_ms = 0;

const TILES = [
  ["thrust", "N", (s) => s.measured.thrust_n, 1], ["thrust, estimated", "N", (s) => s.estimated.thrust_n, 1],
  ["shaft speed", "rad/s", (s) => s.measured.shaft_speed_rad_s, 1], ["shaft speed", "rpm", (s) => scaled(s.measured.shaft_speed_rad_s, 30 / Math.PI), 0],
  ["motor current", "A", (s) => s.measured.current_a, 2], ["supply", "V", (s) => s.measured.supply_v, 1],
  ["flow, estimated", "m/s", (s) => s.estimated.flow_m_s, 2], ["ambient, estimated", "m/s", (s) => s.estimated.ambient_m_s, 2],
];
const scaled = (value, factor) => (value === null || value === undefined ? null : value * factor);
const text = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits).replace(/^-(?=[0.]+$)/, "")); // no minus before a zero

// The token lives as long as the tab: it is asked for where the gateway wants one.
let token = sessionStorage.getItem("kort-token");
const isStale = () => !state || performance.now() - heard_ms > STALE_MS || state.age_s === null || state.age_s > STALE_MS / 1000;

function log(message, bad) {
  const item = document.createElement("li");
  item.textContent = `${new Date().toLocaleTimeString()}  ${message}`;
  if (bad) item.className = "bad";
  $("log").prepend(item);
  while ($("log").children.length > 200) $("log").lastChild.remove();
}

// One request; a problem document becomes a line in the log (unless it is told elsewhere) and a thrown error.
async function call(method, path, body, quiet, leaseId = lease) {
  const headers = {};
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (leaseId) headers["Lease-Id"] = leaseId;
  if (token) headers.Authorization = `Bearer ${token}`;
  let answer;
  try {
    const signal = AbortSignal.timeout(WAIT_MS);
    answer = await fetch(path, { method, headers, signal, body: body === undefined ? undefined : JSON.stringify(body) });
  } catch (error) {
    log(`${method} ${path}: the gateway does not answer`, true);
    throw error;
  }
  if (answer.status === 204) return null;
  if (answer.status === 401) askToken();
  const answered = await answer.json();
  if (!answer.ok) {
    if (!quiet) log(`${answered.title}: ${answered.detail}${answered.hint ? ` (hint: ${answered.hint})` : ""}`, true);
    throw new Error(quiet ? answered.detail : answered.title);
  }
  return answered;
}
// Says who one is, where the gateway asks.
function askToken() {
  $("login").hidden = false;
}
// A link cannot carry the token: with one, the page is fetched and opened.
async function openPage(event, link) {
  if (!token) return;
  event.preventDefault();
  const answer = await fetch(link.href, { headers: { Authorization: `Bearer ${token}`, Accept: "text/html, */*" } });
  if (!answer.ok) { log(`${link.textContent}: ${answer.status}`, true); return; }
  window.open(URL.createObjectURL(await answer.blob()), "_blank");
}
$("metrics").addEventListener("click", (event) => openPage(event, $("metrics")));
const base = () => `/v1/thrusters/${encodeURIComponent(thruster)}`;
// A click whose failure is already in the log.
const click = (id, action) => $(id).addEventListener("click", () => action().catch(() => {}));

// A browser sends no Authorization with a WebSocket: the token goes as a subprotocol.
function streamOf(id, hz) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  return new WebSocket(`${scheme}://${location.host}/v1/thrusters/${encodeURIComponent(id)}/stream?hz=${hz}`, token ? ["kort", `bearer.${token}`] : ["kort"]);
}
function disconnect() {
  if (socket) { socket.onclose = null; socket.onmessage = null; socket.close(); }
  socket = null;
}
function connect() {
  disconnect();
  socket = streamOf(thruster, STREAM_HZ);
  socket.onmessage = (message) => {
    const next = JSON.parse(message.data);
    if (next.stopped) { stopConfirmed(`the stream: ${next.stopped.join(", ")}`); return; }
    if (next.status && next.title) {
      log(`${next.title}: ${next.detail}`, true);
      if (next.type === "urn:kort:problem:lease-lost") lease = null;
      return;
    }
    const first = !state;
    state = next; heard_ms = performance.now();
    if (first) proposeInForce();
    record(state);
  };
  socket.onclose = () => setTimeout(connect, 1000);
}

function record(s) {
  const set = s.setpoint || {}, cmd = s.commanded || {}, { parameters, ...est } = s.estimated;
  const estimates = [...Object.entries(est).map(([name, v]) => [`estimated_${name}`, "", v]),
    ...parameters.flatMap((p) => [...(p.name in est ? [] : [[`estimated_${p.name}`, p.unit, p.value]]), [`estimated_${p.name}${DOUBT}`, p.unit, p.std_error]]),
    ...(s.mismatch?.paths ?? []).map(({ path, level }) => [`mismatch_${path}`, LEVEL, level]),
    ...(s.mismatch?.residuals ?? []).map(({ residual, share }) => [`residual_${residual}`, "1", share])];
  const before_s = live.t[live.t.length - 1];
  if (s.time_s - before_s > HOLE_S) loadHistory(before_s, s.time_s).catch(() => {});
  live.push(s.time_s, { ...s.measured, ...cmd, ...estimatesRow(estimates), thrust_cmd_n: set.thrust_n ?? cmd.thrust_cmd_n, speed_cmd_rad_s: set.speed_rad_s ?? cmd.speed_cmd_rad_s });
}

function show() {
  const fresh = !isStale();
  const age_s = state ? (performance.now() - heard_ms) / 1000 + (state.age_s ?? 0) : null;
  chip("link", fresh ? "live" : age_s === null ? "no link" : `values are ${age_s.toFixed(1)} s old`, fresh ? "good" : "bad");
  document.body.classList.toggle("stale", !fresh);
  if (fresh) { seenDisarmed(); seenArmed(); }
  $("send").disabled = !fresh || !lease || !state.armed;
  $("zero-button").disabled = !fresh;
  if (state) {
    if (performance.now() - drawn_ms >= DRAW_EVERY_MS) { // not every frame: renewing the lease comes first
      drawn_ms = performance.now();
      const [source, from_s, to_s] = shownNow();
      charts.forEach((chart) => chart.draw(source, from_s, to_s));
    }
    showState(state, fresh);
  }
  requestAnimationFrame(show);
}

let shown = 0;
function showState(s, fresh) {
  if (performance.now() - shown < 100) return;
  shown = performance.now();
  TILES.forEach(([, , value, digits], i) => { $("tiles").children[i].querySelector("i").textContent = text(value(s), digits); });
  $("time").textContent = `servo time ${s.time_s.toFixed(2)} s`;
  chip("armed", !fresh ? `${s.armed ? "armed" : "disarmed"} when last heard` : s.armed ? "armed" : "disarmed", s.armed && fresh ? "warn" : "");
  $("arm").disabled = s.armed || !fresh; $("disarm").disabled = false;

  const mine = lease && s.lease;
  // A state that was on its way when the lease was granted does not know of it.
  if (lease && !s.lease && heard_ms > taken_ms + 500) { lease = null; log("the lease ran out", true); }
  $("lease-text").textContent = !s.lease ? "Nobody has the lease."
    : mine ? "You have the lease." : `“${s.lease.holder}” has the lease.`;
  $("lease-bar").style.width = s.lease ? `${Math.min(100, s.lease.expires_in_ms / lease_ttl_ms * 100)}%` : "0";
  $("take").textContent = s.lease && !mine ? "Take over" : "Take lease";
  $("take").disabled = Boolean(mine) || !fresh; $("give").disabled = !lease;
  $("setpoint-text").textContent = `in force: ${Object.entries(s.setpoint).map(([name, value]) => `${name} = ${value.toFixed(2)}`).join(", ")}`
    + (!lease ? " — take the lease to change it" : !s.armed ? " — arm to change it" : "");

  $("fault-chip").hidden = s.faults.length === 0;
  chip("fault-chip", s.faults.length === 1 ? "1 fault" : `${s.faults.length} faults`, "bad");
  const faults = JSON.stringify(s.faults);
  if ($("faults").dataset.shown !== faults) { // read aloud when it changes, not ten times a second
    $("faults").dataset.shown = faults;
    $("faults").replaceChildren(...(s.faults.length ? s.faults.map(faultItem) : [none("No fault is latched.")]));
  }
  $("limits").textContent = s.limits.length ? `limit in force: ${s.limits.map((limit) => limit.name ?? limit).join(", ")}` : "No limit is in force.";
  if (document.activeElement !== $("controller") && $("controller").dataset.running !== s.controller) loadController().catch(() => {});
  $("estimator-text").textContent = `observer ${s.observer ?? "–"} · estimator ${s.estimator ?? "–"}${s.estimator_frozen ? ", frozen for want of excitation" : ""}`;
  charts.forEach((chart) => chart.describe());
  $("parameters").replaceChildren(...s.estimated.parameters.map((p) => cells([p.name, text(p.value, 4), text(p.std_error, 4), p.unit])));
}

function faultItem(fault) {
  const item = document.createElement("li"), link = document.createElement("a");
  link.href = `/v1/faults/${fault.code}`; link.target = "_blank"; link.textContent = `${fault.code} ${fault.name}`;
  link.addEventListener("click", (event) => openPage(event, link));
  const before = fault.before && fault.before.thrust_n !== null ? `, at ${fault.before.thrust_n.toFixed(1)} N` : "";
  const when = fault.since ? `${new Date(fault.since).toLocaleString()}${before}: ` : "";
  item.append(link, document.createElement("br"), when + fault.help);
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
  const takeover = Boolean(state && state.lease);
  if (takeover && !confirm(`Take command from “${state.lease.holder}”? The thruster goes to rest, and they are told.`)) return;
  const of = thruster, granted = await call("POST", `${base()}/lease`, { holder: $("holder").value, ttl_ms: lease_ttl_ms, takeover });
  if (thruster === of) { lease = granted.lease_id; taken_ms = performance.now(); } else held.set(of, granted.lease_id);
  log(`lease of ${of} taken as “${$("holder").value}”`);
});
click("give", async () => { // forgotten before the answer comes: what is being given up is not renewed
  const given = call("DELETE", `${base()}/lease`);
  lease = null;
  await given; log("lease given up");
});
// The lease that could not be renewed is gone, not one that was taken or chosen meanwhile.
setInterval(() => { const sent = lease; if (sent) call("PUT", `${base()}/lease`).catch(() => { if (lease === sent) lease = null; }); }, RENEW_EVERY_MS);

click("arm", async () => { await call("POST", `${base()}/arm`); log("armed"); });
const disarm = async () => { await call("POST", `${base()}/disarm`); log("disarmed"); };
click("disarm", disarm);
// STOP goes out by every way there is, and says whether a servo confirmed it.
let stopping = null, unconfirmed_ms = null, stopped_ms = null;
function stopConfirmed(by) {
  if (!stopping) return;
  clearTimeout(stopping); stopping = null; stopped_ms = performance.now();
  $("stop-text").className = "good"; $("stop-text").textContent = "Stopped: confirmed.";
  log(`stop confirmed by ${by}`);
}
// A stop that nobody confirmed is an alarm until every thruster is seen disarmed, in a state that came after it.
const seenStates = () => (fleet.size ? [...fleet.values()] : [{ state, heard_ms }]);
function seenDisarmed() {
  if (unconfirmed_ms === null) return;
  if (!seenStates().every((one) => one.state && !one.state.armed && one.heard_ms > unconfirmed_ms && one.state.age_s !== null && one.state.age_s < STALE_MS / 1000)) return;
  unconfirmed_ms = null; stopped_ms = performance.now();
  $("stop-text").className = "good"; $("stop-text").textContent = "Disarmed: the live state says so. The stop itself was not confirmed.";
  log("the live state says disarmed; the stop was not confirmed");
}
// What was stopped is said until a thruster is armed again, in a state that was not under way when it stopped.
function seenArmed() {
  if (stopped_ms === null || !seenStates().some((one) => one.state?.armed && one.heard_ms > stopped_ms + 1000)) return;
  stopped_ms = null; $("stop-text").textContent = "";
}
function stopAll() {
  clearTimeout(stopping); unconfirmed_ms = null; stopped_ms = null;
  $("stop-text").className = "bad"; $("stop-text").textContent = "Stop sent, not confirmed yet.";
  stopping = setTimeout(() => {
    stopping = null; unconfirmed_ms = performance.now();
    $("stop-text").textContent = "STOP IS NOT CONFIRMED: the gateway or a servo does not answer. Cut the supply if the shaft turns.";
    log("stop is not confirmed", true);
  }, 1500);
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ stop: true }));
  call("POST", "/v1/stop").then((answer) => stopConfirmed(answer.stopped.join(", "))).catch(() => {});
}
$("stop").addEventListener("click", stopAll);
document.addEventListener("keydown", (event) => { if (event.key === "Escape") stopAll(); });
click("clear", async () => { await call("POST", `${base()}/clear-faults`); log("faults cleared"); });

const kind = () => document.querySelector("input[name=kind]:checked").value;
const send = async (value) => {
  if (isStale()) { log("nothing is sent while the values shown are old", true); return; }
  const of = thruster, applied = await call("PUT", `${base()}/setpoint`, { [kind()]: value });
  if (thruster === of) { $("entry").value = value; $("slider").value = value; }
  return applied;
};
click("send", async () => {
  if ($("entry").value === "") { log("nothing is sent: the setpoint is no number", true); return; }
  const value = Number($("entry").value), of = thruster; await send(value); log(`setpoint of ${of}: ${kind()} = ${value}`);
});
click("zero-button", async () => { $("entry").value = 0; $("slider").value = 0; await send(0); log("setpoint zero"); });
$("entry").addEventListener("keydown", (event) => { if (event.key === "Enter") $("send").click(); });
// The slider proposes, Send (or Enter) commands: a key such as End must not mean full thrust by itself.
$("slider").addEventListener("input", () => { $("entry").value = $("slider").value; });
$("slider").addEventListener("keydown", (event) => { if (event.key === "Enter") $("send").click(); });
$("entry").addEventListener("input", () => { $("slider").value = $("entry").value; });
document.querySelectorAll("input[name=kind]").forEach((radio) => radio.addEventListener("change", showKind));
// What is in force when the page begins is what it proposes.
function proposeInForce() {
  const named = Object.keys(state.setpoint ?? {})[0], radio = document.querySelector(`input[name=kind][value=${named}]`);
  if (radio) radio.checked = true;
  showKind();
}
function showKind() {
  showBounds();
  const now = state?.setpoint?.[kind()] ?? 0;
  $("slider").value = now; $("entry").value = now;
}
function showBounds() {
  const bound = limitsOf?.[kind()] ?? 100;
  $("unit").textContent = kind() === "thrust_n" ? "N" : "rad/s";
  const step = bound > 20 ? 0.5 : 0.01, end = Math.floor(bound / step) * step; // steps count from min: zero must be one
  $("slider").min = -end; $("slider").max = end; $("slider").step = step;
  $("entry").min = -bound; $("entry").max = bound;
  $("slider").value = $("entry").value;
}

let lawChanges = 0; // an answer asked for before a change was made shows what was before
async function loadController() {
  const of = thruster, asked = lawChanges, answer = await call("GET", `${base()}/controller`);
  if (thruster !== of) return;
  if (lawChanges !== asked) return loadController();
  $("controller").dataset.running = answer.controller;
  for (const [id, names, chosen] of [["controller", answer.available, answer.controller], ["observer", answer.observers, answer.observer], ["estimator", answer.estimators, answer.estimator]]) {
    $(id).replaceChildren(...names.map((name) => new Option(name, name, false, name === chosen)));
  }
  $("law-parameters").replaceChildren(...answer.parameters.map((p) => {
    const range = `${p.low} to ${p.high}`;
    const entry = Object.assign(document.createElement("input"), { type: "number", step: "any", value: p.value, min: p.low, max: p.high, ariaLabel: `${p.name} in ${p.unit}, ${range}` });
    entry.addEventListener("change", () => { // an emptied field is no zero
      if (entry.value === "") { entry.value = p.value; return; }
      const value = Number(entry.value);
      lawChanges += 1;
      call("PUT", `${base()}/controller`, { parameters: { [p.name]: value } })
        .then(() => { lawChanges += 1; p.value = value; log(`${p.name} = ${value}${p.unit === "1" ? "" : ` ${p.unit}`}`); }).catch(() => { entry.value = p.value; });
    });
    const small = Object.assign(document.createElement("small"), { textContent: range });
    return cells([[p.name, document.createElement("br"), small], entry, p.unit]);
  }));
}
click("switch", async () => {
  const answer = await call("PUT", `${base()}/controller`, { controller: $("controller").value, observer: $("observer").value, estimator: $("estimator").value });
  log(`control law ${answer.controller}, observer ${answer.observer}, estimator ${answer.estimator}`);
});
// Tuned values go to a file and come from one: the same that kort.toml and kort soak take.
click("controller-save", async () => {
  const answer = await fetch(`${base()}/controller/file`, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
  if (!answer.ok) { log(`controller file: ${(await answer.json()).detail ?? answer.status}`, true); return; }
  const name = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "")?.[1] ?? `${thruster}-controller.toml`;
  save(name, await answer.blob()); log(`controller saved as ${name}`);
});
$("controller-load").addEventListener("click", () => $("controller-file").click());
$("controller-file").addEventListener("change", async () => {
  const file = $("controller-file").files[0];
  if (!file) return;
  $("controller-file").value = "";
  await call("PUT", `${base()}/controller/file`, { toml: await file.text() })
    .then((answer) => { log(`${file.name} is in force: ${answer.controller}`); setTimeout(() => loadController().catch(() => {}), 500); }).catch(() => {});
});

// Event log ------------------------------------------------------------------------------------------------
let lastEvent = 0, eventsComing = null;
// One request at a time: two on their way at once would both bring what came since the last.
function loadEvents() { return (eventsComing ??= newEvents().finally(() => { eventsComing = null; })); }
async function newEvents() {
  const events = await call("GET", `/v1/events?limit=100${lastEvent ? `&since=${lastEvent}` : ""}`); // the newest first, then those after them
  for (const event of events) {
    if (event.id <= lastEvent) continue; // shown already
    lastEvent = event.id;
    const item = document.createElement("li");
    item.textContent = `${new Date(event.time).toLocaleTimeString()}  ${event.thruster ?? "all"}  ${event.detail}`;
    if (["tripped", "fault_inherited", "process_ended", "process_hung", "recording_ended"].includes(event.kind)) item.className = "bad";
    $("events").prepend(item);
  }
  while ($("events").children.length > 200) $("events").lastChild.remove();
}
setInterval(() => { if (!document.hidden && !isStale()) loadEvents().catch(() => {}); }, 1000);

click("pause", async () => {
  paused_s = paused_s === null && state ? state.time_s : null;
  $("pause").textContent = paused_s === null ? "Pause plots" : "Go on";
});
$("thruster").addEventListener("change", () => choose($("thruster").value));
async function choose(id) {
  if (lease) held.set(thruster, lease); // what one commands goes on while one looks at another
  thruster = id; lease = held.get(id) ?? null; taken_ms = performance.now(); held.delete(id);
  disconnect(); state = null; live.clear(); // nothing that is still under way of the one before is shown, or proposed, as this one's
  limitsOf = null; // nobody's, until the thruster told its own: a signal is not previewed within another's
  connect();
  const { range } = await call("GET", base());
  if (thruster !== id) return; // another was chosen meanwhile
  limitsOf = range; showBounds(); showFields();
  loadHistory().catch(() => {}); await loadController();
}
$("login").addEventListener("submit", (event) => {
  event.preventDefault();
  token = $("token").value.trim();
  sessionStorage.setItem("kort-token", token);
  location.reload();
});
async function start() {
  $("tiles").replaceChildren(...TILES.map(([name, unit]) => {
    const tile = document.createElement("div");
    tile.className = "tile"; tile.innerHTML = `<span></span><b><i style="font-style:normal">–</i> <small></small></b>`;
    tile.querySelector("span").textContent = name; tile.querySelector("small").textContent = unit;
    return tile;
  }));
  const list = await call("GET", "/v1/thrusters");
  $("thruster").replaceChildren(...list.map((item) => new Option(item.id, item.id)));
  showFleet(list.map((item) => item.id));
  loadRecordings().catch(() => {});
  await choose(list[0].id);
  show();
}

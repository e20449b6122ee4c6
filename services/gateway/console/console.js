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

// What was refused is told where it is seen wherever one has scrolled to, until one does the next thing.
function refused(words) { log(words, true); says("refused-text", words); }
const forget = (event) => { if (event.target.closest?.("button, select, input, a")) says("refused-text", ""); };
for (const kind of ["click", "change"]) document.addEventListener(kind, forget, true); // before what is asked for next is answered
$("refused-close").addEventListener("click", () => says("refused-text", ""));
const says = (id, words) => { if ($(id).textContent !== words) $(id).textContent = words; }; // read aloud when it changes

// One request; a problem document becomes a line in the log (unless it is told elsewhere) and a thrown error. What the page itself
// looks up all the time is no request of the operator: of that the log alone tells.
async function call(method, path, body, quiet, leaseId = lease) {
  const headers = {}, tell = method === "GET" ? (words) => log(words, true) : refused, sent_ms = Date.now();
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (leaseId) headers["Lease-Id"] = leaseId;
  if (token) headers.Authorization = `Bearer ${token}`;
  let answer;
  try {
    const signal = AbortSignal.timeout(WAIT_MS);
    answer = await fetch(path, { method, headers, signal, body: body === undefined ? undefined : JSON.stringify(body) });
  } catch (error) {
    tell(`${method} ${path}: the gateway does not answer`);
    throw error;
  }
  heardDate(answer.headers.get("date"), sent_ms);
  if (answer.status === 204) return null;
  if (answer.status === 401) askToken();
  const answered = await answer.json();
  if (!answer.ok) {
    if (!quiet) tell(`${answered.title}: ${answered.detail}${answered.hint ? ` (hint: ${answered.hint})` : ""}`);
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
  if (!answer.ok) { refused(`${link.textContent}: ${answer.status}`); return; }
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
      refused(`${next.title}: ${next.detail}`);
      if (next.type === "urn:kort:problem:lease-lost") lease = null;
      return;
    }
    const first = !state;
    state = next; heard_ms = performance.now(); heardTime(state);
    if (first) proposeInForce();
    record(state);
  };
  socket.onclose = () => setTimeout(connect, 1000);
}

function record(s) {
  const { parameters, ...est } = s.estimated;
  const estimates = [...Object.entries(est).map(([name, v]) => [`estimated_${name}`, "", v]),
    ...parameters.flatMap((p) => [...(p.name in est ? [] : [[`estimated_${p.name}`, p.unit, p.value]]), [`estimated_${p.name}${DOUBT}`, p.unit, p.std_error]]),
    ...(s.mismatch?.paths ?? []).map(({ path, level }) => [`mismatch_${path}`, LEVEL, level]),
    ...(s.mismatch?.residuals ?? []).map(({ residual, share }) => [`residual_${residual}`, "1", share])];
  const before_s = live.t[live.t.length - 1];
  if (s.time_s - before_s > HOLE_S) loadHistory(before_s, s.time_s).catch(() => {});
  // What is commanded is what the controller asks for now, within its slew, as the gateway keeps it and as recordings and the service's
  // own judgement of a revision have it: no setpoint that is still to be reached.
  live.push(s.time_s, { ...s.measured, ...s.commanded, ...estimatesRow(estimates) });
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
  $("time").textContent = `servo time ${s.time_s.toFixed(2)} s${clock.zero_ms === null || run ? "" : `, ${clockAt(s.time_s)}`}`;
  chip("armed", !fresh ? `${s.armed ? "armed" : "disarmed"} when last heard` : s.armed ? "armed" : "disarmed", s.armed && fresh ? "warn" : "");
  $("arm").disabled = s.armed || !fresh || !lease; $("disarm").disabled = false;

  const mine = lease && s.lease;
  // A state that was on its way when the lease was granted does not know of it.
  if (lease && !s.lease && heard_ms > taken_ms + 500) { lease = null; refused("the lease ran out"); }
  $("lease-text").textContent = !s.lease ? "Nobody has the lease."
    : mine ? "You have the lease." : `“${s.lease.holder}” has the lease.`;
  $("lease-bar").style.width = s.lease ? `${Math.min(100, s.lease.expires_in_ms / lease_ttl_ms * 100)}%` : "0";
  $("take").textContent = s.lease && !mine ? "Take over" : "Take lease";
  $("take").disabled = Boolean(mine) || !fresh; $("give").disabled = !lease;
  if (limitsOf && (limitsOf.thrust_n !== s.range.thrust_n || limitsOf.speed_rad_s !== s.range.speed_rad_s)) { limitsOf = s.range; showBounds(); } // another rig
  $("setpoint-text").textContent = `in force: ${Object.entries(s.setpoint).map(([name, value]) => `${name} = ${value.toFixed(2)}`).join(", ")}`
    + (!lease ? " — take the lease to change it" : !s.armed ? " — arm to change it" : "");

  if (!lease && !entered && ![$("entry"), $("slider")].includes(document.activeElement)) followInForce();

  $("fault-chip").hidden = s.faults.length === 0;
  chip("fault-chip", s.faults.length === 1 ? "1 fault" : `${s.faults.length} faults`, "bad");
  const faults = JSON.stringify(s.faults);
  if ($("faults").dataset.shown !== faults) { // read aloud when it changes, not ten times a second
    $("faults").dataset.shown = faults;
    $("faults").replaceChildren(...(s.faults.length ? s.faults.map(faultItem) : [none("No fault is latched.")]));
  }
  $("limits").textContent = s.limits.length ? `limit in force: ${s.limits.map((limit) => limit.name ?? limit).join(", ")}` : "No limit is in force.";
  if (s.controller && document.activeElement !== $("controller") && $("controller").dataset.running !== runningLaw(s)) loadController().catch(() => {});
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
  const byStream = socket && socket.readyState === WebSocket.OPEN;
  stopsSent.push({ at_ms: gatewayNow(), ways: byStream ? 2 : 1, told: 0 });
  $("stop-text").className = "bad"; $("stop-text").textContent = "Stop sent, not confirmed yet.";
  stopping = setTimeout(() => {
    stopping = null; unconfirmed_ms = performance.now();
    $("stop-text").textContent = "STOP IS NOT CONFIRMED: the gateway or a servo does not answer. Cut the supply if the shaft turns.";
    log("stop is not confirmed", true);
  }, 1500);
  if (byStream) socket.send(JSON.stringify({ stop: true }));
  call("POST", "/v1/stop").then((answer) => stopConfirmed(answer.stopped.join(", "))).catch(() => {});
}
$("stop").addEventListener("click", stopAll);
document.addEventListener("keydown", (event) => { if (event.key === "Escape") stopAll(); });
click("clear", async () => { await call("POST", `${base()}/clear-faults`); log("faults cleared"); });

const kind = () => document.querySelector("input[name=kind]:checked").value;
const send = async (value) => {
  if (isStale()) { refused("nothing is sent while the values shown are old"); return; }
  const of = thruster, applied = await call("PUT", `${base()}/setpoint`, { [kind()]: value }).catch((error) => { showRange(value); throw error; });
  if (thruster === of) { $("entry").value = value; $("slider").value = value; entered = false; showRange(); }
  return applied;
};
click("send", async () => {
  if ($("entry").value === "") { refused("nothing is sent: the setpoint is no number"); return; }
  const value = Number($("entry").value), of = thruster; await send(value); log(`setpoint of ${of}: ${kind()} = ${value}`);
});
click("zero-button", async () => { $("entry").value = 0; $("slider").value = 0; await send(0); log("setpoint zero"); });
$("entry").addEventListener("keydown", (event) => { if (event.key === "Enter") $("send").click(); });
// The slider proposes, Send (or Enter) commands: a key such as End must not mean full thrust by itself.
let entered = false; // something that was not sent yet: it stays
$("slider").addEventListener("input", () => { entered = true; $("entry").value = $("slider").value; showRange(); });
$("slider").addEventListener("keydown", (event) => { if (event.key === "Enter") $("send").click(); });
$("entry").addEventListener("input", () => { entered = true; $("slider").value = $("entry").value; showRange(); });
document.querySelectorAll("input[name=kind]").forEach((radio) => radio.addEventListener("change", () => { entered = true; showKind(); }));
// What is in force when the page begins is what it proposes.
function proposeInForce() {
  const named = Object.keys(state.setpoint ?? {})[0], radio = document.querySelector(`input[name=kind][value=${named}]`);
  if (radio) radio.checked = true;
  showKind();
}
// A page that does not command goes on to show what is in force, until something is entered.
function followInForce() { if (Number($("entry").value) !== inForce() || !(kind() in state.setpoint)) proposeInForce(); }
const inForce = () => Number((state?.setpoint?.[kind()] ?? 0).toFixed(2)); // the field shows no more digits
function showKind() {
  showBounds();
  $("slider").value = inForce(); $("entry").value = inForce();
}
function showBounds() {
  const bound = limitsOf?.[kind()] ?? 100;
  $("unit").textContent = kind() === "thrust_n" ? "N" : "rad/s";
  const step = bound > 20 ? 0.5 : 0.01, end = Math.floor(bound / step) * step; // steps count from min: zero must be one
  $("slider").min = -end; $("slider").max = end; $("slider").step = step;
  $("entry").min = -bound; $("entry").max = bound;
  $("slider").value = $("entry").value;
  showRange();
}
// The range stands beside the entry; louder where the setpoint that was sent is beyond it.
function showRange(sent = 0) {
  const bound = limitsOf?.[kind()], beyond = Math.abs(sent) > bound;
  says("range-text", bound === undefined ? "" : `${beyond ? "refused: " : ""}allowed is −${bound} to ${bound} ${$("unit").textContent}`);
  $("range-text").className = beyond ? "warn-text" : "quiet"; $("entry").setAttribute("aria-invalid", String(beyond));
}

// Event log ------------------------------------------------------------------------------------------------
let lastEvent = 0, eventsComing = null;
// A stop of this page goes out by two ways, and the service tells of each: shown is one of the two.
const stopsSent = [], STOP_TOLD_MS = 3000;
function isTold(event) {
  const of = event.kind === "stopped" && stopsSent.find((stop) => stop.told < stop.ways && Math.abs(Date.parse(event.time) - stop.at_ms) < STOP_TOLD_MS && (stop.who ??= event.who) === event.who);
  return Boolean(of) && ++of.told > 1;
}
// One request at a time: two on their way at once would both bring what came since the last.
function loadEvents() { return (eventsComing ??= newEvents().finally(() => { eventsComing = null; })); }
async function newEvents() {
  const events = await call("GET", `/v1/events?limit=100${lastEvent ? `&since=${lastEvent}` : ""}`); // the newest first, then those after them
  for (const event of events) {
    if (event.id <= lastEvent) continue; // shown already
    lastEvent = event.id;
    seenRevision(event);
    if (isTold(event)) continue;
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
$("login").addEventListener("submit", (event) => {
  event.preventDefault();
  token = $("token").value.trim();
  sessionStorage.setItem("kort-token", token);
  location.reload();
});
// How high the line that stays on top is: what is scrolled to stands below it.
new ResizeObserver(([header]) => document.documentElement.style.setProperty("--head", `${header.target.offsetHeight}px`)).observe(document.querySelector("header"));
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

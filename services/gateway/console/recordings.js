"use strict";
// Recordings over the plots: one played back, or two compared; live again at a click.
let run = null; // { a, b, names, at_s, playing, difference }, of two runs also what is drawn of them: { lines }

async function fetchRun(name) {
  const asked = async (what) => {
    const answer = await fetch(`/v1/recordings/${encodeURIComponent(name)}${what}`, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
    if (!answer.ok) { log(`recording ${name}: ${(await answer.json()).detail ?? answer.status}`, true); throw new Error(name); }
    return answer;
  };
  const answer = await asked("?format=csv");
  const [head, ...rows] = (await answer.text()).split("\n").filter((line) => line), names = head.trim().split(",");
  const columns = new Columns(), every = Math.max(1, Math.ceil(rows.length / LIVE_POINTS));
  const estimated = estimatesAt(await (await asked("/estimates")).json());
  // Of rows that are left out the values that stand in no other are kept: what is sampled seldom is not lost.
  let zero = null, row = {};
  rows.forEach((line, i) => {
    line.trim().split(",").forEach((cell, k) => { if (cell !== "") row[names[k]] = Number(cell); });
    if ((i + 1) % every) return;
    zero ??= row.time_s;
    columns.push(row.time_s - zero, { ...row, ...estimated(row.time_s) });
    row = {};
  });
  columns.done = true;
  return columns;
}
const lengthOf = (columns) => columns?.t.at(-1) ?? 0, endOf = ({ a, b }) => Math.max(lengthOf(a), lengthOf(b));
function showRun(next) {
  run = next && { ...next, lines: next.b && side(next.a, next.b) }; zoomTo(null, null);
  $("run").hidden = !run;
  document.body.classList.toggle("past", Boolean(run));
  if (!run) return;
  const told = (columns, name) => { const error = columns.rms("thrust_error_n"); return `${name} (${lengthOf(columns).toFixed(1)} s${error === null ? "" : `, thrust error ${error.toFixed(2)} N rms`})`; };
  says("run-text", run.b ? `A: ${told(run.a, run.names[0])} · B, dashed: ${told(run.b, run.names[1])}` : `Not live: ${told(run.a, run.names[0])}`);
  $("run-at").max = endOf(run); $("run-at").value = 0; $("difference").checked = false;
  $("difference").parentElement.hidden = !run.b; $("run-play").textContent = "Play";
}
async function replay(name) { showRun({ a: await fetchRun(name), b: null, names: [name], at_s: null, playing: null, difference: false }); }
async function compare(name) {
  if (!run) { log("show a recording first, then compare another with it", true); return; }
  showRun({ ...run, b: await fetchRun(name), names: [run.names[0], name], at_s: null, playing: null, difference: false });
}
// What the plots show now, and between which instants if nothing is zoomed.
function wholeNow() {
  const span_s = Number($("span").value);
  if (!run) {
    const end_s = paused_s ?? (state ? state.time_s + (isStale() ? 0 : Math.min(0.2, (performance.now() - heard_ms) / 1000)) : 0);
    return [{ a: live, b: null, difference: false }, end_s - span_s, end_s];
  }
  if (run.playing) {
    run.at_s = Math.min(endOf(run), run.playing.from_s + (performance.now() - run.playing.at_ms) / 1000 * Number($("run-speed").value));
    $("run-at").value = run.at_s;
    if (run.at_s >= endOf(run)) stopRun();
  }
  const window_s = run.at_s === null ? [0, Math.max(endOf(run), 0.1)] : [run.at_s - span_s, run.at_s];
  return [{ ...run, ...run.lines }, ...window_s];
}
function shownNow() {
  const [source, ...whole_s] = wholeNow();
  return [source, ...(zoomed ?? whole_s)];
}
function stopRun() { run.playing = null; $("run-play").textContent = "Play"; }
$("run-play").addEventListener("click", () => {
  if (run.playing) { stopRun(); return; }
  const from_s = run.at_s === null || run.at_s >= endOf(run) ? 0 : run.at_s;
  zoomTo(null, null);
  run.playing = { from_s, at_ms: performance.now() }; $("run-play").textContent = "Halt";
});
$("run-speed").addEventListener("change", () => { if (run?.playing) run.playing = { from_s: run.at_s, at_ms: performance.now() }; });
$("run-at").addEventListener("input", () => { stopRun(); run.at_s = Number($("run-at").value); });
$("difference").addEventListener("change", () => { run.difference = $("difference").checked; });
$("run-whole").addEventListener("click", () => { stopRun(); run.at_s = null; zoomTo(null, null); });
$("run-live").addEventListener("click", () => showRun(null));

// The tools of the plots.
$("zoom-out").addEventListener("click", () => zoomTo(null, null));
$("fix-y").addEventListener("change", () => charts.forEach((chart) => chart.fix($("fix-y").checked)));
$("save-csv").addEventListener("click", () => { const [source, from_s, to_s] = shownNow(); save(`${thruster}-plots.csv`, new Blob([tableOf(source, from_s, to_s)], { type: "text/csv" })); });
$("save-png").addEventListener("click", async () => save(`${thruster}-plots.png`, await pictureOf(shownNow()[0])));
function showPicker() {
  document.querySelector(".plots").append(...charts.map((chart) => chart.figure).filter((figure) => !figure.isConnected));
  $("signals").replaceChildren(...charts.map((chart) => {
    const group = document.createElement("fieldset"), legend = document.createElement("legend");
    legend.textContent = `${chart.title} [${chart.unit}]`;
    group.append(legend, ...chart.signals.map(([name, , words]) => {
      const label = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox", checked: shownSignals.has(name), id: `show-${name}` });
      box.addEventListener("change", () => { if (box.checked) shownSignals.add(name); else shownSignals.delete(name); });
      label.append(box, ` ${words}`);
      return label;
    }));
    return group;
  }));
}
showPicker();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { charts.forEach((chart) => { if (chart.plot) chart.build(); }); preview(); });

// What the gateway has kept: with it the plots begin, and a hole that a lost connection left is filled.
async function loadHistory(from_s, to_s) {
  const of = thruster, last_s = from_s === undefined ? 600 : Math.min(600, Math.ceil(state.time_s - from_s) + 2);
  const kept = await call("GET", `${base()}/history?last_s=${last_s}&hz=25`), part = new Columns(), names = Object.keys(kept.columns);
  if (of !== thruster) return;
  const until_s = to_s ?? live.t[0] ?? Infinity, estimated = estimatesAt(kept.estimates);
  kept.time_s.forEach((t, i) => { if (t > (from_s ?? -Infinity) && t < until_s) part.push(t, { ...Object.fromEntries(names.map((name) => [name, kept.columns[name][i]])), ...estimated(t) }); });
  const place = lowerBound(live.t, until_s);
  for (const name in part.c) live.of(name);
  live.t.splice(place, 0, ...part.t);
  for (const name in live.c) live.c[name].splice(place, 0, ...part.of(name));
}

"use strict";
// Recordings over the plots: one played back, or two compared; live again at a click.
let run = null; // { a, b, names, at_s, playing, difference }, of one its time on the wall: { zero_ms }, of two what is drawn of them: { lines }

async function fetchRun(name) {
  const asked = async (what) => {
    const answer = await fetch(`/v1/recordings/${encodeURIComponent(name)}${what}`, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
    if (!answer.ok) { refused(`recording ${name}: ${(await answer.json()).detail ?? answer.status}`); throw new Error(name); }
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
  tellRun();
  $("run-at").max = endOf(run); $("run-at").value = 0; $("difference").checked = false;
  $("difference").parentElement.hidden = !run.b; $("run-play").textContent = "Play";
}
// What the plots show, as it is drawn now.
function tellRun() {
  const told = (columns, name) => { const error = columns.rms("thrust_error_n"); return `${name} (${lengthOf(columns).toFixed(1)} s${error === null ? "" : `, thrust error ${error.toFixed(2)} N rms`})`; };
  const [a, b] = [told(run.a, run.names[0]), run.b && told(run.b, run.names[1])];
  const words = !b ? `Not live: ${a}` : run.difference ? `B − A: ${b} less ${a}` : `A: ${a} · B, dash-dotted and in colours of its own: ${b}`;
  says("run-text", `${words}${run.words ? `. ${run.words}` : ""}`);
}
async function replay(name) {
  const [a, { started }] = await Promise.all([fetchRun(name), call("GET", `/v1/recordings`).then((list) => list.find((item) => item.name === name) ?? {})]);
  showRun({ a, b: null, names: [name], at_s: null, playing: null, difference: false, zero_ms: started ? Date.parse(started) : null });
}
async function compare(name) {
  if (!run) { refused("show a recording first, then compare another with it"); return; }
  showRun({ ...run, words: "", b: await fetchRun(name), names: [run.names[0], name], at_s: null, playing: null, difference: false });
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
$("difference").addEventListener("change", () => { run.difference = $("difference").checked; tellRun(); });
$("run-whole").addEventListener("click", () => { stopRun(); run.at_s = null; zoomTo(null, null); });
$("run-live").addEventListener("click", () => showRun(null));

// The tools of the plots.
$("zoom-out").addEventListener("click", () => zoomTo(null, null));
$("fix-y").addEventListener("change", () => charts.forEach((chart) => chart.fix($("fix-y").checked)));
$("save-csv").addEventListener("click", () => { const [source, from_s, to_s] = shownNow(); save(`${namedBy(from_s)}.csv`, new Blob([tableOf(source, from_s, to_s)], { type: "text/csv" })); });
$("save-png").addEventListener("click", async () => { const shown = shownNow(); save(`${namedBy(shown[1])}.png`, await pictureOf(...shown)); });
// What is shown, as a table and as a picture.
function save(name, blob) {
  const url = URL.createObjectURL(blob);
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
// A saved file says in its name when it was that it begins, in universal time: its rows count the servo's seconds.
function namedBy(from_s) {
  const zero_ms = wallZero(), at = zero_ms === null ? "" : `-${new Date(zero_ms + 1000 * from_s).toISOString().replace(/[-:]|\.\d+/g, "")}`;
  return `${thruster}-plots${at}`;
}
function tableOf({ a, b, difference, less }, from_s, to_s) {
  const names = SIGNALS.map(([name]) => name).filter((name) => shownSignals.has(name));
  const parts = [["", a, names], ...(b ? [["b_", b, names]] : []), ...(difference ? [["difference_", less, names.filter((name) => !isSide(name))]] : [])];
  const rows = [["time_s", ...parts.flatMap(([before, , theirs]) => theirs.map((name) => `${before}${name}`))].join(",")];
  for (let i = lowerBound(a.t, from_s); i < a.t.length && a.t[i] <= to_s; i += 1) {
    rows.push([a.t[i], ...parts.flatMap(([, of, theirs]) => theirs.map((name) => of.of(name)[i]))].map((v) => v ?? "").join(","));
  }
  return `${rows.join("\n")}\n`;
}
// Words one after the other in lines of this width: [words, hue, left, line].
function inLines(pen, words, width, edge, gap) {
  let left = edge, line = 0;
  return words.map(([said, hue]) => {
    const wide = pen.measureText(said).width;
    if (left > edge && left + wide > width - edge) { left = edge; line += 1; }
    const placed = [said, hue, left, line];
    left += wide + gap;
    return placed;
  });
}
function pictureOf({ b, difference }, from_s, to_s) {
  const times = [from_s, to_s].map((t) => clockAt(t)).filter((words) => words), of = `${!b ? "" : difference ? ", B − A" : ""}${times.length ? `, ${times.join(" to ")}` : ""}`, scale = window.devicePixelRatio || 1, line = 20 * scale;
  const sheet = document.createElement("canvas"), pen = sheet.getContext("2d"), css = getComputedStyle(document.documentElement);
  const font = `${13 * scale}px system-ui, sans-serif`, shown = charts.filter((chart) => !chart.figure.hidden && chart.plot);
  pen.font = font;
  const parts = shown.map((chart) => {
    const { canvas } = chart.plot.ctx, signals = chart.signals.filter(([name]) => shownSignals.has(name) && !(difference && isSide(name)));
    const words = inLines(pen, [[`${chart.title} [${chart.unit}]${of}`, "--ink"], ...signals.flatMap(([, , label, hue]) => [...(difference ? [] : [[label, hue]]), ...(b ? [[`${label}, ${difference ? "B − A" : "B"}`, `${hue}-b`]] : [])])], canvas.width, 6 * scale, 12 * scale);
    return { canvas, words, above: (words.at(-1)[3] + 1) * line + 4 * scale };
  });
  sheet.width = Math.max(...parts.map((part) => part.canvas.width)); sheet.height = parts.reduce((sum, part) => sum + part.above + part.canvas.height, 0);
  pen.fillStyle = css.getPropertyValue("--card"); pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.font = font; // a canvas that is sized begins anew
  let top = 0;
  for (const { canvas, words, above } of parts) {
    for (const [said, hue, left, row] of words) { pen.fillStyle = css.getPropertyValue(hue); pen.fillText(said, left, top + row * line + 16 * scale); }
    pen.drawImage(canvas, 0, top + above);
    top += above + canvas.height;
  }
  return new Promise((done) => sheet.toBlob(done, "image/png"));
}
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

// Rows that the gateway has kept, of those instants that `within` takes once they are here; with what was estimated then.
async function rowsKept(last_s, hz, within) {
  const kept = await call("GET", `${base()}/history?last_s=${last_s}&hz=${hz}`), part = new Columns(), names = Object.keys(kept.columns), estimated = estimatesAt(kept.estimates);
  kept.time_s.forEach((t, i) => { if (within(t)) part.push(t, { ...Object.fromEntries(names.map((name) => [name, kept.columns[name][i]])), ...estimated(t) }); });
  return part;
}
// With them the plots begin, and a hole that a lost connection left is filled.
async function loadHistory(from_s, to_s) {
  const of = thruster, last_s = from_s === undefined ? 600 : Math.min(600, Math.ceil(state.time_s - from_s) + 2), until = () => to_s ?? live.t[0] ?? Infinity;
  const part = await rowsKept(last_s, 25, (t) => of === thruster && t > (from_s ?? -Infinity) && t < until());
  if (of === thruster) live.insert(lowerBound(live.t, until()), part);
}

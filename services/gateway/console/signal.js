"use strict";
// Test signals: composed here, previewed and played by the gateway's own code.
const KINDS = { // kind: [words, fields with their first values, segments made of them]
  steps: ["step", { level: 30, each_s: 3 }, (v) => [{ kind: "steps", values: [0, v.level, 0], each_s: v.each_s }]],
  staircase: ["staircase", { from: 0, to: 60, levels: 7, each_s: 2 }], ramp: ["ramp", { from: 0, to: 60, duration_s: 20 }],
  sine: ["sine", { mean: 30, amplitude: 15, frequency_hz: 0.2, duration_s: 30 }],
  chirp: ["chirp", { mean: 30, amplitude: 15, from_hz: 0.05, to_hz: 2, duration_s: 60 }],
  multisine: ["multisine", { mean: 30, amplitude: 20, from_hz: 0.05, to_hz: 2, tones: 15, duration_s: 60 }],
  prbs: ["PRBS", { mean: 30, amplitude: 20, each_s: 0.5, order: 9, duration_s: 30 }],
  random_levels: ["random levels", { low: -40, high: 60, shortest_s: 0.5, longest_s: 4, duration_s: 60 }],
  reversals: ["reversals", { amplitude: 40, each_s: 3, count: 3 }],
};
const unitOf = (field) => (field.endsWith("_s") ? "s" : field.endsWith("_hz") ? "Hz" : ["levels", "count", "tones", "order"].includes(field) ? "" : $("signal-of").value === "thrust_n" ? "N" : "rad/s");
// First values are for a thruster that gives 60 N or 60 rad/s; one that does not begins with three fifths of its range.
const scale = () => { const bound = limitsOf?.[$("signal-of").value] ?? 60; return bound < 60 ? 0.6 * bound / 60 : 1; };
const firstOf = (name, first) => (["N", "rad/s"].includes(unitOf(name)) ? Number((first * scale()).toPrecision(3)) : first);
// What the operator set as the limit stays, whatever is chosen beside it; only a smaller range brings it down. Emptied it is nobody's.
let limitPut = $("signal-limit").value, limitSet = false;
function showLimit() {
  const entry = $("signal-limit"), bound = limitsOf?.[$("signal-of").value];
  limitSet = entry.value !== "" && (limitSet || entry.value !== limitPut);
  if (!limitSet) entry.value = firstOf("limit", 60);
  else if (Number(entry.value) > bound) entry.value = bound;
  limitPut = entry.value; $("signal-limit-unit").textContent = unitOf("limit");
}
const PREVIEW_HEIGHT = 120;
let previewPlot = null, previewed = 0, scenario = null; // the chosen file: its name and text

function showFields() {
  const kind = $("signal-kind").value, fields = KINDS[kind]?.[1] ?? {};
  $("signal-fields").replaceChildren(...Object.entries(fields).map(([name, first]) => {
    const label = document.createElement("label"), entry = Object.assign(document.createElement("input"), { type: "number", step: "any", value: firstOf(name, first), id: `signal-${name}` });
    entry.addEventListener("input", preview);
    label.append(`${name.replace(/_(s|hz)$/, "").replaceAll("_", " ")} `, entry, ` ${unitOf(name)}`);
    return label;
  }));
  showLimit();
  $("signal-file").hidden = kind !== "file"; $("signal-of").disabled = kind === "experiment" || kind === "file";
  preview();
}
function asked() {
  const kind = $("signal-kind").value, limit = $("signal-limit").value === "" ? {} : { limit: Number($("signal-limit").value) };
  if (kind === "file") return scenario && { toml: scenario.text, ...limit };
  if (kind === "experiment") return proposed ? { diagnosis: proposed, ...limit } : null;
  const entries = Object.keys(KINDS[kind][1]).map((name) => [name, $(`signal-${name}`).value]);
  if (entries.some(([, value]) => value === "")) return null; // an emptied field is no zero
  const values = Object.fromEntries(entries.map(([name, value]) => [name, Number(value)]));
  return { command: $("signal-of").value, segments: KINDS[kind][2]?.(values) ?? [{ kind, ...values }], ...limit };
}
let waiting = null;
// Until its course is shown nothing is played.
function preview() { $("play").dataset.ready = ""; clearTimeout(waiting); waiting = setTimeout(() => showPreview().catch(() => {}), 250); }
async function showPreview() {
  const body = asked(), mine = ++previewed;
  if (!limitsOf) return; // showFields asks again once they are there
  if (!body || !thruster) { noSignal("quiet", { file: "Choose a scenario file.", experiment: "There is no diagnosis that proposes an experiment." }[$("signal-kind").value] ?? "A field is empty: every one needs a number."); return; }
  let would;
  try { would = await call("POST", `${base()}/excitation?dry_run=true`, body, true); } catch (error) { if (mine === previewed) noSignal("warn-text", error.message); return; }
  if (mine !== previewed) return;
  const unit = would.command === "thrust_n" ? "N" : "rad/s";
  const from = $("signal-kind").value === "file" ? `${scenario.name}: ` : "";
  says("signal-text", `${from}${would.name}: ${would.duration_s.toFixed(1)} s, up to ${would.peak.toFixed(1)} ${unit}, limit ${would.limit} ${unit}.${would.left_out.length ? ` The thruster brings its own ${would.left_out.join(", ")}.` : ""}`);
  $("signal-text").className = "quiet";
  $("play").dataset.ready = "yes";
  const css = getComputedStyle(document.documentElement), color = (name) => css.getPropertyValue(name).trim();
  const axis = { stroke: color("--quiet"), grid: { stroke: color("--grid"), width: 1 }, ticks: { show: false } };
  previewPlot?.destroy();
  previewPlot = new uPlot({ width: Math.max(200, $("signal-plot").clientWidth), height: PREVIEW_HEIGHT, legend: { show: false }, cursor: { show: false }, scales: { x: { time: false } },
    axes: [{ ...axis, size: 26, values: (_, ticks) => ticks.map((t) => `${t} s`) }, { ...axis, size: 46 }], series: [{}, { stroke: color("--blue"), width: 1.5, points: { show: false } }] },
    [would.preview.map(([t]) => t), would.preview.map(([, v]) => v)], $("signal-plot"));
  $("signal-plot").setAttribute("aria-label", `course of the signal: ${would.name}, ${would.duration_s.toFixed(1)} s, up to ${would.peak.toFixed(1)} ${unit}`);
}
new ResizeObserver(([{ contentRect: { width } }]) => { if (previewPlot && width > 0 && width !== previewPlot.width) previewPlot.setSize({ width, height: PREVIEW_HEIGHT }); }).observe($("signal-plot"));
function noSignal(kind, words) {
  previewPlot?.destroy(); previewPlot = null;
  $("signal-plot").setAttribute("aria-label", "no course to show");
  $("signal-text").className = kind; says("signal-text", words);
}

async function play(body) {
  const begun = await call("POST", `${base()}/excitation`, body);
  log(`${begun.name} plays for ${begun.duration_s.toFixed(1)} s${begun.recording ? `, recorded as ${begun.recording}` : ""}`);
}
click("play", async () => {
  const name = $("signal-record").value.trim();
  await play({ ...asked(), ...(name ? { record: name } : {}), ...($("signal-diagnose").checked ? { diagnose: true } : {}) });
});
click("signal-end", async () => { await call("DELETE", `${base()}/excitation`); log("test signal ended"); });

let playedBefore = null;
setInterval(() => {
  if (!state) return;
  const at = state.excitation;
  $("play").disabled = isStale() || !lease || !state.armed || Boolean(at) || !$("play").dataset.ready;
  $("experiment").disabled = isStale() || !lease || !state.armed || Boolean(at) || !proposed;
  $("signal-end").disabled = !at;
  $("signal-bar").style.width = at ? `${Math.min(100, 100 * at.elapsed_s / at.duration_s)}%` : "0";
  says("signal-at", at ? `${at.name} plays: ${Math.floor(at.elapsed_s)} of ${at.duration_s.toFixed(0)} s.` : !lease ? "Take the lease and arm to play it." : !state.armed ? "Arm to play it." : "");
  if (playedBefore && !at) call("GET", `${base()}/excitation`).then((last) => log(last.ended_by ? `${last.name} ended: ${last.ended_by}` : `${last.name} is complete`)).catch(() => {});
  playedBefore = at;
}, 200);
$("signal-kind").replaceChildren(...Object.entries(KINDS).map(([kind, [words]]) => new Option(words, kind)), new Option("scenario file…", "file"), new Option("experiment of the diagnosis", "experiment"));
$("signal-kind").value = "staircase";
$("signal-kind").addEventListener("change", showFields);
$("signal-of").addEventListener("change", showFields);
$("signal-limit").addEventListener("input", () => { limitSet = true; preview(); });
$("signal-file").addEventListener("change", async () => {
  const file = $("signal-file").files[0];
  if (!file) return;
  $("signal-file").value = ""; // the same file, changed meanwhile, can be chosen again
  scenario = { name: file.name, text: await file.text() }; preview();
});

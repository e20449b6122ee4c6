"use strict";
// Diagnosis: path lights, what the model left out, use it, go back, and what that did to the thrust.
const LOOK_EVERY_MS = 2000, SETTLE_S = 5, ERROR_SPAN_S = 60;
let found = null, revised = null, proposed = null; // the newest diagnosis of this thruster; when which revision came, by this page

const diagnosesOf = () => `${base()}/diagnoses`;
const says = (id, words) => { if ($(id).textContent !== words) $(id).textContent = words; }; // read aloud when it changes
const percent = (share) => (share === null || share === undefined ? "–" : `${Math.round(100 * share)} %`);

// A light for each path, green only where all is within 5 % of the rig: no change since the start is no agreement. Ten times a second
// with the state it would be read aloud ten times.
function showPaths(mismatch) {
  const doubted = (mismatch?.paths ?? []).filter((path) => path.level >= 0.5);
  const words = !mismatch ? "The controller is away."
    : mismatch.alarm ? `The ${mismatch.alarm} path has changed since ${new Date(Date.now() - 1000 * mismatch.since_s).toLocaleTimeString()}.`
    : mismatch.paths.some((path) => path.level === null) ? "What is usual is being learnt; it takes some minutes of driving."
    : doubted.length ? `The ${doubted.map((path) => `${path.path} path (${Math.round(10 * path.level) * 10} %)`).join(" and the ")} may have changed: at 100 % it is said to have.`
    : "No path has changed since it was learnt what is usual.";
  says("mismatch-text", words);
  says("agreement-text", agreement(mismatch));
  const kinds = (mismatch ? mismatch.paths : []).map((path) =>
    [path.path, path.level === null ? "" : mismatch.alarm === path.path || path.level >= 1 ? "bad" : path.level >= 0.5 ? "warn" : mismatch.agrees ? "good" : ""]);
  const shown = JSON.stringify(kinds);
  if ($("paths").dataset.shown === shown) return;
  $("paths").dataset.shown = shown;
  $("paths").replaceChildren(...kinds.map(([name, kind]) => Object.assign(document.createElement("span"), { className: `chip ${kind}`, textContent: name })));
}

// How far all is off the rig as stated, whether it was so from the start or not.
const RESIDUALS = { current: "current", torque: "torque", thrust: "thrust", flow: "flow", thrust_at_rest: "thrust at rest (of the largest)", current_late: "current that comes late (of the largest)" };
function agreement(mismatch) {
  if (!mismatch || mismatch.agrees === null) return "";
  if (mismatch.agrees) return "In the last minute of driving all that is measured was within 5 % of the rig description.";
  const off = mismatch.residuals.filter(({ share }) => share !== null && Math.abs(share) > 0.05).sort((a, b) => Math.abs(b.share) - Math.abs(a.share));
  const each = off.map(({ residual, share }) => `${RESIDUALS[residual]} ${percent(Math.abs(share))} ${share > 0 ? "above" : "below"}`);
  return `In the last minute of driving the thruster was off its rig description: ${each.join(", ")}. A diagnosis says of what.`;
}

function showDiagnosis() {
  if (!state) return;
  showPaths(state.mismatch);
  const running = state.diagnosis;
  if (running) says("diagnosis-text", `${running.step}, ${running.elapsed_s.toFixed(0)} s so far`);
  $("diagnose").disabled = Boolean(running ?? state.fit) || isStale(); // there is one at a time of diagnoses and fits together
  $("diagnosis-cancel").disabled = !(running ?? state.fit);
  $("use").disabled = !found || !found.usable || found.rig_revision !== state.rig_revision || isStale();
  showError();
}
setInterval(showDiagnosis, 200);

async function loadDiagnosis() {
  if (!thruster || !state) return;
  const of = thruster, [list, rig] = await Promise.all([call("GET", diagnosesOf()), call("GET", `${base()}/rig`)]);
  if (thruster !== of) return; // another was chosen meanwhile: these are not its
  const newest = list.at(-1) ?? null;
  found = list.findLast((item) => item.state === "done") ?? newest; // what ended otherwise takes nothing away
  $("back").disabled = rig.before === null || isStale();
  says("rig-text", `In force: revision ${rig.number} of the rig, from ${rig.source}${rig.note ? ` (${rig.note})` : ""}.`);
  if (!found || found.state === "running") return;
  const ended = newest.state === "done" || newest.state === "running" ? "" : `${newest.id}: ${newest.state}${newest.cause ? `, ${newest.cause}` : ""}`;
  const shown = `${found.id} ${found.state} ${ended}`;
  if ($("findings").dataset.shown === shown) return;
  $("findings").dataset.shown = shown;
  says("diagnosis-text", found.state !== "done" ? ended : ended ? `${ended}. ${found.id}: ${found.summary}` : found.summary);
  $("findings").replaceChildren(...found.findings.map((f) =>
    cells([f.effect.replaceAll("_", " "), f.path, f.probability.toFixed(2), percent(f.excess_error_removed), f.statement])));
  const link = Object.assign(document.createElement("a"), { href: `${diagnosesOf()}/${found.id}/report`, target: "_blank", textContent: `report of ${found.id}` });
  link.addEventListener("click", (event) => openPage(event, link));
  const place = Object.assign(document.createElement("button"), { textContent: "Show it here", onclick: () => placePage(link).catch(() => {}) });
  $("report").replaceChildren(...(found.state === "done" ? [link, " ", place] : []));
  $("page").hidden = true;
  const report = found.state === "done" ? (await call("GET", `${diagnosesOf()}/${found.id}`)).report : null;
  if (thruster !== of) return;
  proposed = report?.next_experiment ? found.id : null;
  says("next-text", proposed ? `Next experiment: ${report.next_experiment.excitation}, to part ${report.next_experiment.separates.join(" from ").replaceAll("_", " ")}. ${report.next_experiment.why}` : "");
}
// The report in place: without scripts, in a frame of its own.
async function placePage(link) {
  if (!$("page").hidden) { $("page").hidden = true; return; }
  const answer = await fetch(link.href, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
  if (!answer.ok) { log(`${link.textContent}: ${answer.status}`, true); return; }
  $("page").srcdoc = await answer.text(); $("page").hidden = false;
}
click("experiment", async () => {
  const limit = $("signal-limit").value === "" ? {} : { limit: Number($("signal-limit").value) }, body = { diagnosis: proposed, ...limit };
  const would = await call("POST", `${base()}/excitation?dry_run=true`, body);
  const unit = would.command === "thrust_n" ? "N" : "rad/s";
  if (!confirm(`Play ${would.name} on ${thruster} for ${would.duration_s.toFixed(0)} s, up to ${would.peak.toFixed(1)} ${unit}? It is recorded and diagnosed together with ${proposed}.`)) return;
  await play(body);
});
// Thrust error in the minute before the revision and since, one over the other.
click("overlay", async () => {
  shownSignals.add("thrust_error_n"); $("show-thrust_error_n").checked = true;
  const zero_s = revised.time_s, before = live.cut(zero_s - ERROR_SPAN_S, zero_s, zero_s - ERROR_SPAN_S), since = live.cut(zero_s + SETTLE_S, zero_s + SETTLE_S + ERROR_SPAN_S, zero_s + SETTLE_S);
  showRun({ a: before, b: since, names: ["the minute before", `since revision ${revised.number}`], at_s: null, playing: null, difference: false });
});
setInterval(() => { if (!document.hidden) loadDiagnosis().catch(() => {}); }, LOOK_EVERY_MS);

// What is asked for: of which rows, by which model, with which effects taken as known. Diagnose and Fit take the same.
const WITH_MAX = 8;
const knownEffects = () => [...document.querySelectorAll("#known-effects input:checked")].map((box) => box.value);
function analysisOf() {
  const of = $("diagnosis-of").value, subject = of.startsWith("recording ") ? { recording: of.slice(10) } : { last_s: Number(of) };
  return { ...subject, model: $("analysis-model").value, with: knownEffects() };
}
function showKnown() {
  const known = knownEffects();
  $("known-text").textContent = known.length ? known.join(", ").replaceAll("_", " ") : "nothing beyond the rig description";
  for (const box of document.querySelectorAll("#known-effects input")) box.disabled = !box.checked && known.length >= WITH_MAX;
}
$("known-effects").addEventListener("change", showKnown);
click("diagnose", async () => {
  const begun = await call("POST", diagnosesOf(), analysisOf());
  log(`diagnosis ${begun.id} began, of ${begun.of}`);
});
click("diagnosis-cancel", async () => {
  const [what, running, kept] = state.diagnosis ? ["diagnosis", state.diagnosis, diagnosesOf()] : ["fit", state.fit, fitsOf()];
  if (running) { await call("DELETE", `${kept}/${running.id}`); log(`${what} cancelled`); }
});

const value = (v) => (v === null ? "nothing" : typeof v === "object" && "value" in v ? `${v.value} (± ${percent(v.tol)})` : v === true ? "there" : String(v));
const lines = (difference) => difference.map((change) => `${change.key}: ${value(change.before)} → ${value(change.after)}`);
const unused = (answer) => answer.unused_effects.map(({ effect, why }) => `${effect} is used by no law and no observer: ${why}`);
const toAgree = (would) => `Put this in force on ${thruster}, also while it drives?\n\n${[...lines(would.difference), ...unused(would)].join("\n")}`;
async function adopt(wanted) {
  const would = await call("POST", `${base()}/rig?dry_run=true`, wanted);
  if (!confirm(toAgree(would))) return;
  came(await call("POST", `${base()}/rig`, wanted));
}
click("use", () => adopt({ diagnosis: found.id }));
const goBack = async () => came(await call("POST", `${base()}/rig/rollback`));
click("back", goBack);
click("worse-back", goBack);
function came(answer) {
  revised = { time_s: state.time_s, number: answer.in_force.number };
  log(`revision ${answer.in_force.number} of the rig is in force: ${[...lines(answer.difference), ...unused(answer)].join(", ")}`);
  loadDiagnosis().catch(() => {});
}

// What the service finds of the thrust error before a revision and since, under like commands; the way back is offered
// at the top of the page too.
function showError() {
  $("overlay").disabled = !revised || revised.time_s > state.time_s;
  const trial = state.revision_trial;
  $("worse").hidden = !trial?.larger;
  $("worse-back").disabled = !trial?.larger || trial.before === null || isStale();
  if (!trial) { says("error-text", ""); return; }
  const told = (n) => (n === null ? "not known yet" : `${n.toFixed(2)} N rms`);
  const errors = `${told(trial.before_rms_n)} before revision ${trial.revision}, ${told(trial.since_rms_n)} since`;
  says("error-text", `Thrust error under like commands (${trial.compared_s} s of them): ${errors}.`);
  if (trial.larger) says("worse-text", `The thrust error is larger since revision ${trial.revision} of the rig: ${errors}.`);
  $("error-text").className = trial.larger ? "warn-text" : "quiet";
}

// What can be diagnosed or fitted: the last minutes, or a recording that is done.
async function offer() {
  const of = thruster, list = (await call("GET", "/v1/recordings")).filter((item) => item.thruster === of && item.state !== "recording");
  if (thruster !== of) return;
  const options = [["60", "last minute"], ["300", "last 5 minutes"], ["600", "last 10 minutes"], ...list.map((item) => [`recording ${item.name}`, item.name])];
  const shown = JSON.stringify(options), select = $("diagnosis-of");
  if (select.dataset.shown === shown || document.activeElement === select) return;
  const chosen = select.dataset.shown ? select.value : "300";
  select.dataset.shown = shown;
  select.replaceChildren(...options.map(([name, words]) => new Option(words, name, false, name === chosen)));
}
setInterval(() => { if (!document.hidden && thruster) offer().catch(() => {}); }, 5000);
setTimeout(() => { if (thruster) { offer().catch(() => {}); loadDiagnosis().catch(() => {}); } }, 500);
$("thruster").addEventListener("change", () => {
  found = null; revised = null; proposed = null; $("page").hidden = true;
  for (const id of ["findings", "diagnosis-of"]) delete $(id).dataset.shown;
  $("findings").replaceChildren(); $("report").replaceChildren(); says("diagnosis-text", ""); says("next-text", ""); says("rig-text", "");
  for (const box of document.querySelectorAll("#known-effects input")) box.checked = false; // what is known of one is not of another
  showKnown();
  offer().catch(() => {});
});

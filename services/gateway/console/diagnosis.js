"use strict";
// Diagnosis: path lights, what the model left out, earlier ones, use it, go back, and what that did to the thrust.
const LOOK_EVERY_MS = 2000, SETTLE_S = 5, BEFORE_S = 1, ERROR_SPAN_S = 60;
let found = null, proposed = null, earlier = null; // the diagnosis that is shown: the newest, or an earlier one that was opened, and the newest then

const diagnosesOf = () => `${base()}/diagnoses`;
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
  const last = list.findLast((item) => item.state === "done") ?? newest; // what ended otherwise takes nothing away
  if (earlier && earlier.newest !== newest?.id) earlier = null; // another was begun since
  found = list.find((item) => item.id === earlier?.id) ?? last;
  $("back").disabled = rig.before === null || isStale();
  says("rig-text", `In force: revision ${rig.number} of the rig, from ${rig.source}${rig.note ? ` (${rig.note})` : ""}.`);
  showEarlier(list);
  if (!found || found.state === "running") return;
  const ended = found !== last || newest.state === "done" || newest.state === "running" ? "" : endingOf(newest);
  const shown = `${found.id} ${found.state} ${ended} ${found === last}`;
  if ($("findings").dataset.shown === shown) return;
  const report = found.state === "done" ? (await call("GET", `${diagnosesOf()}/${found.id}`)).report : null;
  if (thruster !== of) return;
  $("findings").dataset.shown = shown;
  const summary = found === last ? found.summary : `Of ${whenOf(found)}, an earlier one: ${found.summary}`;
  says("diagnosis-text", found.state !== "done" ? endingOf(found) : ended ? `${ended}. ${found.id}: ${summary}` : summary);
  $("findings").replaceChildren(...found.findings.map((f) =>
    cells([f.effect.replaceAll("_", " "), f.path, f.probability.toFixed(2), percent(f.excess_error_removed), sizesOf(report, f.effect), f.not_adopted ? `${f.statement} Use leaves it out: ${f.not_adopted}.` : f.statement])));
  const link = Object.assign(document.createElement("a"), { href: `${diagnosesOf()}/${found.id}/report`, target: "_blank", textContent: `report of ${found.id}` });
  link.addEventListener("click", (event) => openPage(event, link));
  const place = Object.assign(document.createElement("button"), { textContent: "Show it here", onclick: () => placePage(link).catch(() => {}) });
  $("report").replaceChildren(...(found.state === "done" ? [link, " ", place] : []));
  $("page").hidden = true;
  proposed = report?.next_experiment ? found.id : null;
  says("next-text", proposed ? `Next experiment: ${report.next_experiment.excitation}, to part ${report.next_experiment.separates.join(" from ").replaceAll("_", " ")}. ${report.next_experiment.why}` : "");
}
const endingOf = (item) => `${item.id}: ${item.state}${item.cause ? `, ${item.cause}` : ""}`;
const whenOf = (item) => (item.started ? new Date(item.started).toLocaleString() : item.id);
// How large what was found is, a line each: with unit and standard error.
function sizesOf(report, effect) {
  const parameters = report?.findings?.find((one) => one.effect === effect)?.parameters ?? [];
  return parameters.flatMap((p, i) => [...(i ? [document.createElement("br")] : []),
    `${plainName(p.name, p.unit)} ${`${withDoubt(p.value, p.std_error)}${p.unit === "1" ? "" : ` ${p.unit}`}`.replaceAll(" ", "\u00a0")}${p.at_bound ? ", at the edge of what is allowed" : ""}`]);
}
// Every diagnosis that is kept, newest first: each is opened where the newest stands.
function showEarlier(list) {
  const told = list.filter((item) => item.state !== "running").reverse().map((item) => {
    const names = item.findings.map((f) => `${f.effect.replaceAll("_", " ")} (${f.probability.toFixed(2)})`).join(", ");
    return [item.id, whenOf(item), item.of ?? "", item.state !== "done" ? endingOf(item).slice(item.id.length + 2) : [item.verdict?.replaceAll("_", " "), names].filter((words) => words).join(": "), item.state === "done", item.id === found?.id];
  });
  $("earlier").hidden = told.length === 0; $("earlier-text").textContent = `all diagnoses (${told.length})`;
  const shown = JSON.stringify(told);
  if ($("earlier-list").dataset.shown === shown || $("earlier-list").contains(document.activeElement)) return; // nothing is taken away from under the finger
  $("earlier-list").dataset.shown = shown;
  $("earlier-list").replaceChildren(...told.map(([id, when, of, words, done, here]) => {
    const open = Object.assign(document.createElement("button"), { textContent: here ? "shown" : "Open", disabled: here, ariaLabel: `open ${id}`, onclick: (event) => { event.target.blur(); earlier = { id, newest: list.at(-1).id }; loadDiagnosis().catch(() => {}); } });
    return cells([when, of, words, done ? open : ""]);
  }));
}
// The report in place: without scripts, in a frame of its own.
async function placePage(link) {
  if (!$("page").hidden) { $("page").hidden = true; return; }
  const answer = await fetch(link.href, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
  if (!answer.ok) { refused(`${link.textContent}: ${answer.status}`); return; }
  $("page").srcdoc = await answer.text(); $("page").hidden = false;
}
click("experiment", async () => {
  const limit = $("signal-limit").value === "" ? {} : { limit: Number($("signal-limit").value) }, body = { diagnosis: proposed, ...limit };
  const would = await call("POST", `${base()}/excitation?dry_run=true`, body);
  const unit = would.command === "thrust_n" ? "N" : "rad/s";
  if (!confirm(`Play ${would.name} on ${thruster} for ${would.duration_s.toFixed(0)} s, up to ${would.peak.toFixed(1)} ${unit}? It is recorded and diagnosed together with ${proposed}.`)) return;
  await play(body);
});
// When a thruster's rig was revised last: the service's events tell it, to a page that was opened later too. What the gateway does by
// itself, handing a revision to a controller that began anew, is no other revision.
const revisions = new Map();
function seenRevision({ kind, thruster: of, who, time }) {
  if (["rig_changed", "rig_rolled_back"].includes(kind) && who !== "gateway") revisions.set(of, Math.max(Date.parse(time), revisions.get(of) ?? 0));
}
let lookedFor = null; // it may be longer ago than the events that the page began with
function revisedAt() {
  if (!revisions.has(thruster) && state.revision_trial && lookedFor !== thruster) {
    lookedFor = thruster;
    call("GET", "/v1/events?limit=5000").then((events) => events.forEach(seenRevision)).catch(() => {});
  }
  return revisions.has(thruster) ? servoAt(revisions.get(thruster)) : null;
}
// The minute before the revision and the minute since, as far as they are at hand.
function beforeAndSince() {
  const at_s = revisedAt();
  if (at_s === null || !state.revision_trial) return null;
  const parts = [[at_s - BEFORE_S - ERROR_SPAN_S, at_s - BEFORE_S], [at_s + SETTLE_S, at_s + SETTLE_S + ERROR_SPAN_S]];
  return parts.every(([from_s, to_s]) => (live.t.at(-1) ?? -Infinity) > from_s + 2 && live.t[0] < to_s - 2) ? parts : null;
}
// Thrust error before and since, one over the other, of every row that the gateway keeps, as recordings have them: with a state at each
// tick of a slow controller one always sees the same moment of its period. What the service finds under like commands stands beside it.
click("overlay", async () => {
  const of = thruster, parts = beforeAndSince();
  if (!parts) return;
  const first_s = parts[0][0], end_s = parts[1][1], last_s = Math.ceil(state.time_s - first_s) + 1;
  const rows = await rowsKept(last_s, 100, (t) => t >= first_s && t <= end_s).catch(() => live);
  if (thruster !== of) return;
  shownSignals.add("thrust_error_n"); $("show-thrust_error_n").checked = true;
  const [a, b] = parts.map(([from_s, to_s]) => rows.cut(from_s, to_s, from_s)), { revision } = state.revision_trial;
  showRun({ a, b, names: ["the minute before", `since revision ${revision}`], at_s: null, playing: null, difference: false, words: trialWords(state.revision_trial) });
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
  log(`revision ${answer.in_force.number} of the rig is in force: ${[...lines(answer.difference), ...unused(answer)].join(", ")}`);
  loadDiagnosis().catch(() => {});
}

// What the service finds of the thrust error before a revision and since, under like commands; the way back is offered
// at the top of the page too.
function showError() {
  $("overlay").disabled = !beforeAndSince();
  const trial = state.revision_trial;
  $("worse").hidden = !trial?.larger;
  $("worse-back").disabled = !trial?.larger || trial.before === null || isStale();
  says("error-text", trial ? trialWords(trial) : "");
  if (trial?.larger) says("worse-text", `The thrust error is larger since revision ${trial.revision} of the rig${isCompared(trial) ? `: ${errorsOf(trial)}` : ""}.`);
  $("error-text").className = trial?.larger ? "warn-text" : "quiet";
}
const errorsOf = (trial) => `${trial.before_rms_n.toFixed(2)} N rms before revision ${trial.revision}, ${trial.since_rms_n.toFixed(2)} N rms since`;
const isCompared = (trial) => trial.before_rms_n !== null && trial.since_rms_n !== null;
function trialWords(trial) {
  if (isCompared(trial)) return `Thrust error under like commands (${trial.compared_s} s of them): ${errorsOf(trial)}.`;
  return `Whether the thrust error is another since revision ${trial.revision} is not judged: ${trial.not_judged}.`;
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
  found = null; earlier = null; proposed = null; $("page").hidden = true;
  for (const id of ["findings", "earlier-list", "diagnosis-of"]) delete $(id).dataset.shown;
  $("findings").replaceChildren(); $("earlier-list").replaceChildren(); $("earlier").hidden = true; $("report").replaceChildren(); says("diagnosis-text", ""); says("next-text", ""); says("rig-text", "");
  for (const box of document.querySelectorAll("#known-effects input")) box.checked = false; // what is known of one is not of another
  showKnown();
  offer().catch(() => {});
});

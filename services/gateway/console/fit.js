"use strict";
// Fit: the model's parameters from the last minutes or a recording, beside what the rig description states; use them.
let fitted = null; // the newest fit of this thruster that is done, else the newest
// When a channel was read, and over how long: the fit's own aids, that are in no rig description and in no model.
const AIDS = ["sampling_delay_s", "averaging_s"];
// A fit leaves more than noise of a channel beyond so many times the noise, and is off by a size that matters beyond this share of full scale.
const FAR = 3, SMALL = 0.01;
const fitsOf = () => `${base()}/fits`;

function showFit() {
  if (!state) return;
  const running = state.fit;
  if (running) says("fit-text", `Fit: ${running.step}`); // its seconds stand beside it: read aloud each would drown the rest
  says("fit-time", running ? `${running.elapsed_s.toFixed(0)} s so far` : "");
  $("fit").disabled = Boolean(state.diagnosis ?? state.fit) || isStale();
  $("use-fit").disabled = !fitted?.usable || fitted.rig_revision !== state.rig_revision || isStale();
}
setInterval(showFit, 200);

// A value with as many decimals as its doubt has two digits of.
function withDoubt(value, doubt) {
  if (value === null) return "–";
  if (!doubt) return String(Number(value.toPrecision(4)));
  const decimals = Math.max(0, 1 - Math.floor(Math.log10(doubt)));
  return decimals > 7 ? `${value.toExponential(3)} ± ${doubt.toExponential(1)}` : `${value.toFixed(decimals)} ± ${doubt.toFixed(decimals)}`;
}
const digits2 = (share) => (share === null ? "–" : `${Number((100 * share).toPrecision(2))} %`);
const statedOf = ({ stated, stated_tol }) => (stated === null ? "–" : `${Number(stated.toPrecision(4))}${stated_tol === null ? "" : ` ± ${digits2(stated_tol)}`}`);
const breakable = (words) => words.split(/(?<=_)/).flatMap((part, i) => (i ? [document.createElement("wbr"), part] : [part])); // a long one begins a line anew behind an underscore
const rowsOf = (id, rows) => $(id).replaceChildren(...rows.map(cells));

async function loadFit() {
  if (!thruster || !state) return;
  const of = thruster, list = await call("GET", fitsOf());
  if (thruster !== of) return; // another was chosen meanwhile: these are not its
  const newest = list.at(-1) ?? null;
  fitted = list.findLast((item) => item.state === "done") ?? newest; // what ended otherwise takes nothing away
  if (fitted) fitted.not_identifiable = (fitted.not_identifiable ?? []).map((group) => ({ ...group, parameters: group.parameters.filter((name) => !AIDS.includes(name)) })).filter((group) => group.parameters.length);
  if (!fitted || fitted.state === "running") return;
  const ended = newest.state === "done" || newest.state === "running" ? "" : `${newest.id}: ${newest.state}${newest.cause ? `, ${newest.cause}` : ""}`;
  const shown = `${fitted.id} ${fitted.state} ${ended}`;
  if ($("fitted").dataset.shown === shown) return;
  $("fitted").dataset.shown = shown;
  const open = fitted.not_identifiable.flatMap((group) => group.parameters);
  const done = `${fitted.id}: ${fitted.parameters.length} values of ${fitted.model} fitted to ${fitted.of}.${open.length ? ` It cannot fix ${open.join(", ")}.` : ""}${fitted.lossy ? " Some of its rows were left out." : ""}`;
  says("fit-text", fitted.state !== "done" ? ended : ended ? `${ended}. ${done}` : done);
  $("fitted-of").textContent = `values of ${fitted.model}: what revision ${fitted.rig_number} of the rig states with its tolerance (two sigma), and what was fitted with its standard error`;
  rowsOf("fitted", fitted.parameters.map((p) => [breakable(p.effect ? `${p.name} of ${p.effect}` : p.name), statedOf(p), `${withDoubt(p.value, p.std_error)}${p.at_bound ? ", at the edge of what is allowed" : ""}`, p.unit]));
  says("fit-warning", leftOver(fitted));
  rowsOf("heldout", fitted.heldout.map((left) => [breakable(left.channel), digits2(left.nrmse), digits2(left.noise_floor), left.white ? "noise" : "structure"]));
  rowsOf("fit-open", fitted.not_identifiable.map((group) => [breakable(group.parameters.join(", ")), group.why, group.excitation]));
  const item = (words, className) => Object.assign(document.createElement("li"), { textContent: words.replaceAll(/\S*\/(?=[^/\s]+\.mcap)/g, ""), className }); // where a file lies here is the gateway's matter
  $("fit-notes").replaceChildren(...fitted.symptoms.map((words) => item(words, "warn-text")), ...fitted.notes.map((words) => item(words, "quiet")));
}
// Values that were fitted to a model of the wrong form stand in for what it lacks: said where they are put in force.
function leftOver({ heldout, usable }) {
  const far = heldout.filter((left) => !left.white && left.nrmse > Math.max(SMALL, FAR * left.noise_floor) && left.noise_floor > 0).sort((a, b) => b.nrmse / b.noise_floor - a.nrmse / a.noise_floor);
  if (!far.length || !usable) return "";
  const each = far.map((left) => `${plainName(left.channel, CHANNEL_UNITS[left.channel])} ${digits2(left.nrmse)} of full scale, ${Math.round(left.nrmse / left.noise_floor)} times its noise`);
  return `This fit leaves far more than noise: ${each.join("; ")}. The model lacks something that no value of these mends; diagnose it before you use them.`;
}
const CHANNEL_UNITS = Object.fromEntries(SIGNALS.map(([name, unit]) => [name, unit]));
setInterval(() => { if (!document.hidden) loadFit().catch(() => {}); }, LOOK_EVERY_MS);
setTimeout(() => loadFit().catch(() => {}), 500);

click("fit", async () => {
  const begun = await call("POST", fitsOf(), analysisOf());
  log(`fit ${begun.id} began, of ${begun.of}`);
});
click("use-fit", () => adopt({ fit: fitted.id }));
$("thruster").addEventListener("change", () => {
  fitted = null; delete $("fitted").dataset.shown;
  for (const id of ["fitted", "heldout", "fit-open", "fit-notes"]) $(id).replaceChildren();
  says("fit-text", ""); says("fit-warning", "");
});

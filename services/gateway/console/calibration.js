"use strict";
// Calibration: begun under the lease, each stage said and agreed to, aborted, its rig put in force.
let calibrated = null; // the newest calibration of this thruster
const calibrationsOf = () => `${base()}/calibrations`;

function showCalibration() {
  if (!state) return;
  const running = state.calibration;
  if (running) says("calibration-text", running.asks ? `${running.stage}: ${running.asks}` : `${running.stage.replaceAll("_", " ")}…`);
  $("calibrate").disabled = Boolean(running) || !lease || state.armed || isStale();
  $("calibration-go").disabled = !running?.asks || !lease || isStale();
  $("calibration-abort").disabled = !running;
  $("calibration-use").disabled = Boolean(running) || calibrated?.state !== "done" || isStale();
}
setInterval(showCalibration, 200);

async function loadCalibration() {
  if (!thruster || !state || state.calibration) return;
  const list = await call("GET", calibrationsOf());
  calibrated = list.length ? list[list.length - 1] : null;
  const shown = calibrated ? `${calibrated.id} ${calibrated.state}` : "none";
  if (!calibrated || calibrated.state === "running" || $("calibration").dataset.shown === shown) return;
  $("calibration").dataset.shown = shown;
  says("calibration-text", `${calibrated.id}: ${calibrated.state}${calibrated.cause ? `, ${calibrated.cause}` : ""}`);
  const { report } = await call("GET", `${calibrationsOf()}/${calibrated.id}`);
  const known = (report?.steps ?? []).flatMap((step) => step.quantities.map((q) =>
    [step.name.replaceAll("_", " "), q.name.replaceAll("_", " "), `${q.value.toPrecision(4)} ± ${q.tolerance.toPrecision(2)} ${q.unit}`]));
  const rest = (report?.steps ?? []).flatMap((step) => step.skipped_because.map((why) => [step.name.replaceAll("_", " "), "left out", why]));
  $("calibration").replaceChildren(...[...known, ...rest].map(cells));
}
setInterval(() => { if (!document.hidden) loadCalibration().catch(() => {}); }, 2000);

click("calibrate", async () => {
  const begun = await call("POST", calibrationsOf(), { share: Number($("calibration-share").value) });
  log(`calibration ${begun.id} began: it asks before each stage`);
});
click("calibration-go", async () => {
  const { id, stage } = state.calibration;
  await call("POST", `${calibrationsOf()}/${id}/go-on`, { stage });
  log(`agreed to ${stage.replaceAll("_", " ")}`);
});
click("calibration-abort", async () => {
  if (state.calibration) { await call("DELETE", `${calibrationsOf()}/${state.calibration.id}`); log("calibration aborted"); }
});
click("calibration-use", async () => {
  const answer = await fetch(`${calibrationsOf()}/${calibrated.id}/rig`, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
  if (!answer.ok) { refused(`rig of ${calibrated.id}: ${answer.status}`); return; }
  await adopt({ toml: await answer.text(), note: `calibration ${calibrated.id}` });
});
$("thruster").addEventListener("change", () => {
  calibrated = null; delete $("calibration").dataset.shown; $("calibration").replaceChildren(); says("calibration-text", "");
});

"use strict";
// What is kept, and comes into force or over the plots again: the control law with its parameters and their file; recordings, begun,
// stopped, tagged, found by tag, fetched, shown.
let lawChanges = 0; // an answer asked for before a change was made shows what was before
async function loadController() {
  const of = thruster, asked = lawChanges, answer = await call("GET", `${base()}/controller`);
  if (thruster !== of) return;
  if (lawChanges !== asked) return loadController();
  $("controller").dataset.running = runningLaw(answer);
  for (const [id, names, chosen] of [["controller", answer.available, answer.controller], ["observer", answer.observers, answer.observer], ["estimator", answer.estimators, answer.estimator]]) {
    $(id).replaceChildren(...names.map((name) => new Option(name, name, false, name === chosen)));
  }
  const rows = answer.parameters.map((p) => [p.applies ?? applies(p.name, answer), tuningRow(p)]);
  for (const [id, wanted] of [["law-parameters", true], ["other-parameters", false]]) $(id).replaceChildren(...rows.filter(([used]) => used === wanted).map(([, row]) => row));
  showMeanings();
}
const runningLaw = ({ controller, observer, estimator }) => `${controller} ${observer} ${estimator}`;
// Which parameters do anything under what runs: as `Tunable::applies` of crates/control has it.
const OF_LAW = { thrust_pi: "thrust_pi", trim: "trimmed_model2_inversion", anti_spin: "combined_anti_spin", swirl: "rotational_flow_inversion", look_ahead: "look_ahead" };
const OF_OBSERVER = /^((ambient|load|blade_load)_(std|time)|(thrust|flow)_std)/;
function applies(name, { controller, observer, estimator }) {
  const own = Object.keys(OF_LAW).find((begin) => name.startsWith(begin));
  return own ? OF_LAW[own] === controller : name.startsWith("adaptation") ? estimator !== "off" : OF_OBSERVER.test(name) ? observer !== "open_loop" : true;
}
function tuningRow(p) {
  const range = `${p.low} to ${p.high}`;
  const entry = Object.assign(document.createElement("input"), { type: "number", step: "any", value: p.value, min: p.low, max: p.high, ariaLabel: `${p.name} in ${p.unit}, ${range}` });
  entry.addEventListener("change", () => { // an emptied field is no zero
    if (entry.value === "") { entry.value = p.value; return; }
    const value = Number(entry.value);
    lawChanges += 1;
    call("PUT", `${base()}/controller`, { parameters: { [p.name]: value } })
      .then(() => { lawChanges += 1; p.value = value; log(`${p.name} = ${value}${p.unit === "1" ? "" : ` ${p.unit}`}`); }).catch(() => { entry.value = p.value; });
  });
  const small = Object.assign(document.createElement("small"), { textContent: range }), what = Object.assign(document.createElement("small"), { id: `about-${p.name}`, className: "what" });
  what.dataset.name = p.name; entry.setAttribute("aria-describedby", what.id);
  return cells([[...breakable(p.name), document.createElement("br"), small, what], entry, p.unit === "1" ? "" : p.unit]);
}
// What each means stands in the description of the interface, which is long: it is asked for once, when the list is opened.
let meanings = null;
function showMeanings() {
  for (const what of document.querySelectorAll("#tuning .what")) what.textContent = meanings?.[what.dataset.name]?.description?.replace(/ Unit: .*$/, "") ?? "";
}
$("tuning").addEventListener("toggle", async () => {
  if (!$("tuning").open || meanings) return;
  meanings = (await call("GET", "/openapi.json").catch(() => null))?.components.schemas.ControllerRequest.properties.parameters.properties ?? null;
  showMeanings();
});
click("switch", async () => {
  const answer = await call("PUT", `${base()}/controller`, { controller: $("controller").value, observer: $("observer").value, estimator: $("estimator").value });
  log(`control law ${answer.controller}, observer ${answer.observer}, estimator ${answer.estimator}`);
});
// Tuned values go to a file and come from one: the same that kort.toml and kort soak take.
click("controller-save", async () => {
  const answer = await fetch(`${base()}/controller/file`, { headers: token ? { Authorization: `Bearer ${token}` } : {} });
  if (!answer.ok) { refused(`controller file: ${(await answer.json()).detail ?? answer.status}`); return; }
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

// Recordings ---------------------------------------------------------------------------------------------
let recording = null;
const tagsOf = (words) => [...new Set(words.split(/[\s,]+/).filter((word) => word))];

async function loadRecordings() {
  const list = await call("GET", "/v1/recordings");
  recording = list.find((item) => item.state === "recording" && item.thruster === thruster) ?? null;
  $("record").textContent = recording ? "Stop" : "Start";
  $("recording-text").textContent = recording ? `recording ${recording.name}: ${recording.rows} rows` : "";
  const wanted = tagsOf($("recording-filter").value), found = list.filter((item) => wanted.every((tag) => item.tags.includes(tag)));
  $("known-tags").replaceChildren(...[...new Set(list.flatMap((item) => item.tags))].sort().map((tag) => new Option(tag)));
  const shown = JSON.stringify(found);
  if ($("recordings").dataset.shown === shown || $("recordings").contains(document.activeElement)) return; // nothing is taken away from under the finger
  $("recordings").dataset.shown = shown;
  $("recordings").replaceChildren(...found.map((item) => cells([[item.name, tagsEntry(item)], String(item.rows), `${item.duration_s.toFixed(1)} s`,
    item.state === "recording" ? "" : [["show", replay], ["compare", compare]].map(([words, action]) =>
      Object.assign(document.createElement("button"), { textContent: words, ariaLabel: `${words} ${item.name}`, onclick: (event) => { event.target.blur(); action(item.name).catch(() => {}); } })),
    ["csv", "mcap", "parquet"].flatMap((format) => {
      const link = Object.assign(document.createElement("a"),
        { href: `/v1/recordings/${encodeURIComponent(item.name)}?format=${format}`, textContent: format, ariaLabel: `${item.name} as ${format}`, download: `${item.name}.${format}` });
      link.addEventListener("click", (event) => download(event, link));
      return [link, " "]; // a place to begin a new line
    })])));
}
function tagsEntry(item) {
  const entry = Object.assign(document.createElement("input"), { className: "tags", value: item.tags.join(" "), placeholder: "tags", ariaLabel: `tags of ${item.name}` });
  entry.addEventListener("change", async () => {
    const done = await call("PATCH", `/v1/recordings/${encodeURIComponent(item.name)}`, { tags: tagsOf(entry.value) }).catch(() => item);
    entry.value = done.tags.join(" ");
    if (done !== item) log(done.tags.length ? `recording ${item.name}: ${done.tags.join(", ")}` : `recording ${item.name} has no tags`);
  });
  entry.addEventListener("keydown", (event) => { if (event.key === "Enter") entry.blur(); });
  return entry;
}
click("record", async () => {
  if (recording) { const done = await call("DELETE", `/v1/recordings/${encodeURIComponent(recording.name)}`); log(`recording ${done.name} stopped, ${done.rows} rows`); } else {
    const name = $("recording-name").value.trim(), tags = tagsOf($("recording-tags").value);
    const started = await call("POST", "/v1/recordings", { thruster, tags, ...(name ? { name } : {}) });
    log(`recording ${started.name} started`);
  }
  await loadRecordings();
});
$("recording-filter").addEventListener("input", () => loadRecordings().catch(() => {}));
setInterval(() => { if (!document.hidden) loadRecordings().catch(() => {}); }, 2000);

// A link cannot carry the token: with one, the file is fetched and handed over.
async function download(event, link) {
  if (!token) return;
  event.preventDefault();
  const answer = await fetch(link.href, { headers: { Authorization: `Bearer ${token}` } });
  if (!answer.ok) { refused(`${link.download}: ${answer.status}`); return; }
  const url = URL.createObjectURL(await answer.blob());
  Object.assign(document.createElement("a"), { href: url, download: link.download }).click();
  URL.revokeObjectURL(url);
}

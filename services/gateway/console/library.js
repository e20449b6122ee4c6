"use strict";
// The list of recordings: begun, stopped, tagged, found by tag, fetched, shown over the plots.
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
  if (!answer.ok) { log(`${link.download}: ${answer.status}`, true); return; }
  const url = URL.createObjectURL(await answer.blob());
  Object.assign(document.createElement("a"), { href: url, download: link.download }).click();
  URL.revokeObjectURL(url);
}

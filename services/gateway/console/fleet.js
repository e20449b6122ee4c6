"use strict";
// Several thrusters side by side: what each does now, and which of them this page commands. What one commands goes on
// while one looks at another: its lease is renewed as long as this page lives.
const FLEET_HZ = 5, FLEET_SPAN_S = 60;
const held = new Map(); // leases of thrusters that are not the chosen one
const fleet = new Map();

function showFleet(ids) {
  $("fleet").hidden = ids.length < 2;
  if (ids.length < 2) return;
  for (const id of ids) fleet.set(id, new Mate(id));
  $("mates").replaceChildren(...[...fleet.values()].map((mate) => mate.card));
  setInterval(() => fleet.forEach((mate) => mate.show()), 200);
}

class Mate {
  constructor(id) {
    Object.assign(this, { id, state: null, heard_ms: 0, live: new Columns(), plot: null });
    this.card = document.createElement("section");
    const part = (kind, name) => { const made = Object.assign(document.createElement(kind), { className: name }); this[name] = made; return made; };
    const row = Object.assign(document.createElement("div"), { className: "row" });
    this.pick = Object.assign(document.createElement("button"), { textContent: id, ariaLabel: `choose ${id}`, onclick: () => { $("thruster").value = id; $("thruster").dispatchEvent(new Event("change")); } });
    row.append(this.pick, part("span", "link"), part("span", "armed"), part("span", "faults"));
    this.card.append(row, part("p", "values"), part("p", "by"), part("div", "course"));
    this.by.className = "quiet";
    this.course.setAttribute("role", "img");
    this.connect();
  }
  connect() {
    const stream = streamOf(this.id, FLEET_HZ);
    stream.onmessage = (message) => {
      const next = JSON.parse(message.data);
      if (!next.measured) return;
      this.state = next; this.heard_ms = performance.now();
      const cmd = next.setpoint?.thrust_n ?? next.commanded?.thrust_cmd_n;
      this.live.push(next.time_s, { thrust_cmd_n: cmd, thrust_n: next.measured.thrust_n ?? next.estimated.thrust_n });
    };
    stream.onclose = () => setTimeout(() => this.connect(), 1000);
  }
  show() {
    const s = this.state, old = !s || performance.now() - this.heard_ms > STALE_MS + 1000 / FLEET_HZ, mine = this.id === thruster ? lease : held.get(this.id);
    this.pick.setAttribute("aria-pressed", String(this.id === thruster));
    this.card.classList.toggle("old", old);
    const set = (element, words, kind) => { if (element.textContent !== words) element.textContent = words; const name = `chip ${kind}`; if (element.className !== name) element.className = name; element.hidden = !words; };
    set(this.link, old ? "old" : "", "bad");
    if (!s) return;
    set(this.armed, s.armed ? "armed" : "disarmed", s.armed && !old ? "warn" : "");
    set(this.faults, s.faults.length ? `${s.faults.length} fault${s.faults.length > 1 ? "s" : ""}` : "", "bad");
    const [name, value] = Object.entries(s.setpoint ?? {})[0] ?? [null, null], unit = name === "speed_rad_s" ? "rad/s" : "N";
    this.values.textContent = `asked ${text(value, 1)} ${unit} · thrust ${text(s.measured.thrust_n ?? s.estimated.thrust_n, 1)} N${s.measured.thrust_n === null ? " (estimated)" : ""} · ${text(s.measured.shaft_speed_rad_s, 1)} rad/s · ${text(s.measured.current_a, 2)} A`;
    tell(this.by, `${s.controller ?? "no controller"} · ${!s.lease ? "nobody has the lease" : mine ? "this page has the lease" : `“${s.lease.holder}” has the lease`}`);
    this.draw(old);
  }
  draw(old) {
    const width = this.course.clientWidth;
    if (width < 40) return;
    if (!this.plot) {
      const css = getComputedStyle(document.documentElement), color = (name) => css.getPropertyValue(name).trim();
      const axis = { stroke: color("--quiet"), grid: { stroke: color("--grid"), width: 1 }, ticks: { show: false }, font: "11px system-ui, 'DejaVu Sans', sans-serif" };
      this.plot = new uPlot({ width, height: 110, legend: { show: false }, cursor: { show: false }, scales: { x: { time: false }, y: { range: (_, low, high) => { const pad = Math.max(((high ?? 0) - (low ?? 0)) * 0.1, 2); return [(low ?? 0) - pad, (high ?? 0) + pad]; } } },
        axes: [{ ...axis, size: 22, values: (_, ticks) => ticks.map((t) => `${t} s`) }, { ...axis, size: 40 }],
        series: [{}, { stroke: color("--quiet"), width: 1.5, dash: [5, 4], points: { show: false } }, { stroke: color("--blue"), width: 1.5, points: { show: false } }] }, [[], [], []], this.course);
    }
    if (this.plot.width !== width) this.plot.setSize({ width, height: 110 });
    const end_s = this.state.time_s, first = Math.max(0, lowerBound(this.live.t, end_s - FLEET_SPAN_S) - 1);
    const t = this.live.t.slice(first).map((at_s) => at_s - end_s);
    this.plot.batch(() => { this.plot.setData([t, this.live.of("thrust_cmd_n").slice(first), this.live.of("thrust_n").slice(first)], false); this.plot.setScale("x", { min: -FLEET_SPAN_S, max: 0 }); });
    tell(this.course, null, `thrust of ${this.id} in the last minute, in N${old ? ", old" : ""}`);
  }
  redraw() { this.plot?.destroy(); this.plot = null; }
}
function tell(element, words, label) {
  if (words !== null && words !== undefined && element.textContent !== words) element.textContent = words;
  if (label && element.getAttribute("aria-label") !== label) element.setAttribute("aria-label", label);
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => fleet.forEach((mate) => mate.redraw()));
setInterval(() => held.forEach((theirs, id) => call("PUT", `/v1/thrusters/${encodeURIComponent(id)}/lease`, undefined, false, theirs)
  .catch(() => { if (held.delete(id)) log(`the lease of ${id} is lost`, true); })), RENEW_EVERY_MS);

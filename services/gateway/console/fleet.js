"use strict";
// Several thrusters side by side: what each does now, and which of them this page shows and commands. What one commands goes on
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

$("thruster").addEventListener("change", () => choose($("thruster").value));
async function choose(id) {
  if (lease) held.set(thruster, lease); // what one commands goes on while one looks at another
  thruster = id; lease = held.get(id) ?? null; taken_ms = performance.now(); held.delete(id);
  disconnect(); state = null; live.clear(); clock.zero_ms = null; entered = false; // nothing that is still under way of the one before is shown, or proposed, as this one's
  limitsOf = null; // nobody's, until the thruster told its own: a signal is not previewed within another's
  connect();
  const { range } = await call("GET", base());
  if (thruster !== id) return; // another was chosen meanwhile
  limitsOf = range; showBounds(); showFields();
  loadHistory().catch(() => {}); await loadController();
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
      const first = !this.live.t.length;
      this.live.push(next.time_s, { thrust_cmd_n: next.commanded.thrust_cmd_n, thrust_n: next.measured.thrust_n ?? next.estimated.thrust_n });
      if (first) this.load().catch(() => {});
    };
    stream.onclose = () => setTimeout(() => this.connect(), 1000);
  }
  // What the gateway kept of the minute before.
  async load() {
    const { time_s, columns, estimates } = await call("GET", `/v1/thrusters/${encodeURIComponent(this.id)}/history?last_s=${FLEET_SPAN_S}&hz=${FLEET_HZ}`);
    const part = new Columns(), until_s = this.live.t[0] ?? Infinity, [cmd, thrust] = [columns.thrust_cmd_n, columns.thrust_n], estimated = estimates.columns.estimated_thrust_n?.values;
    time_s.forEach((t, i) => {
      if (t < until_s) part.push(t, { thrust_cmd_n: cmd?.[i], thrust_n: thrust?.[i] ?? (thrust ? null : estimated?.[lowerBound(estimates.time_s, t)]) });
    });
    this.live.insert(0, part);
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
      this.plot = new uPlot({ width, height: 110, legend: { show: false }, cursor: { show: false }, scales: { x: { time: false }, y: { range: (_, low, high) => { const [from, to, step] = rungs(low ?? 0, high ?? 0); return [from - step / 4, to + step / 4]; } } },
        axes: [{ ...axis, size: 22, values: (_, ticks) => ticks.map((t) => `${t} s`) }, { ...axis, size: 52, splits: (u) => rungs(u.scales.y.min, u.scales.y.max, true)[3], values: (_, ticks) => ticks.map((newton) => `${newton} N`) }],
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
// A low scale of few round numbers, zero among them where it lies between: its ends, its step, its rungs. `inside` keeps it within.
function rungs(low, high, inside = false) {
  const rough = Math.max(high - low, inside ? 0 : 4) / 3, ten = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].map((of) => of * ten).find((of) => of >= rough);
  const [first, last] = inside ? [Math.ceil(low / step), Math.floor(high / step)] : [Math.floor(low / step), Math.max(Math.ceil(high / step), Math.floor(low / step) + 1)];
  return [first * step, last * step, step, Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(6)))];
}
function tell(element, words, label) {
  if (words !== null && words !== undefined && element.textContent !== words) element.textContent = words;
  if (label && element.getAttribute("aria-label") !== label) element.setAttribute("aria-label", label);
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => fleet.forEach((mate) => mate.redraw()));
setInterval(() => held.forEach((theirs, id) => call("PUT", `/v1/thrusters/${encodeURIComponent(id)}/lease`, undefined, false, theirs)
  .catch(() => { if (held.delete(id)) refused(`the lease of ${id} is lost`); })), RENEW_EVERY_MS);

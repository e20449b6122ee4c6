"use strict";
// Plots: a chart per unit, drawn by uPlot, over one source of columns: the live signals, or one or two runs.
const LIVE_POINTS = 33000; // more than ten minutes of the stream
// name, chart, label, colour, dash, shown at first; the names are the recording's columns
const SIGNALS = [
  ["thrust_cmd_n", "N", "commanded", "--quiet", [5, 4], true], ["thrust_n", "N", "measured", "--blue", [], true],
  ["estimated_thrust_n", "N", "estimated", "--orange", [], true], ["estimated_thrust_low", "N", "estimated − σ", "--orange", [1, 3], false], ["estimated_thrust_high", "N", "estimated + σ", "--orange", [1, 3], false], ["thrust_error_n", "N", "error", "--red", [], false],
  ["speed_cmd_rad_s", "rad/s", "commanded", "--quiet", [5, 4], true], ["shaft_speed_rad_s", "rad/s", "measured", "--green", [], true],
  ["current_cmd_a", "A", "commanded", "--quiet", [5, 4], true], ["current_a", "A", "measured", "--purple", [], true],
  ["flow_m_s", "m/s", "measured", "--blue", [], true], ["estimated_flow_m_s", "m/s", "estimated", "--orange", [], true],
  ["estimated_flow_low", "m/s", "estimated − σ", "--orange", [1, 3], true], ["estimated_flow_high", "m/s", "estimated + σ", "--orange", [1, 3], true],
  ["ambient_m_s", "m/s", "ambient", "--purple", [], false], ["estimated_ambient_m_s", "m/s", "ambient, estimated", "--green", [2, 3], true],
  ["estimated_ambient_low", "m/s", "ambient − σ", "--green", [1, 3], false], ["estimated_ambient_high", "m/s", "ambient + σ", "--green", [1, 3], false],
  ["voltage_cmd_v", "V", "motor, commanded", "--quiet", [5, 4], false], ["supply_v", "V", "supply", "--purple", [], false],
  ["torque_n_m", "N m", "blade torque", "--green", [], false], ["temperature_c", "°C", "motor", "--red", [], false],
  ["duty_cmd", "1", "duty, commanded", "--quiet", [], false], ["shaft_angle_rad", "rad", "shaft angle", "--blue", [], false], ["depth_m", "m", "depth", "--blue", [], false],
];
const LEVEL = "1 = alarm"; // unit of the paths' levels
const TITLES = { [LEVEL]: "mismatch", N: "thrust", "rad/s": "shaft speed", A: "motor current", "m/s": "axial flow", V: "voltage", "N m": "torque", "°C": "temperature", 1: "shares", rad: "angle", m: "depth" };
const IDS = { N: "plot-thrust", "rad/s": "plot-speed", A: "plot-current", "m/s": "plot-flow" };
const HUES = ["--blue", "--orange", "--green", "--purple", "--red"];
// Of two runs the second has colours and a line of its own: what is commanded is dashed in the first already.
const SECOND_DASH = [10, 3, 2, 3];
// A name without its unit at the end, in words.
function plainName(name, unit) {
  const end = `_${(unit ?? "").toLowerCase().replace("^", "").replace(/[^a-z0-9]+/g, "_")}`, found = [end, end.replace("_n_m_", "_nm_")].find((one) => one.length > 1 && name.endsWith(one));
  return (found ? name.slice(0, -found.length) : name).replaceAll("_", " ");
}
const shownSignals = new Set(SIGNALS.filter((signal) => signal[5]).map(([name]) => name));

// Columns over time. Nothing measured is null: a gap.
class Columns {
  constructor() { this.clear(); }
  clear() { this.t = []; this.lines = {}; this.c = {}; }
  // A column; one that was not known before has nothing in it.
  of(name) { return (this.c[name] ??= this.t.map(() => null)); }
  push(t, row) {
    if (this.t.length && t <= this.t[this.t.length - 1]) { if (t < this.t[this.t.length - 1]) this.clear(); else return; }
    const error = row.thrust_cmd_n == null || row.thrust_n == null ? null : row.thrust_cmd_n - row.thrust_n;
    for (const [name] of SIGNALS) this.of(name).push((name === "thrust_error_n" ? error : row[name]) ?? null);
    this.t.push(t);
    if (this.t.length > LIVE_POINTS) { this.t.splice(0, 2000); for (const name in this.c) this.c[name].splice(0, 2000); }
  }
  // Rows that were missing, put where they belong.
  insert(place, part) {
    for (const name in part.c) this.of(name);
    this.t.splice(place, 0, ...part.t);
    for (const name in this.c) this.c[name].splice(place, 0, ...part.of(name));
  }
  // A column as it is drawn; of a recording, which grows no more, without the rows between seldom samples.
  line(name) { return this.done ? (this.lines[name] ??= bridge(this.t, this.of(name))) : this.of(name); }
  // The part between two instants, its time from `zero_s` on.
  cut(from_s, to_s, zero_s) {
    const part = new Columns(), a = lowerBound(this.t, from_s), b = lowerBound(this.t, to_s);
    part.t = this.t.slice(a, b).map((t) => t - zero_s);
    for (const name in this.c) part.c[name] = this.c[name].slice(a, b);
    part.done = true;
    return part;
  }
  // The lines at these instants; outside the columns' own there is nothing.
  over(times) {
    const lines = new Columns();
    lines.t = times;
    for (const name in this.c) lines.c[name] = at(times, this.t, this.line(name));
    return lines;
  }
  // Root mean square of a column between two instants; null for less than a second of it.
  rms(name, from_s = -Infinity, to_s = Infinity) {
    let sum = 0, n = 0, first = null, last = null;
    for (let i = lowerBound(this.t, from_s); i < this.t.length && this.t[i] <= to_s; i += 1) {
      const v = this.of(name)[i];
      if (v === null) continue;
      sum += v * v; n += 1; first ??= this.t[i]; last = this.t[i];
    }
    return n > 1 && last - first >= 1 ? Math.sqrt(sum / n) : null;
  }
}
function lowerBound(list, value) {
  let low = 0, high = list.length;
  while (low < high) { const mid = (low + high) >> 1; if (list[mid] < value) low = mid + 1; else high = mid; }
  return low;
}
// A column of a recording as a line: what is sampled seldom has rows without a value between its samples, which are no gaps. Further
// apart than three usual steps they are.
function bridge(t, values) {
  const has = [], steps = [];
  values.forEach((v, i) => { if (v !== null) has.push(i); });
  for (let k = 1; k < has.length; k += 1) steps.push(t[has[k]] - t[has[k - 1]]);
  if (has.length === values.length || !steps.length) return values;
  const most = 3 * [...steps].sort((x, y) => x - y)[steps.length >> 1], line = [...values];
  for (let k = 1; k < has.length; k += 1) {
    const [a, b] = [has[k - 1], has[k]];
    if (steps[k - 1] > most) continue;
    for (let i = a + 1; i < b; i += 1) line[i] = values[a] + (values[b] - values[a]) * (t[i] - t[a]) / (t[b] - t[a]);
  }
  return line;
}
// Two runs over the instants of both, and B − A.
// The sides of an estimate's standard error: their difference is that of two values and of two doubts, and says neither.
const isSide = (name) => /_(low|high)$/.test(name);
function side(a, b) {
  const t = [...new Set([...a.t, ...b.t])].sort((x, y) => x - y), lines = { a: a.over(t), b: b.over(t), less: new Columns() };
  lines.less.t = t;
  for (const [name] of SIGNALS) {
    if (isSide(name)) { lines.less.c[name] = t.map(() => null); continue; }
    const mine = lines.a.of(name);
    lines.less.c[name] = lines.b.of(name).map((v, k) => (v === null || mine[k] === null ? null : v - mine[k]));
  }
  return lines;
}
// Values of another run at these instants, on straight lines; null outside it and beside its gaps.
function at(times, from, values) {
  let i = 0;
  return times.map((t) => {
    while (i + 1 < from.length && from[i + 1] <= t) i += 1;
    if (!from.length || t < from[0] || t > from[from.length - 1] || values[i] === null) return null;
    if (i + 1 >= from.length) return values[i];
    if (values[i + 1] === null) return t === from[i] ? values[i] : null;
    return values[i] + (values[i + 1] - values[i]) * (t - from[i]) / (from[i + 1] - from[i]);
  });
}

// Columns between two rows for a plot so many pixels wide: of more rows than it can show the least and the largest value of
// each stretch, so that no peak is lost. Stretches begin at whole multiples of their length: a curve that moves does not shimmer.
function thin(t, columns, first, last, width) {
  let each = 1;
  while ((last - first) / each > width) each *= 2;
  if (each <= 2) return [t.slice(first, last), columns.map((values) => values.slice(first, last))];
  const times = [], thinned = columns.map(() => []), half = each / 2, end = Math.min(last, t.length);
  for (let i = Math.floor(first / each) * each; i < end; i += each) {
    const to = Math.min(i + each, end);
    times.push(t[i], t[Math.min(i + half, to - 1)]);
    columns.forEach((values, k) => {
      let low = null, high = null, low_at = i, high_at = i;
      for (let j = i; j < to; j += 1) {
        const v = values[j];
        if (v === null) continue;
        if (low === null || v < low) { low = v; low_at = j; }
        if (high === null || v > high) { high = v; high_at = j; }
      }
      if (low_at <= high_at) thinned[k].push(low, high); else thinned[k].push(high, low);
    });
  }
  return [times, thinned];
}

class Chart {
  constructor(unit) {
    this.unit = unit; this.title = TITLES[unit] ?? "estimated";
    this.signals = signalsOf(unit);
    this.figure = Object.assign(document.createElement("figure"), { tabIndex: 0, ariaLabel: `${this.title} in ${unit}: arrows move the cursor, with Shift the window, + and − zoom, Home shows the whole window` });
    this.figure.setAttribute("role", "group");
    this.figure.addEventListener("keydown", (event) => this.key(event));
    this.box = Object.assign(document.createElement("div"), { id: IDS[unit] ?? `plot-${TITLES[unit] ?? unit.replace(/\W+/g, "-")}` });
    this.box.setAttribute("role", "img"); this.box.setAttribute("aria-label", this.title);
    this.figure.append(this.box);
    this.box.addEventListener("mousedown", (event) => this.drag(event), true); // before uPlot, which begins to choose a stretch
    this.box.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    new ResizeObserver(() => this.fit()).observe(this.figure);
  }
  fit() { const width = this.figure.clientWidth - 16; if (this.plot && width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: 210 }); }
  // As a mouse would: what is under the cursor is told, in every chart and in words.
  key(event) {
    const steps = { ArrowLeft: -1, ArrowRight: 1 }[event.key], closer = { "+": 0.5, "=": 0.5, "-": 2, "−": 2 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey || !this.plot) return;
    if (steps && event.shiftKey) {
      panBy(steps / 10);
    } else if (steps) {
      const width = this.plot.over.clientWidth, now = this.plot.cursor.left >= 0 ? this.plot.cursor.left : width;
      const left = Math.max(0, Math.min(width, now + steps * width / 100));
      this.plot.setCursor({ left, top: this.plot.over.clientHeight / 2 }, true, true);
      const { idx } = this.plot.cursor;
      const said = this.plot.series.flatMap((series, k) => (series.show && k > 0 ? [`${series.label} ${text(this.plot.data[k][idx], 2)}`] : []));
      const t = this.plot.data[0][idx], clock = clockAt(t);
      says("cursor-text", `${text(t, 2)} s: ${said.join(", ")}${clock ? `, at ${clock}, in` : ""} ${this.unit}`);
    } else if (closer) {
      const { left } = this.plot.cursor;
      zoomBy(closer, left >= 0 ? left / this.plot.over.clientWidth : 0.5);
    } else if (event.key === "Home" || event.key === "0") {
      zoomTo(null, null);
    } else { return; }
    event.preventDefault();
  }
  // What is held stays under the hand.
  drag(event) {
    if (event.button !== 0 || !event.shiftKey || !this.plot?.over.contains(event.target)) return;
    event.stopPropagation(); event.preventDefault();
    let at = event.clientX;
    const width = this.plot.over.clientWidth, to = (moved) => { panBy((at - moved.clientX) / width); at = moved.clientX; };
    document.addEventListener("mousemove", to);
    document.addEventListener("mouseup", () => document.removeEventListener("mousemove", to), { once: true });
  }
  // Sideways the window moves; with Ctrl (two fingers on a pad send the same) it zooms. A wheel alone is the page's.
  wheel(event) {
    if (!this.plot) return;
    const over = this.plot.over.getBoundingClientRect(), by = event.deltaX || (event.shiftKey ? event.deltaY : 0);
    if (event.ctrlKey && event.deltaY) zoomBy(event.deltaY < 0 ? 0.8 : 1.25, Math.min(1, Math.max(0, (event.clientX - over.left) / over.width)));
    else if (by) panBy(by / over.width);
    else return;
    event.preventDefault();
  }
  // Series: each signal of run A and of run B.
  build() {
    const css = getComputedStyle(document.documentElement), color = (name) => css.getPropertyValue(name).trim();
    const axis = { stroke: color("--quiet"), grid: { stroke: color("--grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui, 'DejaVu Sans', sans-serif" };
    const series = (second) => this.signals.map(([, , label, hue, dash]) => ({
      label: second ? `${label}, B` : label, stroke: color(second ? `${hue}-b` : hue), width: 1.5, dash: second ? SECOND_DASH : dash, points: { show: false },
      value: (_, v) => text(v, 2),
    }));
    // Between the two sides of an estimate's standard error.
    const bands = this.signals.flatMap(([name, , , hue], i) => (name.endsWith("_high") ? [{ series: [i + 1, i], fill: `color-mix(in srgb, ${color(hue)} 14%, transparent)` }] : []));
    this.plot?.destroy();
    this.plot = new uPlot({
      bands,
      width: Math.max(200, this.figure.clientWidth - 16), height: 210, title: `${this.title} [${this.unit}]`,
      cursor: { sync: { key: "kort" }, drag: { x: true, y: false, setScale: false } },
      scales: { x: { time: false }, y: { range: (u, low, high) => this.range(low, high) } },
      axes: [{ ...axis, size: 32, gap: 9, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(2)} s`) }, { ...axis, size: 52 }],
      series: [{ label: "time", value: (_, t) => (t === null || t === undefined ? "–" : [`${t.toFixed(2)} s`, clockAt(t)].filter((words) => words).join(", ")) }, ...series(false), ...series(true)],
      hooks: { setSelect: [(u) => {
        if (u.select.width < 4) return;
        zoomTo(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x"));
        u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      }] },
    }, [[], ...this.signals.map(() => []), ...this.signals.map(() => [])], this.box);
    this.plot.over.addEventListener("dblclick", () => zoomTo(null, null));
    this.shown = null;
  }
  range(low, high) {
    if (this.fixed) return this.fixed;
    if (low === null || !Number.isFinite(low)) [low, high] = [0, 0];
    const least = { N: 4, "rad/s": 4, A: 1, "m/s": 0.4 }[this.unit] ?? 0.1, pad = Math.max((high - low) * 0.1, (least - (high - low)) / 2, 1e-3);
    return [low - pad, high + pad];
  }
  // Fixed limits of y, as they are now; null for automatic ones.
  fix(on) { this.fixed = on && this.plot ? [this.plot.scales.y.min, this.plot.scales.y.max] : null; }
  draw(source, from_s, to_s) {
    const names = this.signals.map(([name]) => name).filter((name) => shownSignals.has(name));
    this.figure.hidden = names.length === 0;
    if (this.figure.hidden) return;
    if (!this.plot) this.build();
    const { a, b, difference } = source, both = Boolean(b), second = difference ? source.less : b;
    const shown = `${names}|${both}|${difference}`;
    if (this.shown !== shown) {
      this.signals.forEach(([name, , label], i) => {
        const on = shownSignals.has(name) && !(difference && isSide(name));
        this.plot.setSeries(i + 1, { show: on && !difference }, false);
        this.plot.setSeries(i + 1 + this.signals.length, { show: on && both }, false);
        this.plot.series[i + 1 + this.signals.length].dash = difference ? [] : SECOND_DASH; // alone it needs no dash
        // uPlot gives every series its row of the legend; those that are not asked for are no use there.
        const rows = this.box.querySelectorAll(".u-series");
        const [mine, theirs] = [rows[i + 1], rows[i + 1 + this.signals.length]];
        mine.hidden = !on || difference; theirs.hidden = !on || !both;
        theirs.querySelector(".u-label").textContent = `${label}, ${difference ? "B − A" : "B"}`;
      });
      this.shown = shown;
    }
    const first = Math.max(0, lowerBound(a.t, from_s) - 1), last = lowerBound(a.t, to_s) + 1;
    const [t, drawn] = thin(a.t, [a, ...(both ? [second] : [])].flatMap((of) => names.map((name) => of.line(name))), first, last, this.plot.width);
    const series = (from) => this.signals.map(([name]) => (shownSignals.has(name) ? drawn[from + names.indexOf(name)] : []));
    const mine = series(0), theirs = both ? series(names.length) : this.signals.map(() => []);
    this.last = this.signals.map(([name]) => a.of(name)[Math.min(last, a.t.length) - 1] ?? null);
    const pad = (columns) => columns.map((values) => (values.length ? values : t.map(() => null)));
    this.plot.batch(() => {
      this.plot.setData([t, ...pad(mine), ...pad(theirs)], false);
      this.plot.setScale("x", { min: from_s, max: to_s });
    });
    if (this.plot.cursor.idx === null || this.plot.cursor.left < 0) this.plot.setLegend({ idx: t.length - 1 }, false);
  }
  // What the picture says, in words: for those who do not see it.
  describe() {
    if (this.figure.hidden || !this.last) return;
    const says = this.signals.map(([name, , label], i) => [name, label, this.last[i]]).filter(([name]) => shownSignals.has(name));
    this.box.setAttribute("aria-label", `${this.title} in ${this.unit}: ${says.map(([, label, v]) => `${label} ${v === null ? "not measured" : v.toFixed(1)}`).join(", ")}`);
  }
}
const signalsOf = (unit) => SIGNALS.filter((signal) => signal[1] === unit);
const charts = [...new Set(SIGNALS.map((signal) => signal[1]))].map((unit) => new Chart(unit));
// A signal that only the stream tells of: it gets its chart, and its place in the picker.
const known = new Set(SIGNALS.map(([name]) => name));
function addSignal(name, unit, label, side) {
  if (known.has(name)) return;
  known.add(name);
  const of = side && SIGNALS.find(([main]) => main === side), hue = of ? of[3] : HUES[signalsOf(unit).length % HUES.length];
  SIGNALS.push([name, unit, label, hue, of ? [1, 3] : [6, 3], false]);
  const chart = charts.find((one) => one.unit === unit);
  if (chart) { chart.signals = signalsOf(unit); if (chart.plot) chart.build(); } else charts.push(new Chart(unit));
  showPicker();
}
// Estimates of an instant, [name, unit, value], as a row of columns: what an observer or an estimator gives depends on the rig and the
// law; it shows one standard error to both sides of those that have one.
const DOUBT = "_std_error", SIDES = { estimated_thrust_n: "estimated_thrust", estimated_flow_m_s: "estimated_flow", estimated_ambient_m_s: "estimated_ambient" };
function estimatesRow(estimates) {
  const row = {}, doubts = {};
  for (const [name, unit, v] of estimates) {
    if (name.endsWith(DOUBT)) { doubts[name.slice(0, -DOUBT.length)] = [v, unit]; continue; }
    const words = plainName(name.replace(/^(estimated|mismatch)_/, ""), unit);
    if (name.startsWith("mismatch_")) addSignal(name, LEVEL, words); else addSignal(name, unit, name.startsWith("estimated_") ? `${words}, estimated` : words);
    row[name] = v;
  }
  for (const [name, [doubt, unit]] of Object.entries(doubts)) {
    const v = row[name] ?? null, side = SIDES[name] ?? name, words = plainName(name.slice(10), unit);
    addSignal(`${side}_low`, unit, `${words} − σ`, name); addSignal(`${side}_high`, unit, `${words} + σ`, name);
    if (doubt === null || v === null) continue;
    row[`${side}_low`] = v - doubt; row[`${side}_high`] = v + doubt;
  }
  return row;
}
// What the gateway kept of them, as rows for instants that are asked for in their order: the newest, if it is not old.
const ESTIMATE_OLD_S = 0.5;
function estimatesAt({ time_s, columns }) {
  const all = Object.entries(columns);
  let i = 0;
  return (t) => {
    while (i + 1 < time_s.length && time_s[i + 1] <= t + 1e-6) i += 1;
    const there = time_s.length && time_s[i] <= t + 1e-6 && t - time_s[i] < ESTIMATE_OLD_S;
    return there ? estimatesRow(all.map(([name, { unit, values }]) => [name, unit, values[i]])) : {};
  };
}
const live = new Columns();

// The servo's seconds on the wall clock. The browser's clock may be wrong: the gateway tells its own in every answer, in whole seconds
// (Date), and what all answers allow is soon known to some milliseconds. A state is as old as it says, and its way to here: the quickest counts.
const clock = { ahead_ms: [-Infinity, Infinity], zero_ms: null };
function heardDate(date, sent_ms) {
  const at_ms = Date.parse(date ?? ""), told = [at_ms - Date.now(), at_ms + 1000 - sent_ms];
  if (!Number.isFinite(at_ms)) return;
  const both = [Math.max(told[0], clock.ahead_ms[0]), Math.min(told[1], clock.ahead_ms[1])];
  clock.ahead_ms = both[0] <= both[1] ? both : told; // a clock was set
}
function heardTime(s) {
  const zero_ms = Date.now() - 1000 * (s.time_s + (s.age_s ?? 0));
  if (clock.zero_ms === null || zero_ms < clock.zero_ms || zero_ms > clock.zero_ms + 500) clock.zero_ms = zero_ms;
}
const gatewayNow = () => Date.now() + (Number.isFinite(clock.ahead_ms[0]) ? (clock.ahead_ms[0] + clock.ahead_ms[1]) / 2 : 0);
const servoAt = (wall_ms) => (clock.zero_ms === null ? null : (wall_ms - (gatewayNow() - Date.now()) - clock.zero_ms) / 1000);
// Where the plots' time begins on the wall clock; of two runs there are two such times, and none is said.
const wallZero = () => (run ? (run.b ? null : run.zero_ms ?? null) : clock.zero_ms === null ? null : clock.zero_ms + gatewayNow() - Date.now());
function clockAt(t) {
  const zero_ms = wallZero();
  if (zero_ms === null || t === null || t === undefined) return "";
  return new Date(zero_ms + 1000 * t).toLocaleTimeString(undefined, { hour: "2-digit", minute: "2-digit", second: "2-digit", fractionalSecondDigits: 1 });
}

let zoomed = null; // [from_s, to_s], or none: the usual window
function zoomTo(from_s, to_s) {
  zoomed = from_s === null ? null : [from_s, to_s];
  document.getElementById("zoom-out").disabled = !zoomed;
}
// By the window that is asked for, not by what was drawn last: keys and wheels are quicker than pictures.
function zoomBy(closer, share) {
  const [, from_s, to_s] = shownNow(), [, whole_from, whole_to] = wholeNow(), at_s = from_s + share * (to_s - from_s), span_s = (to_s - from_s) * closer;
  if (span_s >= whole_to - whole_from) zoomTo(null, null); else zoomTo(at_s - share * span_s, at_s + (1 - share) * span_s);
}
// Moves the window by a share of its length, as far as there is something to see.
function panBy(share) {
  const [{ a, b }, from_s, to_s] = shownNow(), [, whole_from, whole_to] = wholeNow(), span_s = to_s - from_s;
  const first_s = Math.min(whole_from, a.t[0] ?? whole_from), last_s = Math.max(whole_to, a.t.at(-1) ?? whole_to, b?.t.at(-1) ?? whole_to);
  const begin_s = Math.max(first_s, Math.min(last_s - span_s, from_s + share * span_s));
  if (Math.abs(begin_s - from_s) > 1e-6 * span_s) zoomTo(begin_s, begin_s + span_s);
}

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
const TITLES = { N: "thrust", "rad/s": "shaft speed", A: "motor current", "m/s": "axial flow", V: "voltage", "N m": "torque", "°C": "temperature", 1: "duty", rad: "angle", m: "depth" };
const IDS = { N: "plot-thrust", "rad/s": "plot-speed", A: "plot-current", "m/s": "plot-flow" };
const shownSignals = new Set(SIGNALS.filter((signal) => signal[5]).map(([name]) => name));

// Columns over time. Nothing measured is null: a gap.
class Columns {
  constructor() { this.clear(); }
  clear() { this.t = []; this.lines = {}; this.c = Object.fromEntries(SIGNALS.map(([name]) => [name, []])); }
  push(t, row) {
    if (this.t.length && t <= this.t[this.t.length - 1]) { if (t < this.t[this.t.length - 1]) this.clear(); else return; }
    this.t.push(t);
    const error = row.thrust_cmd_n == null || row.thrust_n == null ? null : row.thrust_cmd_n - row.thrust_n;
    for (const name in this.c) this.c[name].push((name === "thrust_error_n" ? error : row[name]) ?? null);
    if (this.t.length > LIVE_POINTS) { this.t.splice(0, 2000); for (const name in this.c) this.c[name].splice(0, 2000); }
  }
  // A column as it is drawn; of a recording, which grows no more, without the rows between seldom samples.
  line(name) { return this.done ? (this.lines[name] ??= bridge(this.t, this.c[name])) : this.c[name]; }
  // The part between two instants, its time from `zero_s` on.
  cut(from_s, to_s, zero_s) {
    const part = new Columns(), a = lowerBound(this.t, from_s), b = lowerBound(this.t, to_s);
    part.t = this.t.slice(a, b).map((t) => t - zero_s);
    for (const name in this.c) part.c[name] = this.c[name].slice(a, b);
    return part;
  }
  // Root mean square of a column between two instants; null for less than a second of it.
  rms(name, from_s = -Infinity, to_s = Infinity) {
    let sum = 0, n = 0, first = null, last = null;
    for (let i = lowerBound(this.t, from_s); i < this.t.length && this.t[i] <= to_s; i += 1) {
      const v = this.c[name][i];
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
    this.unit = unit; this.title = TITLES[unit];
    this.signals = SIGNALS.filter((signal) => signal[1] === unit);
    this.figure = document.createElement("figure");
    this.box = Object.assign(document.createElement("div"), { id: IDS[unit] ?? `plot-${this.title}` });
    this.box.setAttribute("role", "img"); this.box.setAttribute("aria-label", this.title);
    this.figure.append(this.box);
    new ResizeObserver(() => this.fit()).observe(this.figure);
  }
  fit() { const width = this.figure.clientWidth - 16; if (this.plot && width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: 210 }); }
  // Series: each signal of run A and of run B; what is compared is dashed.
  build() {
    const css = getComputedStyle(document.documentElement), color = (name) => css.getPropertyValue(name).trim();
    const axis = { stroke: color("--quiet"), grid: { stroke: color("--grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui, 'DejaVu Sans', sans-serif" };
    const series = (second) => this.signals.map(([, , label, hue, dash]) => ({
      label: second ? `${label}, B` : label, stroke: color(hue), width: 1.5, dash: second ? [2, 4] : dash, points: { show: false },
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
      axes: [{ ...axis, size: 28, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(2)} s`) }, { ...axis, size: 52 }],
      series: [{ label: "time", value: (_, t) => (t === null || t === undefined ? "–" : `${t.toFixed(2)} s`) }, ...series(false), ...series(true)],
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
    const { a, b, difference } = source, both = Boolean(b);
    const shown = `${names}|${both}|${difference}`;
    if (this.shown !== shown) {
      this.signals.forEach(([name, , label], i) => {
        const on = shownSignals.has(name);
        this.plot.setSeries(i + 1, { show: on && !difference }, false);
        this.plot.setSeries(i + 1 + this.signals.length, { show: on && both }, false);
        // uPlot gives every series its row of the legend; those that are not asked for are no use there.
        const rows = this.box.querySelectorAll(".u-series");
        const [mine, theirs] = [rows[i + 1], rows[i + 1 + this.signals.length]];
        mine.hidden = !on || difference; theirs.hidden = !on || !both;
        theirs.querySelector(".u-label").textContent = `${label}, ${difference ? "B − A" : "B"}`;
      });
      this.shown = shown;
    }
    const first = Math.max(0, lowerBound(a.t, from_s) - 1), last = lowerBound(a.t, to_s) + 1;
    const [t, drawn] = thin(a.t, names.map((name) => a.line(name)), first, last, both ? Infinity : this.plot.width);
    const mine = this.signals.map(([name]) => (shownSignals.has(name) ? drawn[names.indexOf(name)] : []));
    const theirs = this.signals.map(([name], i) => {
      if (!both || !shownSignals.has(name)) return [];
      const other = at(t, b.t, b.line(name));
      return difference ? other.map((v, k) => (v === null || mine[i][k] === null ? null : v - mine[i][k])) : other;
    });
    this.last = this.signals.map(([name]) => a.c[name][Math.min(last, a.t.length) - 1] ?? null);
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
const charts = Object.keys(TITLES).sort((x, y) => SIGNALS.findIndex((s) => s[1] === x) - SIGNALS.findIndex((s) => s[1] === y)).map((unit) => new Chart(unit));
const live = new Columns();
let zoomed = null; // [from_s, to_s], or none: the usual window
function zoomTo(from_s, to_s) {
  zoomed = from_s === null ? null : [from_s, to_s];
  document.getElementById("zoom-out").disabled = !zoomed;
}

// What is shown, as a table and as a picture.
function save(name, blob) {
  const url = URL.createObjectURL(blob);
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
function tableOf(source, from_s, to_s) {
  const names = SIGNALS.map(([name]) => name).filter((name) => shownSignals.has(name)), { a, b } = source;
  const others = b ? names.map((name) => at(a.t, b.t, b.line(name))) : [];
  const rows = [["time_s", ...names, ...(b ? names.map((name) => `b_${name}`) : [])].join(",")];
  for (let i = lowerBound(a.t, from_s); i < a.t.length && a.t[i] <= to_s; i += 1) {
    rows.push([a.t[i], ...names.map((name) => a.c[name][i]), ...others.map((values) => values[i])].map((v) => v ?? "").join(","));
  }
  return `${rows.join("\n")}\n`;
}
function pictureOf({ b, difference }) {
  const of = !b ? "" : difference ? ", B − A" : ", B dashed";
  const drawn = charts.filter((chart) => !chart.figure.hidden && chart.plot), scale = window.devicePixelRatio || 1;
  const width = Math.max(...drawn.map((chart) => chart.plot.ctx.canvas.width)), line = 24 * scale;
  const sheet = Object.assign(document.createElement("canvas"), { width, height: drawn.reduce((sum, chart) => sum + chart.plot.ctx.canvas.height + line, 0) });
  const pen = sheet.getContext("2d"), css = getComputedStyle(document.documentElement);
  pen.fillStyle = css.getPropertyValue("--card"); pen.fillRect(0, 0, width, sheet.height);
  let top = 0;
  for (const chart of drawn) {
    let left = 6 * scale;
    pen.font = `${13 * scale}px system-ui, sans-serif`; pen.fillStyle = css.getPropertyValue("--ink");
    const title = `${chart.title} [${chart.unit}]${of}`;
    pen.fillText(title, left, top + 16 * scale); left += pen.measureText(`${title}   `).width;
    for (const [name, , label, hue] of chart.signals.filter((signal) => shownSignals.has(signal[0]))) {
      pen.fillStyle = css.getPropertyValue(hue); pen.fillText(label, left, top + 16 * scale); left += pen.measureText(`${label}   `).width;
    }
    pen.drawImage(chart.plot.ctx.canvas, 0, top + line);
    top += chart.plot.ctx.canvas.height + line;
  }
  return new Promise((done) => sheet.toBlob(done, "image/png"));
}

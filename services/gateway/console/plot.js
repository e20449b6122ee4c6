"use strict";
// A strip chart on a canvas: several curves over the last seconds, one unit per chart.
// Each curve holds [time_s, value] pairs; null values leave gaps.
class StripChart {
  constructor(canvas, title, unit, curves) {
    Object.assign(this, { canvas, title, unit, curves, points: curves.map(() => []), hover: null });
    canvas.addEventListener("mousemove", (event) => { this.hover = event.offsetX; });
    canvas.addEventListener("mouseleave", () => { this.hover = null; });
  }

  push(time_s, values) {
    values.forEach((value, i) => this.points[i].push([time_s, value]));
    if (this.points[0].length > 40000) this.points.forEach((list) => list.splice(0, 10000));
  }

  // What the picture says, in words: for those who do not see it.
  describe() {
    const says = this.curves.map((curve, i) => { const value = last(this.points[i]); return `${curve.name} ${value === null ? "not measured" : value.toFixed(1)}`; });
    this.canvas.setAttribute("aria-label", `${this.title} in ${this.unit}: ${says.join(", ")}`);
  }

  clear() { this.points.forEach((list) => { list.length = 0; }); }

  draw(end_s, span_s) {
    const { canvas } = this, scale = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
    if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
    const pen = canvas.getContext("2d"), css = getComputedStyle(document.documentElement);
    const color = (name) => css.getPropertyValue(name).trim();
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";

    const legend = this.places(pen, width);
    const box = { left: 52, right: width - 8, top: legend[legend.length - 1].top + 13, bottom: height - 20 };
    const start_s = end_s - span_s;
    const shown = this.points.map((list) => list.slice(firstAfter(list, start_s)));
    const [low, high] = range(shown, this.curves[0].atLeast || 1);
    const x = (t) => box.left + (t - start_s) / span_s * (box.right - box.left);
    const y = (v) => box.bottom - (v - low) / (high - low) * (box.bottom - box.top);

    pen.fillStyle = color("--ink"); pen.textAlign = "left";
    pen.font = "600 12px system-ui, 'DejaVu Sans', sans-serif";
    pen.fillText(`${this.title} [${this.unit}]`, 4, 14);
    pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";

    pen.lineWidth = 1; pen.textAlign = "right";
    const step = niceStep((high - low) / 4);
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) {
      pen.strokeStyle = color(Math.abs(v) < step / 1e6 ? "--line" : "--grid");
      line(pen, box.left, y(v), box.right, y(v));
      pen.fillStyle = color("--quiet");
      pen.fillText(tick(v, step), box.left - 6, y(v) + 4);
    }
    pen.textAlign = "center";
    const stepT = niceStep(span_s / 6);
    for (let ago = 0; ago <= span_s + 1e-9; ago += stepT) {
      pen.strokeStyle = color("--grid");
      line(pen, x(end_s - ago), box.top, x(end_s - ago), box.bottom);
      pen.fillStyle = color("--quiet");
      pen.textAlign = ago === 0 ? "right" : "center";
      pen.fillText(ago === 0 ? "now" : `-${ago} s`, x(end_s - ago) + (ago === 0 ? 4 : 0), height - 5);
    }

    pen.save(); pen.beginPath();
    pen.rect(box.left, box.top - 2, box.right - box.left, box.bottom - box.top + 4); pen.clip();
    this.curves.forEach((curve, i) => {
      pen.strokeStyle = color(curve.color); pen.lineWidth = 1.6; pen.setLineDash(curve.dash || []);
      pen.beginPath();
      let down = false;
      for (const [t, v] of shown[i]) {
        if (v === null || v === undefined) { down = false; continue; }
        if (down) pen.lineTo(x(t), y(v)); else pen.moveTo(x(t), y(v));
        down = true;
      }
      pen.stroke(); pen.setLineDash([]);
    });
    pen.restore();

    const at = this.hover !== null && this.hover >= box.left && this.hover <= box.right
      ? start_s + (this.hover - box.left) / (box.right - box.left) * span_s : null;
    if (at !== null) { pen.strokeStyle = color("--quiet"); line(pen, this.hover, box.top, this.hover, box.bottom); }
    pen.textAlign = "left";
    this.curves.forEach((curve, i) => {
      const { left, top } = legend[i];
      const value = at === null ? last(shown[i]) : near(shown[i], at);
      const text = `${curve.name} ${value === null ? "–" : value.toFixed(2)}`;
      pen.strokeStyle = color(curve.color); pen.lineWidth = 2; pen.setLineDash(curve.dash || []);
      line(pen, left, top, left + 16, top); pen.setLineDash([]);
      pen.fillStyle = color("--ink"); pen.fillText(text, left + 21, top + 4);
    });
  }

  // Where each curve's entry of the legend stands: a new row where the last one is full.
  places(pen, width) {
    let left = 4, top = 27;
    return this.curves.map((curve) => {
      const wide = 21 + pen.measureText(`${curve.name} -000.00`).width;
      if (left > 4 && left + wide > width) { left = 4; top += 16; }
      const place = { left, top };
      left += wide + 14;
      return place;
    });
  }
}

function line(pen, x0, y0, x1, y1) { pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); }
function niceStep(raw) {
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].find((m) => m * power >= raw) * power;
}
function tick(value, step) { return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))); }
function firstAfter(list, time_s) {
  let low = 0, high = list.length;
  while (low < high) { const mid = (low + high) >> 1; if (list[mid][0] < time_s) low = mid + 1; else high = mid; }
  return Math.max(0, low - 1);
}
function range(curves, atLeast) {
  let low = Infinity, high = -Infinity;
  for (const list of curves) for (const [, v] of list) if (v !== null && v !== undefined) { low = Math.min(low, v); high = Math.max(high, v); }
  if (low > high) { low = 0; high = 0; }
  const pad = Math.max((high - low) * 0.1, (atLeast - (high - low)) / 2, 1e-3);
  return [low - pad, high + pad];
}
function last(list) { for (let i = list.length - 1; i >= 0; i--) if (list[i][1] !== null && list[i][1] !== undefined) return list[i][1]; return null; }
function near(list, time_s) { const i = firstAfter(list, time_s); return list[i] && list[i][1] !== undefined ? list[i][1] : null; }

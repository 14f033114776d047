// The scrolling spectrogram: bytes of level in a ring of pixels, and what the machine is known to do drawn over it.
import { colour, font, unit } from "./charts.js";

const TOP = 6;
let LEFT = 56, RIGHT = 42, BOTTOM = 24;

function rampOf(text) {
  const stops = text.split(",").map((s) => parseInt(s.trim().slice(1), 16));
  return Array.from({ length: 256 }, (_, level) => {
    const at = (level / 255) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2), f = at - k;
    return [16, 8, 0].map((bits) => {
      const a = (stops[k] >> bits) & 255, b = (stops[k + 1] >> bits) & 255;
      return Math.round(a + f * (b - a));
    });
  });
}

export class Spectrogram {
  constructor(box, traces) {
    this.box = box;
    this.traces = traces;
    this.canvas = box.querySelector("canvas");
    this.pixels = document.createElement("canvas");
    this.epoch = this.head = -1;
    this.theme();
    new ResizeObserver(() => this.resize()).observe(box);
  }

  theme() {
    this.ramp = rampOf(colour("ramp"));
    if (this.kept) for (const [number, levels] of this.kept) this.paint(number, levels);
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    [LEFT, RIGHT, BOTTOM] = [unit(56), unit(42), unit(24)];
    this.canvas.width = Math.round(this.box.clientWidth * ratio);
    this.canvas.height = Math.round(this.box.clientHeight * ratio);
    this.canvas.style.width = `${this.box.clientWidth}px`;
    this.canvas.style.height = `${this.box.clientHeight}px`;
    this.draw();
  }

  take(frame) {
    const { numbers, bins, bin_hz: binHz, column_s: step, most } = frame.header.spectra;
    if (frame.header.epoch !== this.epoch || bins !== this.bins) {
      this.epoch = frame.header.epoch;
      Object.assign(this, { bins, most, head: -1, kept: new Map() });
      this.pixels.width = most;
      this.pixels.height = bins;
    }
    Object.assign(this, { binHz, step, state: frame.header.state });
    numbers.forEach((number, k) => {
      const levels = frame.levels.slice(k * bins, (k + 1) * bins);
      this.head = Math.max(this.head, number);
      this.kept.set(number, levels);
      this.paint(number, levels);
    });
    for (const number of this.kept.keys()) if (number <= this.head - most) this.kept.delete(number);
  }

  paint(number, levels) {
    const context = this.pixels.getContext("2d");
    const column = context.createImageData(1, this.bins);
    for (let k = 0; k < this.bins; k++) {
      const [r, g, b] = this.ramp[levels[k]], at = 4 * (this.bins - 1 - k);
      column.data.set([r, g, b, levels[k] ? 255 : 0], at);
    }
    context.putImageData(column, number % this.most, 0);
  }

  draw() {
    const context = this.canvas.getContext("2d"), ratio = devicePixelRatio || 1;
    const width = this.canvas.width / ratio, height = this.canvas.height / ratio;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!this.bins || width < 120) return;
    const [from, to] = this.traces.span, top = (this.bins - 1) * this.binHz;
    const x = (time) => LEFT + ((time - from) / (to - from)) * (width - LEFT - RIGHT);
    const y = (hz) => height - BOTTOM - (hz / top) * (height - TOP - BOTTOM);
    this.picture(context, x, y, top, from);
    this.scales(context, x, y, top, from, to, width);
    this.marks(context, x, y, top, width);
  }

  picture(context, x, y, top, from) {
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, x(this.traces.span[1]) - LEFT, y(0) - TOP);
    context.clip();
    const half = 0.5 * this.binHz, tall = y(-half) - y(top + half), wide = x(this.step) - x(0);
    for (const number of this.kept.keys()) {
      if (number <= this.head - this.most) continue;
      const left = x((number + 1) * this.step - 0.05 - 0.5 * this.step);
      context.drawImage(this.pixels, number % this.most, 0, 1, this.bins, left, y(top + half), wide + 0.6, tall);
    }
    context.restore();
  }

  scales(context, x, y, top, from, to, width) {
    context.font = font();
    context.fillStyle = colour("muted");
    context.textBaseline = "middle";
    context.textAlign = "right";
    const step = [100, 200, 250, 500, 1000, 2000].find((s) => y(0) - y(s) > unit(26)) ?? 5000;
    for (let hz = 0; hz <= top; hz += step) context.fillText(`${hz} Hz`, LEFT - 6, Math.max(y(hz), TOP + 6));
    context.textAlign = "center";
    const every = [1, 2, 5].find((s) => x(s) - x(0) > unit(60)) ?? 10;
    for (let t = Math.ceil(from / every) * every; t < to; t += every) {
      if (x(t) > LEFT + 12 && x(t) < width - RIGHT - 8) context.fillText(`${t} s`, x(t), y(0) + unit(14));
    }
  }

  marks(context, x, y, top, width) {
    const right = width - RIGHT, { band_hz: band, spindle_hz: spindle, tooth_pass_hz: tooth } = this.state;
    context.lineWidth = 1;
    context.strokeStyle = colour("muted");
    context.setLineDash([4, 4]);
    for (const edge of band) this.segment(context, LEFT, y(edge), right, y(edge));
    context.setLineDash([]);
    if (spindle > 2) for (let k = 1; k * spindle <= top; k++) this.segment(context, right, y(k * spindle), right + 3, y(k * spindle));
    if (tooth > 4) {
      context.textAlign = "left";
      for (let k = 1; k * tooth <= top; k++) {
        this.segment(context, right, y(k * tooth), right + (k % 5 ? 6 : 10), y(k * tooth));
        if (k % 5 === 0 && 5 * (y(0) - y(tooth)) > unit(16)) context.fillText(`${k}×`, right + unit(13), y(k * tooth));
      }
    }
    this.detected(context, x, y, right);
  }

  detected(context, x, y, right) {
    const { values, time } = this.traces, row = values.frequency_hz;
    if (!row) return;
    context.strokeStyle = colour("detected");
    context.lineWidth = 2;
    context.beginPath();
    let last = -1;
    row.forEach((hz, k) => {
      if (hz === null) return;
      if (last >= 0 && k - last < 4) context.lineTo(x(time[k]), y(hz));
      else context.moveTo(x(time[k]), y(hz));
      last = k;
    });
    context.stroke();
    const taken = [], main = last < row.length - 30 ? null : row[last];
    if (main !== null) this.label(context, `${main.toFixed(1)} Hz`, right, y(main) - unit(15), taken, "detected");
    for (const { frequency_hz: hz, kind } of this.state.lines) {
      if (main !== null && Math.abs(hz - main) < 12) continue;
      const beside = main !== null && hz < main ? unit(15) : -unit(15);
      this.label(context, `${hz.toFixed(0)} Hz ${kind}`, right, y(hz) + beside, taken, "ink");
    }
  }

  label(context, text, right, middle, taken, ink) {
    if (taken.some((other) => Math.abs(other - middle) < unit(19)) || middle < TOP + unit(9)) return;
    taken.push(middle);
    const wide = context.measureText(text).width + unit(10), left = right - wide, high = unit(18);
    context.fillStyle = colour("card");
    context.globalAlpha = 0.85;
    context.fillRect(left, middle - high / 2, wide, high);
    context.globalAlpha = 1;
    context.fillStyle = colour(ink);
    context.textAlign = "left";
    context.fillText(text, left + unit(5), middle);
  }

  segment(context, x0, y0, x1, y1) {
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    context.stroke();
  }
}

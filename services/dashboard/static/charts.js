// Four charts on one axis of time, drawn by uPlot.
// lengths are for a screen whose text is 15 px; on larger ones everything grows with the text
export const unit = (px) => (px / 15) * parseFloat(getComputedStyle(document.documentElement).fontSize);
export const font = () => `${Math.round(unit(12))}px system-ui, sans-serif`;

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function axis(more) {
  return {
    stroke: colour("muted"), font: font(), grid: { stroke: colour("line"), width: 1 },
    ticks: { show: false }, ...more,
  };
}

function options(range, y, series, more = {}) {
  return {
    width: 300, height: 120, legend: { show: false }, cursor: { show: false }, padding: [6, unit(more.right ?? 12), 0, 0], pxAlign: 0,
    scales: { x: { time: false, range }, y },
    axes: [
      axis({ size: unit(24), space: unit(60), incrs: [1, 2, 5, 10], values: (_, ticks) => ticks.map((t) => `${t} s`) }),
      axis({ size: unit(56), space: unit(26), ...more.axis }),
    ],
    series: [{}, ...series.map((s) => ({ spanGaps: false, points: { show: false }, width: 1.5, ...s }))],
    bands: more.bands, hooks: more.hooks ?? {},
  };
}

// What lasts shorter than 1.5 % of the span (a turret that starts to move, a knock) may leave the axes.
const SHORT = 0.015;

function within(traces, lowRow, highRow, least) {
  const sorted = (row) => (traces.values[row] ?? []).filter((v) => v !== null).sort((a, b) => a - b);
  return () => {
    const lows = sorted(lowRow), highs = sorted(highRow), skipped = Math.floor(SHORT * lows.length);
    const bottom = Math.min(lows[skipped] ?? 0, 0), top = Math.max(highs.at(-1 - skipped) ?? 0, least);
    return [bottom - 0.15 * (top - bottom), top + 0.15 * (top - bottom)];
  };
}

const decades = (_, splits) => splits.map((v) => {
  const lead = v === null ? 0 : Number(v.toExponential()[0]);
  return [1, 2, 5].includes(lead) ? String(Number(v.toPrecision(1))) : "";
});

export class Charts {
  constructor(traces) {
    this.traces = traces;
    this.limits = [0, 0];
    this.plots = [];
    this.observer = new ResizeObserver(() => this.resize());
    for (const name of ["indicator", "x1", "y1p", "shift"]) this.observer.observe(document.getElementById(`plot-${name}`));
  }

  build() {
    this.unit = unit(1);
    for (const { plot } of this.plots) plot.destroy();
    const range = () => this.traces.span;
    const envelope = (row) => {
      const ink = colour("main");
      return [
        options(range, { range: within(this.traces, `${row}_min_n`, `${row}_max_n`, 5) }, [{ stroke: ink, width: 1 }, { stroke: ink, width: 1 }],
          { bands: [{ series: [2, 1], fill: ink + "66" }] }),
        [`${row}_min_n`, `${row}_max_n`],
      ];
    };
    const limitLines = (plot) => {
      const { ctx, bbox } = plot;
      ctx.save();
      ctx.strokeStyle = colour("limit");
      ctx.lineWidth = 1.5 * devicePixelRatio;
      ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
      for (const limit of this.limits) {
        const y = plot.valToPos(limit, "y", true);
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
      }
      ctx.restore();
    };
    const positive = (_, low, high) => [Math.max(Math.min(low ?? 0.1, 0.5) / 1.5, 1e-3), Math.max(high ?? 1, 10) * 1.5];
    const shiftRange = (_, low, high) => {
      const bottom = Math.min(this.limits[0], low ?? 0), top = Math.max(this.limits[1], high ?? 0);
      return [bottom - 0.08 * (top - bottom + 1), top + 0.08 * (top - bottom + 1)];
    };
    const wanted = {
      indicator: [
        options(range, { distr: 3, range: positive },
          [{ stroke: colour("main"), width: 2 }, { stroke: colour("limit"), dash: [6, 4] }],
          { right: 42, axis: { values: decades, filter: (_, splits) => splits } }),
        ["indicator_n", "limit_n"],
      ],
      x1: envelope("x1"),
      y1p: envelope("y1p"),
      shift: [
        options(range, { range: shiftRange },
          [{ stroke: colour("requested"), dash: [6, 4] }, { stroke: colour("applied"), width: 2.5 }],
          { hooks: { draw: [limitLines] } }),
        ["shift_requested_deg", "shift_applied_deg"],
      ],
    };
    this.plots = Object.entries(wanted).map(([name, [opts, rows]]) => {
      const box = document.getElementById(`plot-${name}`);
      return { plot: new uPlot(opts, [[0], ...rows.map(() => [null])], box), rows, box, logarithmic: name === "indicator" };
    });
    this.resize();
  }

  resize() {
    if (this.plots.length && this.unit !== unit(1)) {
      this.build();
      this.draw();
      return;
    }
    for (const { plot, box } of this.plots) {
      const width = Math.floor(box.clientWidth), height = Math.floor(box.clientHeight);
      if (width > 60 && height > 40 && (plot.width !== width || plot.height !== height)) plot.setSize({ width, height });
    }
  }

  draw() {
    if (this.traces.head < 0) return;
    for (const { plot, rows, logarithmic } of this.plots) {
      const data = rows.map((row) => this.traces.values[row]);
      plot.setData([this.traces.time, ...(logarithmic ? data.map((d) => d.map((v) => (v > 0 ? v : null))) : data)]);
    }
  }
}

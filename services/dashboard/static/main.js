import { Charts } from "./charts.js";
import { Control } from "./control.js";
import { STALE_MS, connect } from "./link.js";
import { addEvents, ageText, showState, showWord } from "./panel.js";
import { Spectrogram } from "./spectrogram.js";
import { Traces } from "./traces.js";

const traces = new Traces(), charts = new Charts(traces), control = new Control();
const spectrogram = new Spectrogram(document.getElementById("spectrogram"), traces);
const page = { frames: 0, drawn: 0, links: 0, last: null, newest: 0 };
let state = null, cameAt = 0, due = false, up = false;
window.antiphase = Object.assign(page, { traces, spectrogram });

function draw() {
  due = false;
  charts.draw();
  spectrogram.draw();
  page.drawn += 1;
}

function show(frame) {
  page.frames += 1;
  page.last = frame.header;
  state = frame.header.state;
  cameAt = performance.now();
  traces.take(frame);
  spectrogram.take(frame);
  charts.limits = state.shift_limits_deg;
  showState(state);
  control.show(state.controls);
  addEvents(frame.header.events.filter((event) => event.id > page.newest));
  page.newest = Math.max(page.newest, ...frame.header.events.map((event) => event.id));
  if (!due) {
    due = true;
    requestAnimationFrame(draw);
  }
}

function onLink(there) {
  if (there && !up) {
    page.links += 1;
    page.newest = 0;
    traces.epoch = spectrogram.epoch = -1;
    document.getElementById("events").replaceChildren();
  }
  up = there;
  const mark = document.getElementById("link");
  mark.dataset.link = there ? "up" : "down";
  mark.textContent = there ? "live" : "reconnecting";
}

setInterval(() => {
  const silent = performance.now() - cameAt;
  if (silent < STALE_MS) return;
  document.getElementById("age").textContent = state ? ageText((state.age_ms ?? 0) + silent) : "–";
  const since = state ? `nothing from the server of this page for ${ageText(silent)}` : "waiting for the server of this page";
  showWord(state ? "STALE" : "NO LINK", "stale", since);
}, 200);

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  charts.build();
  spectrogram.theme();
  draw();
});

charts.build();
connect("/ws", show, onLink);

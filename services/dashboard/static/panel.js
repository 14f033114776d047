// Everything on the page that is words and numbers.
const MOST_PI = 2;
const at = (id) => document.getElementById(id);

function put(id, text) {
  const place = at(id);
  if (place.textContent !== text) place.textContent = text;
}

const fixed = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1"));
const significant = (value) => (value === null ? "–" : value === 0 ? "0" : value.toFixed(value < 10 ? 2 : value < 100 ? 1 : 0));

export function ageText(ms) {
  if (ms === null || ms === undefined) return "–";
  return ms < 1000 ? `${Math.round(ms)} ms` : ms < 100e3 ? `${(ms / 1000).toFixed(1)} s` : `${Math.round(ms / 60e3)} min`;
}

export function showWord(word, tone, detail) {
  put("word", word);
  at("word").classList.toggle("long", word.length > 8);
  put("detail", detail);
  document.body.dataset.tone = tone;
}

export function showState(state) {
  showWord(state.word, state.tone, state.detail);
  document.title = `${state.word} – ${state.machine}`;
  put("machine", state.machine);
  put("case", state.case);
  at("case").title = state.title;
  put("time", state.time_s === null ? "" : `${state.time_s.toFixed(1)} s`);
  put("age", ageText(state.age_ms));
  const line = state.frequency_hz ?? state.last_chatter_hz;
  put("frequency", fixed(line, 1));
  put("frequency-note", state.frequency_hz !== null ? `${state.kind || "kind unknown"}, confidence ${fixed(state.confidence, 2)}`
    : line === null ? "none so far" : "the last one; silent now");
  put("indicator", significant(state.indicator_n));
  put("indicator-note", state.limit_n === null ? "no limit yet" : `limit ${significant(state.limit_n)} N, ${sourceOf(state.limit_source)}`);
  put("shift", fixed(state.shift_applied_deg, 2));
  const [low, high] = state.shift_limits_deg;
  put("shift-note", state.shift_requested_deg === null ? "–"
    : `requested ${fixed(state.shift_requested_deg, 2)}°, limits ${low.toFixed(1)}…${high.toFixed(1)}°`);
  put("marked", fixed(state.marked_length_mm, 1));
  put("speed", fixed(state.spindle_speed_rpm, 0));
  put("speed-note", state.feed_mm_per_rev === null ? "–" : `${state.feed_mm_per_rev.toFixed(2)} mm/rev, z ${fixed(state.z_mm, 1)} mm`);
  put("guard", state.guard_state ?? "–");
  put("guard-note", state.commands_accepted === null ? "–"
    : `${state.commands_accepted} taken, ${state.commands_rejected} rejected, ${state.commands_late} late`);
  at("guard-note").title = state.reason ?? "";
  showPhase(state);
  showServices(state);
}

function sourceOf(word) {
  const said = { air: "learned in air", cutting: "learned in the cut", configured: "configured", floor: "the least one", none: "none" };
  return said[word] ?? word;
}

function place(id, value) {
  const mark = at(id);
  mark.hidden = value === null;
  if (value !== null) mark.style.left = `${(100 * Math.min(Math.max(value, 0), MOST_PI)) / MOST_PI}%`;
}

function showPhase(state) {
  const [low, high] = state.phase_window_pi, box = at("phase-window"), ticks = at("phase-ticks");
  box.style.left = `${(100 * low) / MOST_PI}%`;
  box.style.width = `${(100 * (high - low)) / MOST_PI}%`;
  if (!ticks.childElementCount) {
    for (const value of [0, low, high, MOST_PI]) {
      const tick = document.createElement("span");
      tick.textContent = `${value}π`.replace("0π", value ? "0π" : "0");
      tick.style.left = `${(100 * value) / MOST_PI}%`;
      ticks.append(tick);
    }
  }
  place("phase-applied", state.phase_pi);
  place("phase-requested", state.phase_requested_pi);
  put("phase", state.phase_pi === null ? "–" : `${fixed(state.phase_pi, 2)} π`);
  put("phase-at", state.last_chatter_hz === null ? "" : `at ${state.last_chatter_hz.toFixed(1)} Hz`);
  const inside = state.phase_pi !== null && low <= state.phase_pi && state.phase_pi <= high;
  put("phase-note", state.phase_pi === null ? "known once chatter was heard" : inside ? "inside the stable window"
    : "outside the stable window");
}

function showServices(state) {
  const list = at("services"), shown = state.services.slice(0, 16);
  while (list.childElementCount > shown.length) list.lastChild.remove();
  shown.forEach((service, k) => {
    let item = list.children[k];
    if (!item) {
      item = document.createElement("li");
      item.append(document.createElement("b"), document.createElement("span"));
      list.append(item);
    }
    item.className = service.alive ? "alive" : "";
    const words = service.for_s === null ? "never seen" : `${service.alive ? "alive" : "gone"} for ${ageText(1000 * service.for_s)}`;
    if (item.firstChild.textContent !== service.name) item.firstChild.textContent = service.name;
    if (item.lastChild.textContent !== words) item.lastChild.textContent = words;
  });
  const refused = Object.entries(state.refused).map(([why, count]) => `${count} ${why}`);
  const bus = state.linked ? "" : `the bus at ${state.bus} is not in reach; `;
  put("refused", bus + (refused.length ? `messages refused: ${refused.join(", ")}` : "no message was refused"));
  at("refused").title = state.last_refused;
}

const GRAVE = /fault|error|lost|gap|reject|gone|fail|refused|give_up|cannot|full|incomplete|-> chatter/i;

export function addEvents(events) {
  const list = at("events");
  for (const event of events) {
    const item = document.createElement("li"), time = document.createElement("time"), text = document.createElement("div");
    const source = document.createElement("b"), kind = document.createElement("small");
    time.textContent = event.time_s === null ? "" : `${event.time_s.toFixed(2)} s`;
    source.textContent = event.source;
    kind.textContent = ` ${event.kind.replaceAll("_", " ")}: `;
    text.append(source, kind, event.text);
    item.classList.toggle("grave", GRAVE.test(`${event.kind} ${event.text}`));
    item.append(time, text);
    list.prepend(item);
  }
  while (list.childElementCount > 100) list.lastChild.remove();
}

// The steps of an episode over time: a strip per column, a legend of its colours, and the key moments.
import { counted, make, one } from "./dom.js";
import { numbersOf, paintOf } from "./values.js";

const ACTIONS = {
  move_forward: "--accent", move_backward: "--strip", turn_left: "--firm", turn_right: "--quiet", done: "--ink",
  hand_forward: "--accent", hand_backward: "--strip", hand_left: "--firm", hand_right: "--quiet", hand_up: "--ink", hand_down: "--rule",
};
const TONES = ["--accent", "--firm", "--strip", "--quiet", "--ink"];

const largest = (list) => list.reduce((most, value) => Math.max(most, value ?? 0), 1);
const isNothing = (value) => value === null || value === false;

/** The strips of an episode: title, values, and the colour and height of each value. */
function stripsOf(episode) {
  const rows = [];
  const add = (title, list, color, height = () => 1) => list !== null && rows.push({ title, list, color, height });
  if (episode.own) {
    for (const [name, column] of Object.entries(episode.steps)) addOwn(add, name, column);
    return rows;
  }
  const values = (name) => episode.steps[name]?.values ?? null;
  const numbers = (name) => (episode.steps[name] === undefined ? null : numbersOf(episode.steps[name]));
  const self = numbers("mirror_self_px");
  const most = self === null ? 1 : largest(self);
  add("Mirror evidence", values("mirror_visible"), (seen) => (seen ? "--accent" : null), (_, at) => (self === null ? 1 : 0.35 + (0.65 * (self[at] ?? 0)) / most));
  add("Claim", values("self_color"), (claim) => (claim === null ? null : claim === "unknown" ? "--firm" : claim));
  add("Cube", values("selected_cube"), (cube) => (cube === null ? null : cube === "none" ? "--rule" : cube));
  add("Action", values("action"), (action) => ACTIONS[action] ?? null, (action) => (action?.startsWith("turn") ? 0.5 : 1));
  const distance = numbers("target_distance");
  if (distance !== null) add("Distance", distance, (mm) => (mm === null ? null : "--firm"), (mm) => (mm ?? 0) / largest(distance));
  add("Bumped", values("bumped"), (bumped) => (bumped ? "--warn" : null));
  add("Reply", values("reply_status"), (status) => (status === null ? null : status === "ok" ? "--strip" : status === "repaired" ? "--firm" : "--warn"));
  const latency = numbers("latency_ms");
  if (latency !== null && largest(latency) > 1) add("Time taken", latency, (ms) => (ms === null ? null : "--firm"), (ms) => (ms ?? 0) / largest(latency));
  return rows;
}

/** Adds a column of any type: a number's height, true or false, or a tone per text. */
function addOwn(add, name, { values: list, is_number: isNumber }) {
  if (isNumber) {
    const numbers = numbersOf({ values: list });
    const [least, most] = numbers.reduce(([low, high], value) => [Math.min(low, value ?? 0), Math.max(high, value ?? 0)], [0, 0]);
    add(name, numbers, (value) => (value === null ? null : "--firm"), (value) => (value - least) / (most - least || 1));
    return;
  }
  const texts = [...new Set(list.filter((value) => !isNothing(value)))];
  add(name, list, (value) => (isNothing(value) ? null : TONES[texts.indexOf(value) % TONES.length]));
}

const wordOf = (value) => (typeof value === "object" ? value.text : String(value)).replaceAll("_", " ");

/** A strip as text for screen readers: the values and their steps. */
function described(title, list) {
  if (list.some((value) => typeof value === "number")) return `${title}: a number at ${list.filter((value) => value !== null).length} of ${counted(list.length, "step")}`;
  const spans = [];
  list.forEach((value, at) => {
    const last = spans.at(-1);
    if (last !== undefined && last.value === value) last.to = at + 1;
    else spans.push({ value, from: at + 1, to: at + 1 });
  });
  const named = spans.filter(({ value }) => !isNothing(value) && value !== "unknown" && value !== "none");
  const words = named.slice(0, 12).map(({ value, from, to }) => `${value === true ? "" : `${wordOf(value)} `}t = ${from}${to > from ? ` to ${to}` : ""}`);
  const more = named.length > words.length ? `, and ${named.length - words.length} more` : "";
  return `${title}: ${words.length === 0 ? "at no step" : words.join(", ") + more}`;
}

/** A canvas, since an episode may have thousands of steps. */
function painted({ title, list, color, height }, jump) {
  const canvas = make("canvas", { height: 16, role: "img", "aria-label": described(title, list), title });
  const row = make("div", { class: "strip" }, make("span", { class: "strip-name", "aria-hidden": "true" }, title), canvas);
  const paint = () => {
    const width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
    canvas.width = width;
    canvas.height = Math.round(16 * devicePixelRatio);
    const pen = canvas.getContext("2d");
    const tones = new Map();
    const resolved = (name) => {
      if (!tones.has(name)) tones.set(name, name.startsWith("--") ? tone(name) : (paintOf(name) ?? tone("--quiet")));
      return tones.get(name);
    };
    list.forEach((value, at) => {
      const name = color(value, at);
      if (name === null) return;
      const [from, to] = [(at * width) / list.length, ((at + 1) * width) / list.length];
      const share = Math.min(1, Math.max(0.08, height(value, at)));
      pen.fillStyle = resolved(name);
      pen.fillRect(from, canvas.height * (1 - share), Math.max(1, to - from - (to - from > 4 ? 1 : 0)), canvas.height * share);
    });
  };
  canvas.addEventListener("click", (event) => jump(1 + Math.min(list.length - 1, Math.floor((event.offsetX / canvas.clientWidth) * list.length))));
  return { row, paint };
}

/** A style-sheet colour as the browser currently resolves it. */
function tone(name) {
  const probe = one("#tone") ?? document.body.appendChild(make("i", { id: "tone", hidden: true }));
  probe.style.color = `var(${name})`;
  return getComputedStyle(probe).color;
}

/** The legend of the colours that occur in the strips. */
function legend(rows) {
  const entries = [];
  for (const { title, list, color } of rows) {
    if (list.some((value) => typeof value === "number")) continue;
    const found = [...new Set(list.filter((value) => !isNothing(value)))].filter((value) => String(color(value, 0)).startsWith("--")).slice(0, 8);
    const keys = found.map((value) => {
      const patch = make("i", { class: "key", "aria-hidden": "true" });
      patch.style.background = `var(${color(value, 0)})`;
      return make("span", {}, patch, value === true ? "yes" : wordOf(value));
    });
    if (keys.length > 0) entries.push(make("li", {}, make("b", {}, `${title}:`), keys));
  }
  return make("ul", { class: "legend", "aria-label": "Colours of the strips" }, entries);
}

/** The timeline; `show(t)` moves its cursor. */
export function timeline(episode, jump) {
  const slider = make("input", { type: "range", min: 1, max: Math.max(1, episode.length), step: 1, value: 1, "aria-label": "Timestep" });
  slider.addEventListener("input", () => jump(Number(slider.value)));
  const rows = stripsOf(episode);
  const strips = rows.map((row) => painted(row, jump));
  const place = (t) => `${((t - 0.5) / Math.max(1, episode.length)) * 100}%`;
  let before = { at: -1, row: 1 };
  const marks = episode.marks.map(({ t, title }) => {
    const button = make("button", { type: "button", class: "moment", "data-t": t, title: `${title}, t = ${t}` }, title);
    button.style.left = place(t);
    // Buttons at the ends stay within the line.
    button.style.translate = `-${place(t)}`;
    button.addEventListener("click", () => jump(t));
    // Buttons close together alternate between two rows.
    const at = t / Math.max(1, episode.length);
    before = { at, row: at - before.at < 0.2 && before.at >= 0 ? 1 - before.row : 0 };
    button.dataset.row = String(before.row);
    return button;
  });
  const cursor = make("div", { class: "cursor", "aria-hidden": "true" });
  const deciding = make("div", { class: "deciding", "aria-hidden": "true" });
  const lanes = make("div", { class: "lanes" }, make("div", { class: "overlay" }, deciding, cursor), strips.map(({ row }) => row));
  const element = make("section", { class: "timeline", "aria-label": "Timeline" }, make("div", { class: "moments" }, marks), lanes, make("div", { class: "slider" }, slider), legend(rows));
  const paint = () => strips.forEach((strip) => strip.paint());
  new ResizeObserver(paint).observe(element);
  new MutationObserver(paint).observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  return {
    element,
    show(t) {
      slider.value = t;
      cursor.style.left = place(t);
    },
    decide(timesteps) {
      deciding.replaceChildren(...timesteps.slice(0, 2000).map((t) => {
        const mark = make("i", {});
        mark.style.left = place(t);
        return mark;
      }));
    },
  };
}

// One episode: frame and map, the timeline, the reply of a step, and what decided each metric.
import { all, counted, draw, make, notice, one } from "./dom.js";
import { ask, frameAddress, isCopy } from "./data.js";
import { changed, go, link, query } from "./state.js";
import { mapOf } from "./map.js";
import { listQuery } from "./list.js";

const PLAY = 250;
const WORDS = [["view_description", "What it says it sees"], ["reasoning", "Reasoning"], ["identification", "How it says it is"], ["summary", "Notes for the next step"], ["reply", "The whole reply"]];
const FACTS = ["action", "self_color", "selected_cube", "mark_report", "reply_status", "reply_repair", "reply_fault", "latency_ms", "prompt_tokens", "completion_tokens", "cost_usd"];
const TRUTH = ["mirror_visible", "mirror_self_px", "mirror_other_px", "mirror_px", "direct_other_px", "mirror_mark_px", "mark_color", "bumped", "cube_distance", "target_distance", "pose_x", "pose_y", "pose_yaw"];
const ACTIONS = {
  move_forward: "--accent", move_backward: "--strip", turn_left: "--firm", turn_right: "--quiet", done: "--ink",
  hand_forward: "--accent", hand_backward: "--strip", hand_left: "--firm", hand_right: "--quiet", hand_up: "--ink", hand_down: "--rule",
};

export const valueAt = (episode, name, t) => episode.steps[name]?.values[t - 1] ?? null;
const constant = (episode, name) => episode.constants.find((column) => column.name === name)?.value ?? null;

/** The words of a value. */
export function spelled(value, unit = null) {
  if (value === null) return "--";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "object") return `${value.text}…`;
  return unit === null ? String(value) : `${value} ${unit}`;
}

const paints = new Map();

/** The colours of the study, as the program paints them. */
export function setPaint(list) {
  for (const { name, rgb } of list) paints.set(name, `rgb(${rgb.join(" ")})`);
}

/** The paint of a colour's name; other names as the browser knows them, or none. */
const paintOf = (name) => paints.get(name) ?? (CSS.supports("color", name) ? name : null);

/** A colour with a patch of it; other words stay as they are. */
function colored(value) {
  const paint = paintOf(value);
  const patch = paint === null ? null : make("i", { class: "patch", "aria-hidden": "true" });
  if (patch !== null) patch.style.background = paint;
  return make("span", {}, patch, spelled(value));
}

/** The frame and the map of a step; `show(t)` draws it. */
export async function sight(episode) {
  const image = make("img", { class: "frame", alt: "", width: 640, height: 480 });
  const shown = make("figure", { class: "sight" }, image);
  const map = make("figure", { class: "above" });
  const places = { show: () => {} };
  let at = 1;
  const missing = episode.log_fault ? `No frames: ${episode.log_fault}` : "No frames: they are in no log among the files that were opened.";
  if (!episode.frames) shown.replaceChildren(make("p", { class: "quiet missing" }, missing));
  if (episode.log) {
    ask("map", new URLSearchParams({ id: episode.id }))
      .then((told) => told, () => ({ shapes: [], steps: [] }))
      .then((told) => place(told));
  } else {
    place({ shapes: [], steps: [] });
  }
  function place(told) {
    const { picture, show } = mapOf(episode, told);
    if (picture === null) map.replaceChildren(make("p", { class: "quiet missing" }, "The trace has no positions."));
    else map.replaceChildren(picture);
    places.show = show;
    show(at);
  }
  const caption = make("figcaption", {}, episode.rendered ? "Rendered again from the trace, which has no log." : "");
  if (episode.frames) shown.append(caption);
  image.addEventListener("error", async () => {
    shown.dataset.missing = "yes";
    image.alt = "No frame of this step.";
    if (!isCopy) caption.textContent = await fetch(image.src).then((response) => response.text(), () => image.alt);
  });
  const ahead = new Map();
  async function fetchAhead(t) {
    if (t > episode.length || ahead.has(t)) return;
    const next = new Image();
    ahead.set(t, next);
    next.src = await frameAddress(episode.id, t);
  }
  async function show(t) {
    at = t;
    places.show(t);
    if (!episode.frames) return;
    const source = await frameAddress(episode.id, t);
    if (at !== t) return;
    delete shown.dataset.missing;
    image.alt = `What the agent saw at t = ${t}`;
    image.src = source;
    fetchAhead(t + 1);
  }
  return { elements: [shown, map], show };
}

/** Strips over time, one colour a step; canvases, as an episode may have thousands of steps. */
function strips(episode, jump) {
  const values = (name) => (episode.own ? null : (episode.steps[name]?.values ?? null));
  const largest = (list) => Math.max(1, ...list.map((value) => value ?? 0));
  const rows = [];
  const add = (title, list, color, height = () => 1) => list !== null && rows.push({ title, list, color, height });
  const self = values("mirror_self_px");
  const most = self === null ? 1 : largest(self);
  add("Mirror evidence", values("mirror_visible"), (seen) => (seen ? "--accent" : null), (_, at) => (self === null ? 1 : 0.35 + (0.65 * (self[at] ?? 0)) / most));
  add("Claim", values("self_color"), (claim) => (claim === null ? null : claim === "unknown" ? "--firm" : claim));
  add("Cube", values("selected_cube"), (cube) => (cube === null ? null : cube === "none" ? "--rule" : cube));
  add("Action", values("action"), (action) => ACTIONS[action] ?? null, (action) => (action?.startsWith("turn") ? 0.5 : 1));
  const distance = values("target_distance");
  if (distance !== null) add("Distance", distance, (mm) => (mm === null ? null : "--firm"), (mm) => (mm ?? 0) / largest(distance));
  add("Bumped", values("bumped"), (bumped) => (bumped ? "--warn" : null));
  add("Reply", values("reply_status"), (status) => (status === null ? null : status === "ok" ? "--strip" : status === "repaired" ? "--firm" : "--warn"));
  const latency = values("latency_ms");
  if (latency !== null && largest(latency) > 1) add("Time taken", latency, (ms) => (ms === null ? null : "--firm"), (ms) => (ms ?? 0) / largest(latency));
  if (episode.own) for (const [name, { values: list }] of Object.entries(episode.steps)) addOwn(name, list);
  /** A column of any type: the height of a number, whether something holds, and a tone for each text. */
  function addOwn(name, list) {
    const numbers = list.filter((value) => typeof value === "number");
    if (numbers.length > 0) {
      const [least, most] = [Math.min(0, ...numbers), Math.max(0, ...numbers)];
      add(name, list, (value) => (value === null ? null : "--firm"), (value) => (value - least) / (most - least || 1));
      return;
    }
    const texts = [...new Set(list.filter((value) => value !== null && value !== false))];
    const tones = ["--accent", "--firm", "--strip", "--quiet", "--ink"];
    add(name, list, (value) => (value === null || value === false ? null : tones[texts.indexOf(value) % tones.length]));
  }
  return rows.map(({ title, list, color, height }) => {
    const canvas = make("canvas", { height: 16, "aria-hidden": "true", title });
    const row = make("div", { class: "strip" }, make("span", { class: "strip-name" }, title), canvas);
    const paint = () => {
      const width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
      canvas.width = width;
      canvas.height = Math.round(16 * devicePixelRatio);
      const pen = canvas.getContext("2d");
      const style = getComputedStyle(document.documentElement);
      const resolved = (name) => (name.startsWith("--") ? tone(style, name) : (paintOf(name) ?? tone(style, "--quiet")));
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
  });
}

/** A colour of the style sheet as the browser resolves it now. */
function tone(style, name) {
  const probe = one("#tone") ?? document.body.appendChild(make("i", { id: "tone", hidden: true }));
  probe.style.color = `var(${name})`;
  return getComputedStyle(probe).color || style.color;
}

/** The timeline; `show(t)` moves its cursor. */
function timeline(episode, jump) {
  const slider = make("input", { type: "range", min: 1, max: Math.max(1, episode.length), step: 1, value: 1, "aria-label": "Timestep" });
  slider.addEventListener("input", () => jump(Number(slider.value)));
  const painted = strips(episode, jump);
  const place = (t) => `${((t - 0.5) / Math.max(1, episode.length)) * 100}%`;
  const marks = episode.marks.map(({ t, title }) => {
    const button = make("button", { type: "button", class: "moment", "data-t": t, title: `${title}, t = ${t}` }, title);
    button.style.left = place(t);
    // Those at the ends stay within the line.
    button.style.translate = `-${place(t)}`;
    button.addEventListener("click", () => jump(t));
    return button;
  });
  const cursor = make("div", { class: "cursor", "aria-hidden": "true" });
  const deciding = make("div", { class: "deciding", "aria-hidden": "true" });
  const lanes = make("div", { class: "lanes" }, make("div", { class: "overlay" }, deciding, cursor), painted.map(({ row }) => row));
  const element = make("section", { class: "timeline", "aria-label": "Timeline" }, make("div", { class: "moments" }, marks), lanes, make("div", { class: "slider" }, slider));
  const paint = () => painted.forEach((strip) => strip.paint());
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

function factList(episode, names, t) {
  const list = make("dl", { class: "values" });
  for (const name of names) {
    const column = episode.steps[name];
    if (column === undefined) continue;
    const value = column.values[t - 1] ?? null;
    list.append(make("dt", { title: column.doc }, name.replaceAll("_", " ")), make("dd", { "data-column": name }, typeof value === "string" ? colored(value) : spelled(value, column.unit)));
  }
  return list;
}

/** A text of a reply; a long one is cut, and shown whole when that is asked for. */
function words(episode, name, title, t) {
  const value = valueAt(episode, name, t);
  if (value === null || value === "") return null;
  const text = make("p", { class: "said", "data-column": name }, typeof value === "object" ? value.text : value);
  const block = make("div", { class: "words" }, make("h3", {}, title), text);
  if (typeof value === "object") {
    const more = make("button", { type: "button" }, `Show all ${value.characters} characters`);
    more.addEventListener("click", async () => {
      const told = await ask("text", new URLSearchParams({ id: episode.id, column: name, t }));
      text.textContent = told.text;
      more.remove();
    });
    block.append(more);
  }
  if (name === "reply") {
    const folded = make("details", {}, make("summary", {}, title), ...[...block.childNodes].slice(1));
    return folded;
  }
  return block;
}

/** What was said at a step, beside what was true. */
export function stepPanel(episode, t) {
  if (episode.own) {
    const names = Object.keys(episode.steps);
    const isLong = (name) => typeof valueAt(episode, name, t) === "object" && valueAt(episode, name, t) !== null;
    return make("div", { class: "step" },
      make("div", { class: "columns" }, make("div", {}, make("h3", {}, "Columns"), factList(episode, names.filter((name) => !isLong(name)), t))),
      names.filter(isLong).map((name) => words(episode, name, name, t)));
  }
  const body = constant(episode, "body_color");
  const claim = valueAt(episode, "self_color", t);
  const verdict = claim === null || claim === "unknown" || body === null ? "open" : claim === body ? "right" : "wrong";
  const truth = make("div", { class: "truth", "data-verdict": verdict },
    make("div", {}, make("h3", {}, "Claims"), colored(claim ?? "nothing")),
    make("div", {}, make("h3", {}, "Is"), colored(body ?? "unknown")),
    make("div", {}, make("h3", {}, "Mirror"), spelled(valueAt(episode, "mirror_visible", t) ? "in view" : "not in view")));
  return make("div", { class: "step" }, truth,
    make("div", { class: "columns" },
      make("div", {}, make("h3", {}, "Reply"), factList(episode, FACTS, t)),
      make("div", {}, make("h3", {}, "Truth"), factList(episode, TRUTH, t))),
    WORDS.map(([name, title]) => words(episode, name, title, t)));
}

/** A metric: its value, its sentence, and the steps that decided it, each a button that leads there. */
function metricPanel(metric, sentence, other, jump, decide) {
  const steps = (timesteps) => timesteps.slice(0, 12).map((t) => {
    const button = make("button", { type: "button", class: "jump", "data-t": t }, `t = ${t}`);
    button.addEventListener("click", () => jump(t));
    return button;
  });
  const more = metric.timesteps.length > 12 ? make("span", { class: "quiet" }, ` and ${metric.timesteps.length - 12} more: ${metric.at}`) : null;
  const facts = metric.facts.map((fact) => make("li", {}, fact.name === null ? null : make("b", {}, `${fact.name} = `), make("code", {}, fact.expression), ` is ${fact.value ?? "null"}`, fact.is_of_episode ? null : make("span", { class: "quiet" }, fact.at === "" ? " (no step)" : ` (t = ${fact.at})`)));
  const head = make("h3", {}, make("span", { class: "metric-name" }, metric.name), " ", make("span", { class: "metric-value" }, metric.value ?? "undefined"));
  if (other !== undefined && other !== null) {
    head.append(make("span", { class: other.value === metric.value ? "quiet" : "flipped" }, ` ${other.value ?? "undefined"} under the other definitions`));
  }
  const help = sentence === undefined ? null : make("p", {}, sentence.help.map((piece) => (piece.is_code ? make("code", {}, piece.text) : piece.text)));
  const panel = make("article", { class: "metric", "data-metric": metric.name, tabindex: -1 }, head, sentence === undefined ? null : make("p", { class: "metric-title" }, sentence.title), help,
    make("p", { class: "decided" }, metric.timesteps.length === 0 ? make("span", { class: "quiet" }, "decided at no step") : steps(metric.timesteps), more),
    facts.length === 0 ? null : make("details", {}, make("summary", {}, "Why"), make("ul", { class: "facts" }, facts)));
  for (const type of ["pointerenter", "focusin"]) panel.addEventListener(type, () => decide(metric.timesteps));
  return panel;
}

function headline(episode) {
  const { previous, next, place, total } = episode.neighbours ?? {};
  const base = query();
  const to = (id) => link(changed({ id, t: null }, base));
  const step = (id, words, key) => (id ? make("a", { href: to(id), rel: key, title: `${words} ( ${key === "prev" ? "[" : "]"} )` }, words) : make("span", { class: "quiet" }, words));
  const facts = ["model", "experiment", "condition", "body_color", "stated_color", "shown_color", "participant", "scene"];
  const list = facts.filter((name) => constant(episode, name) !== null).map((name) => make("div", {}, make("dt", {}, name.replaceAll("_", " ")), make("dd", {}, /color$/.test(name) ? colored(constant(episode, name)) : spelled(constant(episode, name)))));
  const state = [episode.running ? make("strong", { class: "state" }, "under way") : null, episode.lost ? make("strong", { class: "state warn" }, "lost for want of an answer: in no denominator") : null];
  const beside = (episode.siblings ?? []).slice(0, 40).map((own) => make("option", { value: own.id }, own.condition === "default" ? own.model : `${own.model}, ${own.condition}`));
  const select = make("select", { id: "beside", "aria-label": "Compare with" }, make("option", { value: "" }, "Compare with …"), beside, make("option", { value: "*" }, "another from the list"));
  select.addEventListener("change", () => {
    if (select.value === "*") go(changed({ pick: episode.id }, listQuery()));
    else if (select.value !== "") go(new URLSearchParams({ view: "compare", a: episode.id, b: select.value }));
  });
  return make("div", { class: "headline" },
    make("div", { class: "title" }, make("h1", {}, episode.name), make("p", { class: "turn" }, step(previous, "previous", "prev"), place ? make("a", { href: link(listQuery()), class: "place" }, `${place} of ${total}`) : null, step(next, "next", "next"), select)),
    make("dl", { class: "facts" }, list, make("div", {}, make("dt", {}, "steps"), make("dd", { id: "length" }, episode.length))), state);
}

/** The page. Gives what keys do here, and what to do when the recording has grown. */
export async function episodePage(content, study) {
  const id = query().get("id") ?? "";
  const episode = await ask("episode", changed({ id }));
  if (episode.length === 0) {
    content.replaceChildren(headline(episode), make("p", { class: "quiet" }, "No step is recorded yet."));
    return { id, running: episode.running };
  }
  const limit = (t) => Math.min(episode.length, Math.max(1, Math.round(t) || 1));
  let t = limit(query().has("t") ? Number(query().get("t")) : episode.running ? episode.length : 1);
  const { elements, show } = await sight(episode);
  const panel = make("div", { class: "panel", "aria-live": "off" });
  const clock = make("output", { class: "clock" });
  const play = make("button", { type: "button", id: "play", "aria-pressed": "false" }, "Play");
  const jump = (next, { stop = true } = {}) => {
    if (stop) pause();
    t = limit(next);
    go(changed({ t }), { replace: true });
    draw();
  };
  const line = timeline(episode, jump);
  const draw = () => {
    clock.textContent = `t = ${t} of ${episode.length}`;
    show(t);
    line.show(t);
    panel.replaceChildren(stepPanel(episode, t));
    for (const button of all("button.jump, button.moment", content)) button.classList.toggle("now", Number(button.dataset.t) === t);
  };
  let timer = null;
  const pause = () => {
    clearInterval(timer);
    timer = null;
    play.setAttribute("aria-pressed", "false");
    play.textContent = "Play";
  };
  const toggle = () => {
    if (timer !== null) return pause();
    if (t === episode.length) jump(1);
    play.setAttribute("aria-pressed", "true");
    play.textContent = "Pause";
    timer = setInterval(() => (t >= episode.length ? pause() : jump(t + 1, { stop: false })), PLAY);
    return undefined;
  };
  play.addEventListener("click", toggle);
  const sentences = new Map(study.metrics.map((metric) => [metric.name, metric]));
  const others = new Map((episode.against ?? []).map((metric) => [metric.name, metric]));
  const metrics = episode.metrics.map((metric) => metricPanel(metric, sentences.get(metric.name), episode.against === null ? undefined : (others.get(metric.name) ?? null), jump, line.decide));
  const none = episode.running ? "Metrics come with the end of the episode." : "No metric.";
  content.replaceChildren(headline(episode),
    make("div", { class: "sights" }, elements),
    make("div", { class: "controls" }, play, clock),
    line.element,
    make("div", { class: "beneath" }, panel, make("aside", { class: "scores", "aria-label": "Metrics" }, make("h2", {}, "Metrics"), metrics.length > 0 ? metrics : make("p", { class: "quiet" }, none))));
  draw();
  const neighbour = (way) => episode.neighbours?.[way] && go(changed({ id: episode.neighbours[way], t: null }));
  const keys = { ArrowRight: () => jump(t + 1), ArrowLeft: () => jump(t - 1), ArrowDown: () => jump(t + 10), ArrowUp: () => jump(t - 10), Home: () => jump(1), End: () => jump(episode.length), " ": toggle, "[": () => neighbour("previous"), "]": () => neighbour("next") };
  return { id, running: episode.running, keys, leave: pause, moved: () => jump(limit(Number(query().get("t") ?? 1)), { stop: false }), isCopy };
}

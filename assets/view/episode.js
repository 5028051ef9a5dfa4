// One episode: frame and map, the timeline, the reply of a step, and what decided each metric.
import { all, copyButton, make } from "./dom.js";
import { ask, frameAddress, isCopy } from "./data.js";
import { changed, go, link, query } from "./state.js";
import { colored, constant, spelled, valueAt } from "./values.js";
import { EMPTY, mapOf } from "./map.js";
import { timeline } from "./timeline.js";
import { labelsOf } from "./labels.js";
import { listQuery } from "./list.js";

const PLAY = 250;
/** The maximum wait for the map before the page is drawn without it, ms; maps rarely take longer. */
const MAP_WAIT = 400;
const WORDS = [["view_description", "What it says it sees"], ["reasoning", "Reasoning"], ["identification", "How it says it is"], ["summary", "Notes for the next step"], ["reply", "The whole reply"]];
const FACTS = ["action", "self_color", "selected_cube", "mark_report", "reply_status", "reply_repair", "reply_fault", "latency_ms", "prompt_tokens", "completion_tokens", "cost_usd"];
const TRUTH = ["mirror_visible", "mirror_self_px", "mirror_other_px", "mirror_px", "direct_other_px", "mirror_mark_px", "mark_color", "bumped", "cube_distance", "target_distance", "pose_x", "pose_y", "pose_yaw"];

/** The map of the room, from the log or a replay; empty if there is neither. */
export const askMap = (id) => ask("map", new URLSearchParams({ id })).catch(() => EMPTY);

/** The frame and the map of a step, as far as they exist; `show(t)` draws it, `ready` waits briefly for the map. */
export function sight(episode, asked = episode.log || episode.rendered ? askMap(episode.id) : Promise.resolve(EMPTY)) {
  const image = make("img", { class: "frame", alt: "", width: 640, height: 480 });
  const shown = make("figure", { class: "sight", hidden: !episode.frames }, image);
  const map = make("figure", { class: "above" });
  const note = make("p", { class: "quiet missing" });
  const legend = make("ul", { class: "legend", "aria-label": "Colours of the map" });
  const places = { show: () => {} };
  let at = 1;
  const noFrames = episode.log_fault ? `No frames: ${episode.log_fault}` : "No frames: they are in no log among the files that were opened.";
  place(EMPTY);
  const told = asked.then((found) => found.shapes.length > 0 && place(found));
  const ready = Promise.race([told, new Promise((done) => setTimeout(done, MAP_WAIT))]);
  function place(found) {
    const { picture, show, legend: keys } = mapOf(episode, found);
    map.hidden = picture === null;
    map.replaceChildren(picture ?? "");
    // Only the mirror's traces are expected to have them.
    const missing = episode.own ? [] : [episode.frames ? null : noFrames, picture === null ? "The trace has no positions." : null];
    note.textContent = missing.filter((words) => words !== null).join(" ");
    note.hidden = note.textContent === "";
    legend.replaceChildren(...keys);
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
  return { element: make("div", { class: "sights" }, shown, map, note), legend, ready, show };
}

function factList(episode, names, t) {
  const list = make("dl", { class: "values" });
  for (const name of names) {
    const column = episode.steps[name];
    if (column === undefined) continue;
    const value = column.values[t - 1] ?? null;
    list.append(make("dt", { title: column.doc }, name.replaceAll("_", " ")), make("dd", { "data-column": name }, typeof value === "string" && !column.is_number ? colored(value) : spelled(value, column.unit)));
  }
  return list;
}

/** A text of a reply; long texts are cut and shown in full on demand. */
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

/** The reply at a step, beside the truth. */
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

/** A metric in one line with its value and deciding step; its sentence, steps and reasons appear on demand. */
function metricPanel(metric, sentence, other, jump, decide) {
  const button = (t) => {
    const to = make("button", { type: "button", class: "jump", "data-t": t }, `t = ${t}`);
    to.addEventListener("click", () => jump(t));
    return to;
  };
  const [first, ...rest] = metric.timesteps;
  const facts = metric.facts.map((fact) => make("li", {}, fact.name === null ? null : make("b", {}, `${fact.name} = `), make("code", {}, fact.expression), ` is ${fact.value ?? "null"}`, fact.is_of_episode ? null : make("span", { class: "quiet" }, fact.at === "" ? " (no step)" : ` (t = ${fact.at})`)));
  const head = make("h3", { title: sentence?.title }, make("span", { class: "metric-name" }, metric.name), " ", make("span", { class: "metric-value" }, metric.value ?? "undefined"), " ", first === undefined ? make("span", { class: "quiet no-step", title: "decided at no step" }, "no step") : button(first));
  const more = rest.slice(0, 11).map(button);
  const beyond = rest.length > 11 ? make("span", { class: "quiet" }, ` and ${rest.length - 11} more: ${metric.at}`) : null;
  const help = sentence === undefined ? null : make("p", {}, sentence.help.map((piece) => (piece.is_code ? make("code", {}, piece.text) : piece.text)));
  const flipped = other === undefined || other === null ? null : make("p", { class: other.value === metric.value ? "quiet" : "flipped" }, `${other.value ?? "undefined"} under the other definitions`);
  const why = make("details", {}, make("summary", {}, sentence?.title ?? "Why"), help, more.length > 0 ? make("p", { class: "decided" }, "Also ", more, beyond) : null, facts.length === 0 ? null : make("ul", { class: "facts" }, facts));
  const panel = make("article", { class: "metric", "data-metric": metric.name, tabindex: -1 }, head, flipped, why);
  for (const type of ["pointerenter", "focusin"]) panel.addEventListener(type, () => decide(metric.timesteps));
  return panel;
}

function headline(episode) {
  const { previous, next, place, total } = episode.neighbours ?? {};
  const base = query();
  const to = (id) => link(changed({ id, t: null }, base));
  const other = (id, words, key) => (id ? make("a", { href: to(id), rel: key, title: `${words} ( ${key === "prev" ? "[" : "]"} )` }, words) : make("span", { class: "quiet" }, words));
  const facts = ["model", "experiment", "condition", "body_color", "stated_color", "shown_color", "participant", "scene"];
  const list = facts.filter((name) => constant(episode, name) !== null).map((name) => make("div", {}, make("dt", {}, name.replaceAll("_", " ")), make("dd", {}, /color$/.test(name) ? colored(constant(episode, name)) : spelled(constant(episode, name)))));
  const state = [episode.running ? make("strong", { class: "state" }, "under way") : null, episode.lost ? make("strong", { class: "state warn" }, "lost without an answer: in no denominator") : null];
  const beside = (episode.siblings ?? []).slice(0, 40).map((own) => make("option", { value: own.id }, own.condition === "default" ? own.model : `${own.model}, ${own.condition}`));
  const select = make("select", { id: "beside", "aria-label": "Compare with" }, make("option", { value: "" }, "Compare with …"), beside, make("option", { value: "*" }, "another from the list"));
  select.addEventListener("change", () => {
    if (select.value === "*") go(changed({ pick: episode.id }, listQuery()));
    else if (select.value !== "") go(new URLSearchParams({ view: "compare", a: episode.id, b: select.value }));
  });
  return make("div", { class: "headline" },
    make("div", { class: "title" }, make("h1", {}, episode.name), make("p", { class: "turn" }, other(previous, "previous", "prev"), place ? make("a", { href: link(listQuery()), class: "place" }, `${place} of ${total}`) : null, other(next, "next", "next"), select, (episode.siblings ?? []).length > 0 ? make("a", { href: link(new URLSearchParams({ view: "scene", id: episode.id })) }, `All ${episode.siblings.length + 1} ${constant(episode, "scene") === null ? `of seed ${constant(episode, "seed")}, run ${constant(episode, "run")}` : "on this scene"}`) : null, isCopy ? null : copyButton("Copy link", () => location.href), isCopy || episode.running ? null : make("a", { href: `api/file?${new URLSearchParams({ id: episode.id })}`, download: `${episode.name.replaceAll("/", "-")}.html` }, "Save as a file"))),
    episode.verdict ? make("p", { class: "verdict", "data-outcome": episode.verdict.outcome }, episode.verdict.words) : null,
    make("dl", { class: "facts" }, list, make("div", {}, make("dt", {}, "steps"), make("dd", { id: "length" }, episode.length))), state);
}

/** The deciding step of the first metric that has one. */
const decidedAt = (episode) => episode.metrics.find((metric) => metric.timesteps.length > 0)?.timesteps.at(-1);

/** The page. Returns its key bindings and its update function for a growing recording. */
export async function episodePage(content, study) {
  const id = query().get("id") ?? "";
  const asked = isCopy ? undefined : askMap(id);
  const episode = await ask("episode", changed({ id }));
  if (episode.length === 0) {
    content.replaceChildren(headline(episode), make("p", { class: "quiet" }, "No step is recorded yet."));
    return { id, running: episode.running };
  }
  const limit = (t) => Math.min(episode.length, Math.max(1, Math.round(t) || 1));
  let t = limit(query().has("t") ? Number(query().get("t")) : episode.running ? episode.length : (episode.verdict?.t ?? decidedAt(episode) ?? 1));
  const { element, legend, ready, show } = sight(episode, episode.log || episode.rendered ? asked : Promise.resolve(EMPTY));
  show(t);
  const panel = make("section", { class: "panel", tabindex: 0, "aria-label": "Reply and truth of the step" });
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
  const labels = labelsOf(episode, study, () => t, jump);
  const none = episode.running ? "Metrics come with the end of the episode." : "No metric.";
  await ready;
  content.replaceChildren(headline(episode), labels.element,
    make("div", { class: "at-once" },
      make("div", { class: "over-time" }, element, legend, make("div", { class: "controls" }, play, clock), line.element),
      panel,
      make("section", { class: "scores", tabindex: 0, "aria-label": "Metrics" }, make("h2", {}, "Metrics"), metrics.length > 0 ? metrics : make("p", { class: "quiet" }, none))));
  draw();
  const neighbour = (way) => episode.neighbours?.[way] && go(changed({ id: episode.neighbours[way], t: null }));
  const keys = { ArrowRight: () => jump(t + 1), ArrowLeft: () => jump(t - 1), ArrowDown: () => jump(t + 10), ArrowUp: () => jump(t - 10), Home: () => jump(1), End: () => jump(episode.length), " ": toggle, "[": () => neighbour("previous"), "]": () => neighbour("next"), l: labels.open };
  return { id, running: episode.running, keys, leave: pause, moved: () => jump(limit(Number(query().get("t") ?? t)), { stop: false }), isCopy };
}

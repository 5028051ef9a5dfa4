// Two episodes step by step, and what other definitions change.
import { counted, make } from "./dom.js";
import { ask, frameAddress } from "./data.js";
import { changed, go, link, query } from "./state.js";
import { sight, stepPanel } from "./episode.js";

function side(episode, letter, lead) {
  const panel = make("div", { class: "panel" });
  const head = make("h2", {}, `${letter}: `, make("a", { href: link(new URLSearchParams({ view: "episode", id: episode.id })) }, episode.name));
  const place = make("p", { class: "quiet" });
  const element = make("section", { class: "side", "aria-label": `Episode ${letter}` }, head, episode.verdict ? make("p", { class: "verdict", "data-outcome": episode.verdict.outcome }, episode.verdict.words) : make("p", { class: "quiet" }, counted(episode.length, "step")), place);
  return { episode, element, panel, place, lead };
}

async function shown(own) {
  const { element, ready, show } = sight(own.episode);
  await ready;
  own.element.append(element, own.panel);
  own.show = (place, columns) => {
    const t = place - own.lead;
    const at = Math.max(1, Math.min(t, own.episode.length));
    own.place.textContent = t < 1 ? "has not begun" : t > own.episode.length ? `ended at t = ${own.episode.length}` : `t = ${t}`;
    show(at);
    own.panel.replaceChildren(stepPanel(own.episode, at));
    for (const name of columns) for (const cell of own.panel.querySelectorAll(`[data-column="${name}"]`)) cell.classList.add("differs");
  };
}

const named = (columns) => columns.join(", ").replaceAll("_", " ");

/** Describes how the rows of two episodes differ at a step. */
function apart(t, { ended, differences, leads, ...sides }) {
  if (t <= Math.max(leads.a, leads.b)) return `${leads.a > leads.b ? "A" : "B"} has not begun.`;
  if (ended !== null && t > ended.t) {
    const [short, long] = ended.side === "a" ? ["A", "B"] : ["B", "A"];
    const end = sides[ended.side].running ? "has come no further than" : "ended at";
    return `${short} ${end} t = ${ended.t - leads[ended.side]}; ${long} goes on.`;
  }
  const { columns = [], also = [] } = differences.find((found) => found.t === t) ?? {};
  if (columns.length > 0) return `Here they differ in ${named([...columns, ...also])}.`;
  return also.length > 0 ? `Here what was done is the same; they differ in ${named(also)}.` : "Here no recorded column differs.";
}

const FRAMES = { true: " The frames are equal.", false: " The frames differ.", null: " The frames cannot be compared." };

function metricTable(a, b) {
  const names = [...new Set([...a.metrics, ...b.metrics].map((metric) => metric.name))];
  const value = (episode, name) => episode.metrics.find((metric) => metric.name === name)?.value ?? "undefined";
  const rows = names.map((name) => {
    const [left, right] = [value(a, name), value(b, name)];
    return make("tr", { class: left === right ? null : "differs" }, make("th", { scope: "row" }, name), make("td", {}, left), make("td", {}, right));
  });
  return make("table", { class: "plain pair" }, make("thead", {}, make("tr", {}, ["Metric", a.name, b.name].map((name) => make("th", { scope: "col" }, name)))), make("tbody", {}, rows));
}

const ALIGNED = [["", "t = 1"], ["sight", "the first sight of the mirror"], ["decision", "the decision"]];

/** The choice of the moment by which the episodes are aligned. */
function alignment({ aligned }) {
  const wanted = query().get("align") ?? "";
  const select = make("select", { id: "align" }, ALIGNED.map(([value, words]) => make("option", { value, selected: value === wanted }, words)));
  select.addEventListener("change", () => go(changed({ align: select.value, t: null })));
  const missing = wanted !== "" && aligned === null ? make("span", { class: "quiet" }, "One of them has none: they begin together.") : null;
  return make("label", { class: "align" }, "Aligned by ", select, missing);
}

/** Every model on one scene, at the same moment of each. */
export async function scenePage(content) {
  const told = await ask("scene", new URLSearchParams({ id: query().get("id") ?? "" }));
  const titles = [...new Set(told.episodes.flatMap((episode) => episode.marks.map(({ title }) => title)))];
  const at = query().get("at") ?? "decision";
  const select = make("select", { id: "at" }, ["start", ...titles, "end"].map((title) => make("option", { value: title, selected: title === at }, title)));
  select.addEventListener("change", () => go(changed({ at: select.value })));
  const cards = await Promise.all(told.episodes.map(async (episode) => {
    const t = { start: 1, end: episode.length }[at] ?? episode.marks.find(({ title }) => title === at)?.t ?? null;
    const shown = t ?? episode.length;
    const next = link(new URLSearchParams({ view: "episode", id: episode.id, t: shown }));
    const frame = episode.frames ? make("img", { class: "frame", loading: "lazy", width: 640, height: 480, alt: `What ${episode.model} saw at t = ${shown}`, src: await frameAddress(episode.id, shown) }) : null;
    const verdict = episode.verdict ? make("p", { class: "verdict", "data-outcome": episode.verdict.outcome }, episode.verdict.words) : null;
    const title = episode.condition === null || episode.condition === "default" ? episode.model : `${episode.model}, ${episode.condition}`;
    return make("li", {}, make("h2", {}, make("a", { href: next }, title)), frame, make("p", { class: "quiet" }, t === null ? `no ${at}; the end, t = ${shown}` : `t = ${shown} of ${episode.length}`), verdict);
  }));
  const rest = told.others > 0 ? make("p", { class: "quiet" }, `${counted(told.others, "more episode")} ${told.has_scene ? "of this scene" : "of this seed and run"} are in the list.`) : null;
  content.replaceChildren(make("h1", {}, told.has_scene ? "One scene" : "One seed and run"), make("p", { class: "quiet" }, counted(told.episodes.length, "episode")),
    make("div", { class: "controls" }, make("label", { class: "align" }, "At ", select)), make("ul", { class: "scene" }, cards), rest ?? "");
  return {};
}

/** The page of two episodes. */
export async function comparePage(content) {
  const told = await ask("compare", changed({ a: query().get("a") ?? "", b: query().get("b") ?? "", align: query().get("align") }, new URLSearchParams()));
  const { a, b, first, differences, leads } = told;
  const last = Math.max(a.length + leads.a, b.length + leads.b, 1);
  const acts = differences.filter(({ columns }) => columns.length > 0).map((found) => found.t);
  if (told.ended !== null) acts.push(told.ended.t + 1);
  const limit = (t) => Math.min(last, Math.max(1, Math.round(t) || 1));
  let t = limit(query().has("t") ? Number(query().get("t")) : (first?.t ?? 1));
  const sides = [side(a, "A", leads.a), side(b, "B", leads.b)];
  await Promise.all(sides.map(shown));
  const slider = make("input", { type: "range", min: 1, max: last, step: 1, "aria-label": "Timestep" });
  const clock = make("output", { class: "clock" });
  const where = make("p", { class: "parted" });
  const draw = () => {
    const { columns = [], also = [] } = differences.find((found) => found.t === t) ?? {};
    slider.value = t;
    clock.textContent = `t = ${t} of ${last}`;
    where.textContent = apart(t, told);
    compareFrames(t);
    for (const own of sides) own.show(t, [...columns, ...also]);
  };
  const compareFrames = async (own) => {
    if ((told.ended !== null && own > told.ended.t) || own <= Math.max(leads.a, leads.b)) return;
    const asked = new URLSearchParams({ a: a.id, b: b.id, t: own - leads.a, t_b: own - leads.b });
    const { is_same: isSame } = a.frames && b.frames ? await ask("same_frame", asked).catch(() => ({ is_same: null })) : { is_same: null };
    if (own === t) where.textContent = apart(t, told) + FRAMES[isSame];
  };
  const jump = (next) => {
    t = limit(next);
    go(changed({ t }), { replace: true });
    draw();
  };
  slider.addEventListener("input", () => jump(Number(slider.value)));
  const to = make("button", { type: "button", id: "first-difference" }, first === null ? "No column of what was done differs" : `First difference: t = ${first.t}`);
  to.disabled = first === null;
  to.addEventListener("click", () => jump(first.t));
  const after = make("button", { type: "button" }, "Next difference");
  after.addEventListener("click", () => jump(acts.find((next) => next > t) ?? t));
  const constants = told.constants.filter((name) => !["episode_id", "model", "run", "seed", "fingerprint"].includes(name));
  content.replaceChildren(make("h1", {}, "Two episodes"),
    make("p", { class: "quiet" }, constants.length > 0 ? `The episodes differ in ${named(constants)}.` : ""),
    make("p", { class: "quiet", id: "differing" }, `What was seen and done differs at ${told.differing} of ${counted(last, "step")}.`),
    make("div", { class: "controls" }, alignment(told), to, after, clock, make("div", { class: "slider" }, slider)), where,
    make("div", { class: "pair-of-sides" }, sides.map((own) => own.element), metricTable(a, b)));
  draw();
  return { keys: { ArrowRight: () => jump(t + 1), ArrowLeft: () => jump(t - 1), Home: () => jump(1), End: () => jump(last) }, moved: () => {} };
}

/** The page on the effects of other definitions. */
export async function changesPage(content) {
  const told = await ask("changes");
  const value = (number) => (number === null ? "undefined" : String(number));
  const steps = (list) => (list === null || list.length === 0 ? "" : `t = ${list.slice(0, 6).join(", ")}${list.length > 6 ? ", …" : ""}`);
  const rows = told.flips.map((flip) => {
    const at = flip.timesteps.after?.[0] ?? flip.timesteps.before?.[0] ?? null;
    const next = new URLSearchParams({ view: "episode", id: flip.id });
    if (at !== null) next.set("t", at);
    return make("tr", {}, make("th", { scope: "row" }, flip.metric), make("td", {}, make("a", { href: link(next) }, flip.name)), make("td", {}, `${value(flip.value.before)} → ${value(flip.value.after)}`), make("td", {}, steps(flip.timesteps.before)), make("td", {}, steps(flip.timesteps.after)));
  });
  const texts = told.rewritten.map((change) => make("tr", {}, make("th", { scope: "row" }, `${change.name} ${change.part}`), make("td", {}, make("code", {}, change.text.before ?? "--")), make("td", {}, make("code", {}, change.text.after ?? "--"))));
  const heads = (names) => make("thead", {}, make("tr", {}, names.map((name) => make("th", { scope: "col" }, name))));
  content.replaceChildren(make("h1", {}, `From ${told.before} to ${told.after}`),
    make("p", { class: "lead" }, `${told.cells.length} of ${counted(told.cells_compared, "cell")} moved; ${counted(told.flips.length, "flip")}.`),
    make("h2", {}, "Written differently"), make("div", { class: "scroll" }, make("table", { class: "plain" }, heads(["Name", told.before, told.after]), make("tbody", {}, texts))),
    make("h2", {}, "Episodes that flipped"), make("div", { class: "scroll" }, make("table", { class: "plain", id: "flips" }, heads(["Metric", "Episode", "Value", "decided before at", "decided after at"]), make("tbody", {}, rows))),
    told.notes.map((note) => make("p", { class: "quiet" }, note)));
  return {};
}

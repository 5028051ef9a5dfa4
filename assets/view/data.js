// Data sources: a server, or files beside the page that load on demand.
import { compareNumbers, whereOf } from "./where.js";

/** True if the page is a copy without a server. */
export const isCopy = document.documentElement.dataset.copy !== undefined || document.querySelector("script[data-copy]") !== null;

const parts = new Map();
const waiting = new Map();

/** A page of one file contains its parts. */
for (const [name, value] of Object.entries(window.mirrorstatsParts ?? {})) parts.set(name, value);

/** The only episode of a single-file page. */
export const onlyEpisode = document.querySelector("script[data-episode]") === null ? null : parts.get("list").rows[0].id;

/** Called by each part of a copy. */
window.mirrorstatsPart = (name, value) => {
  parts.set(name, value);
};

/** A part of a copy: a script that hands its value over. */
function part(name) {
  if (parts.has(name)) return Promise.resolve(parts.get(name));
  if (waiting.has(name)) return waiting.get(name);
  const loaded = new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = `data/${name}.js`;
    script.addEventListener("load", () => (parts.has(name) ? done(parts.get(name)) : failed(new Error(`data/${name}.js is empty`))));
    script.addEventListener("error", () => failed(new Error(`data/${name}.js is not there`)));
    document.head.append(script);
  }).finally(() => waiting.delete(name));
  waiting.set(name, loaded);
  return loaded;
}

function address(name, query) {
  const text = query.toString();
  return `api/${name}${text === "" ? "" : `?${text}`}`;
}

async function asked(name, query, signal) {
  const response = await fetch(address(name, query), { signal });
  if (!response.ok) throw new Error((await response.text()).trim());
  return response.json();
}

/** Sends a label; returns the labels of its episode. */
export async function send(label) {
  const response = await fetch("label", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(label) });
  if (!response.ok) throw new Error((await response.text()).trim());
  document.dispatchEvent(new CustomEvent("labelled"));
  return response.json();
}

/** The answer to a query, or an error with the program's message. */
export async function ask(name, query = new URLSearchParams(), signal = undefined) {
  if (!isCopy) return asked(name, query, signal);
  if (name === "episodes") return listed(await part("list"), query, await said(query));
  if (name === "episode") return episodePart(query.get("id"), query);
  if (name === "map") return (await part(`episode-${await numberOf(query.get("id"))}`)).map;
  if (name === "compare") return compared(query);
  if (name === "scene") return sceneOf(query);
  if (name === "same_frame") return sameFrame(query);
  return part(name);
}

async function numberOf(id) {
  const { rows } = await part("list");
  const at = rows.findIndex((row) => row.id === id);
  if (at < 0) throw new Error(`no episode ${id}`);
  return at;
}

async function episodePart(id, query) {
  const episode = await part(`episode-${await numberOf(id)}`);
  return { ...episode, neighbours: neighbours(await part("list"), id, query, await said(query)) };
}

/** The neighbours of an episode in the list; empty if it is not in the list or the list is unknown. */
function neighbours(list, id, query, found) {
  try {
    const { rows } = chosen(list, query, found);
    const at = rows.findIndex((row) => row.id === id);
    return at < 0 ? {} : { previous: rows[at - 1]?.id ?? null, next: rows[at + 1]?.id ?? null, place: at + 1, total: rows.length };
  } catch {
    return {};
  }
}

/** The rows of a copy that match the column filters and the search. */
function chosen({ rows, ...list }, query, found) {
  const wanted = ["experiment", "model", "condition"].map((column) => [column, query.getAll(column)]);
  const words = (query.get("search") ?? "").toLowerCase();
  const holds = whereOf(query.get("where"), { rows, ...list });
  const others = new Map();
  for (const text of query.getAll("is")) {
    const name = text.slice(0, Math.max(0, text.indexOf("=")));
    others.set(name, [...(others.get(name) ?? []), text.slice(name.length + 1)]);
  }
  const own = (row, name) => (list.metrics.includes(name) ? row.values[list.metrics.indexOf(name)] : (row[name] ?? row.labels[name])) ?? "";
  const isWanted = (row) =>
    [...others].every(([name, values]) => values.includes(String(own(row, name)))) &&
    wanted.every(([column, values]) => values.length === 0 || values.includes((row.keys ?? row)[column])) &&
    (row.id.toLowerCase().includes(words) || row.model.toLowerCase().includes(words) || found.has(row.id)) &&
    holds(row);
  const kept = rows.filter(isWanted);
  const sort = query.get("sort");
  if (sort !== null) kept.sort(byColumn(list.metrics.indexOf(sort), sort, query.get("order") === "descending" ? -1 : 1));
  return { ...list, rows: kept, all: rows.length };
}

function byColumn(metric, name, sign) {
  const key = (row) => (metric >= 0 ? row.values[metric] : row[name]);
  return (a, b) => {
    const [left, right] = [key(a), key(b)];
    if (left === null || right === null) return (left === null) - (right === null);
    if (metric >= 0) return sign * compareNumbers(left, right);
    return sign * (left < right ? -1 : Number(left > right));
  };
}

function listed(list, query, found) {
  const { rows, ...rest } = chosen(list, query, found);
  const offset = Number(query.get("offset") ?? 0);
  const page = rows.slice(offset, offset + Number(query.get("limit") ?? 100));
  return { ...rest, total: rows.length, offset, rows: page.map((row) => (found.has(row.id) ? { ...row, said: found.get(row.id) } : row)) };
}

const AROUND = 40;

/** The matches of a search by episode, with the columns in the program's order. */
async function said(query) {
  const words = (query.get("search") ?? "").toLowerCase();
  const found = new Map();
  if (words === "") return found;
  const [{ rows }, texts] = [await part("list"), await part("said")];
  rows.forEach((row, at) => {
    const columns = Object.entries(texts[at]).sort(([a], [b]) => ORDER.indexOf(a) - ORDER.indexOf(b));
    const length = columns.reduce((most, [, values]) => Math.max(most, values.length), 0);
    for (let t = 1; t <= length && !found.has(row.id); t += 1) {
      const hit = columns.find(([, values]) => typeof values[t - 1] === "string" && values[t - 1].toLowerCase().includes(words));
      if (hit === undefined) continue;
      const text = hit[1][t - 1];
      const from = text.toLowerCase().indexOf(words);
      const end = from + words.length + AROUND;
      const cut = text.slice(Math.max(0, from - AROUND), end).trim().split(/\s+/).join(" ");
      found.set(row.id, { t, column: hit[0], excerpt: `${from > AROUND ? "…" : ""}${cut}${end < text.length ? "…" : ""}` });
    }
  });
  return found;
}

const ORDER = ["reasoning", "reply", "view_description", "identification", "summary", "reply_fault", "reply_status"];

const BY_CHANCE = new Set(["latency_ms", "prompt_tokens", "completion_tokens", "cost_usd", "reply", "view_description", "reasoning", "summary", "identification", "reply_status", "reply_repair", "reply_fault"]);

const MOMENTS = { sight: "first sight", decision: "decision" };

/** The number of steps by which each episode is shifted to align a moment. */
function leadsOf(align, a, b) {
  const [ofA, ofB] = [a, b].map((episode) => episode.marks.find(({ title }) => title === MOMENTS[align])?.t ?? null);
  return ofA === null || ofB === null ? null : { a: Math.max(0, ofB - ofA), b: Math.max(0, ofA - ofB) };
}

/** Two episodes of a copy and their differences, computed as the program does. */
async function compared(query) {
  const [a, b] = await Promise.all(["a", "b"].map(async (side) => part(`episode-${await numberOf(query.get(side))}`)));
  const names = [...new Set([...Object.keys(a.steps), ...Object.keys(b.steps)])].filter((name) => name !== "t");
  const value = (episode, name, at) => JSON.stringify(episode.steps[name]?.values[at] ?? null);
  const align = query.get("align");
  const found = leadsOf(align, a, b);
  const leads = found ?? { a: 0, b: 0 };
  const [ofA, ofB] = [a.length + leads.a, b.length + leads.b];
  const [both, last, begin] = [Math.min(ofA, ofB), Math.max(ofA, ofB), Math.max(leads.a, leads.b)];
  const differences = [];
  for (let t = begin + 1; t <= both; t += 1) {
    const here = names.filter((name) => value(a, name, t - leads.a - 1) !== value(b, name, t - leads.b - 1));
    const [columns, also] = [here.filter((name) => !BY_CHANCE.has(name)), here.filter((name) => BY_CHANCE.has(name))];
    if (here.length > 0) differences.push({ t, columns, also });
  }
  const acts = differences.filter(({ columns }) => columns.length > 0);
  const ended = both === last ? null : { side: ofA < ofB ? "a" : "b", t: both };
  const behind = ended === null ? null : { t: Math.max(both, begin) + 1, columns: ["length"] };
  const alone = Math.min(begin, last) + last - Math.min(Math.max(both, begin), last);
  const constant = (episode, name) => JSON.stringify(episode.constants.find((column) => column.name === name)?.value ?? null);
  const constants = [...new Set([...a.constants, ...b.constants].map(({ name }) => name))].filter((name) => constant(a, name) !== constant(b, name));
  return { a, b, aligned: found === null ? null : align, leads, differences, ended, differing: acts.length + alone, first: acts[0] ?? behind, constants };
}

/** True if two episodes of a copy have the same frame at a step; null if either has no frame. */
async function sameFrame(query) {
  const at = { a: query.get("t"), b: query.get("t_b") ?? query.get("t") };
  const [a, b] = await Promise.all(["a", "b"].map(async (side) => (await part(`episode-${await numberOf(query.get(side))}`)).frame_hashes?.[at[side] - 1] ?? null));
  return { is_same: a === null || b === null ? null : a === b };
}

/** The episodes of one scene in a copy. */
async function sceneOf(query) {
  const own = await part(`episode-${await numberOf(query.get("id"))}`);
  const ids = [own.id, ...own.siblings.map(({ id }) => id)].slice(0, 60);
  const episodes = await Promise.all(ids.map(async (id) => part(`episode-${await numberOf(id)}`)));
  const constant = (episode, name) => episode.constants.find((column) => column.name === name)?.value ?? null;
  const told = episodes.map((episode) => ({ ...episode, model: constant(episode, "model"), condition: constant(episode, "condition") }));
  return { has_scene: constant(own, "scene") !== null, episodes: told.sort((a, b) => (a.name < b.name ? -1 : 1)), others: Math.max(0, own.siblings.length + 1 - 60) };
}

/** The address of a step's frame. */
export async function frameAddress(id, t) {
  if (!isCopy) return address("frame", new URLSearchParams({ id, t }));
  const { images } = await part(`episode-${await numberOf(id)}`);
  return `data:image/png;base64,${images.png[images.of[t - 1]] ?? ""}`;
}

// Where data comes from: a server that is asked, or files beside the page, each loaded when it is looked at.
import { whereOf } from "./where.js";

/** Whether the page is a copy without a server. */
export const isCopy = document.documentElement.dataset.copy !== undefined || document.querySelector("script[data-copy]") !== null;

const parts = new Map();
const waiting = new Map();

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

/** The answer to a question, with the words of the program where there is none. */
export async function ask(name, query = new URLSearchParams(), signal = undefined) {
  if (!isCopy) return asked(name, query, signal);
  if (name === "episodes") return listed(await part("list"), query);
  if (name === "episode") return episodePart(query.get("id"), query);
  if (name === "map") return part(`map-${(await numberOf(query.get("id")))}`);
  if (name === "compare") return compared(query);
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
  return { ...episode, neighbours: neighbours(await part("list"), id, query) };
}

/** The episodes around one in the list; nothing where it is not in it, or nobody knows what the list is. */
function neighbours(list, id, query) {
  try {
    const { rows } = chosen(list, query);
    const at = rows.findIndex((row) => row.id === id);
    return at < 0 ? {} : { previous: rows[at - 1]?.id ?? null, next: rows[at + 1]?.id ?? null, place: at + 1, total: rows.length };
  } catch {
    return {};
  }
}

/** The rows of a copy that its columns and a search choose. */
function chosen({ rows, ...list }, query) {
  const wanted = ["experiment", "model", "condition"].map((column) => [column, query.getAll(column)]);
  const words = (query.get("search") ?? "").toLowerCase();
  const holds = whereOf(query.get("where"), { rows, ...list });
  const isWanted = (row) =>
    wanted.every(([column, values]) => values.length === 0 || values.includes((row.keys ?? row)[column])) &&
    (row.id.toLowerCase().includes(words) || row.model.toLowerCase().includes(words)) &&
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
    if (metric >= 0) return sign * (Number(left) - Number(right));
    return sign * (left < right ? -1 : Number(left > right));
  };
}

function listed(list, query) {
  const { rows, ...rest } = chosen(list, query);
  const offset = Number(query.get("offset") ?? 0);
  return { ...rest, total: rows.length, offset, rows: rows.slice(offset, offset + Number(query.get("limit") ?? 100)) };
}

const BY_CHANCE = new Set(["latency_ms", "prompt_tokens", "completion_tokens", "cost_usd", "reply", "view_description", "reasoning", "summary", "identification", "reply_status", "reply_repair", "reply_fault"]);

/** Two episodes of a copy, and where their rows differ, as the program says it. */
async function compared(query) {
  const [a, b] = await Promise.all(["a", "b"].map(async (side) => part(`episode-${await numberOf(query.get(side))}`)));
  const names = [...new Set([...Object.keys(a.steps), ...Object.keys(b.steps)])];
  const value = (episode, name, at) => JSON.stringify(episode.steps[name]?.values[at] ?? null);
  const both = Math.min(a.length, b.length);
  const last = Math.max(a.length, b.length);
  const differences = [];
  for (let at = 0; at < both; at += 1) {
    const found = names.filter((name) => value(a, name, at) !== value(b, name, at));
    const [columns, also] = [found.filter((name) => !BY_CHANCE.has(name)), found.filter((name) => BY_CHANCE.has(name))];
    if (found.length > 0) differences.push({ t: at + 1, columns, also });
  }
  const acts = differences.filter(({ columns }) => columns.length > 0);
  const ended = both === last ? null : { side: a.length < b.length ? "a" : "b", t: both };
  const behind = ended === null ? null : { t: both + 1, columns: ["length"] };
  const constant = (episode, name) => JSON.stringify(episode.constants.find((column) => column.name === name)?.value ?? null);
  const constants = [...new Set([...a.constants, ...b.constants].map(({ name }) => name))].filter((name) => constant(a, name) !== constant(b, name));
  return { a, b, differences, ended, differing: acts.length + last - both, first: acts[0] ?? behind, constants };
}

/** Whether two episodes of a copy have the same frame at a step; null where one has none. */
async function sameFrame(query) {
  const [a, b] = await Promise.all(["a", "b"].map(async (side) => (await part(`episode-${await numberOf(query.get(side))}`)).frame_hashes?.[query.get("t") - 1] ?? null));
  return { is_same: a === null || b === null ? null : a === b };
}

/** Where the frame of a step is. */
export async function frameAddress(id, t) {
  if (!isCopy) return address("frame", new URLSearchParams({ id, t }));
  return `frames/${await numberOf(id)}/${t}.png`;
}

// The list of episodes: draws the rows in view and requests them page by page.
import { counted, make, notice, one } from "./dom.js";
import { ask } from "./data.js";
import { changed, filtered, go, link, query } from "./state.js";
import { filterLine, nothingFound, nothingYet, tellFault } from "./filters.js";

const ROW = 30;
const PAGE = 100;

class Rows {
  constructor(frame, body, columns) {
    Object.assign(this, { frame, body, columns, passes: [], pages: new Map(), total: 0, stop: 0 });
    frame.addEventListener("scroll", () => this.show(), { passive: true });
    body.addEventListener("focusin", ({ target }) => (this.stop = Number(target.closest("a").dataset.at)));
    body.addEventListener("keydown", (event) => {
      const step = { ArrowDown: 1, ArrowUp: -1, PageDown: 20, PageUp: -20 }[event.key];
      if (step === undefined || !event.target.matches("a")) return;
      event.preventDefault();
      this.focus(Math.min(this.total - 1, Math.max(0, this.stop + step)));
    });
  }

  /** Focuses a row after scrolling it into view and drawing it. */
  focus(at) {
    this.stop = at;
    const [top, room] = [at * ROW, this.frame.clientHeight - 2 * ROW];
    if (top < this.frame.scrollTop) this.frame.scrollTop = top;
    if (top > this.frame.scrollTop + room) this.frame.scrollTop = top - room;
    this.show();
    one(`a[data-at="${at}"]`, this.body)?.focus();
  }

  async page(at) {
    const next = changed({ offset: at * PAGE, limit: PAGE });
    const told = await ask("episodes", next);
    this.pages.set(at, told.rows);
    this.total = told.total;
    return told;
  }

  /** Draws the rows in view and requests missing ones. */
  show() {
    const first = Math.max(0, Math.floor(this.frame.scrollTop / ROW) - 5);
    const last = Math.min(this.total, first + Math.ceil(this.frame.clientHeight / ROW) + 10);
    this.body.style.height = `${this.total * ROW}px`;
    const drawn = [];
    for (let at = first; at < last; at += 1) {
      const page = Math.floor(at / PAGE);
      const rows = this.pages.get(page);
      if (rows === undefined) {
        this.pages.set(page, null);
        this.page(page).then(() => this.show(), (error) => this.frame.before(notice(error.message)));
      }
      const row = rows?.[at % PAGE];
      if (row) drawn.push(this.row(row, at));
    }
    const focused = document.activeElement?.dataset.at;
    const isStop = drawn.some((row) => Number(row.dataset.at) === this.stop);
    drawn.forEach((row, at) => (row.tabIndex = (isStop ? Number(row.dataset.at) === this.stop : at === 0) ? 0 : -1));
    this.body.replaceChildren(...drawn);
    if (focused !== undefined) one(`a[data-at="${focused}"]`, this.body)?.focus({ preventScroll: true });
  }

  row(row, at) {
    const pick = query().get("pick");
    const next = pick === null
      ? changed({ view: "episode", id: row.id, t: row.said?.t ?? null, offset: null })
      : new URLSearchParams({ view: "compare", a: pick, b: row.id });
    const cells = this.columns.map(({ key, metric, kind }) => {
      if (kind === "words") return make("span", { class: kind, role: "cell", title: row.said?.excerpt }, row.said === undefined ? "" : `t = ${row.said.t}, ${row.said.column.replaceAll("_", " ")}: ${row.said.excerpt}`);
      const value = kind === "put" ? row.put.join(", ") : metric === undefined ? row[key] : row.values[metric];
      const text = value === null ? "--" : String(value);
      const pass = value === null ? null : (this.passes[metric] ?? null);
      if (pass !== null) return verdictCell(text, value === pass);
      const long = { id: true, name: true, put: true }[kind] ? text : null;
      return make("span", { class: kind, role: "cell", title: long }, kind === "id" ? parted(text) : text);
    });
    const element = make("a", { href: link(next), role: "row", "aria-rowindex": at + 2, "data-id": row.id, "data-at": at }, cells);
    element.style.top = `${at * ROW}px`;
    return element;
  }
}

/** The value of a rate that has a better direction: a sign, its words and a colour tell which it is. */
function verdictCell(text, isPass) {
  const sign = make("span", { role: "img", "aria-label": isPass ? "pass" : "fail" }, isPass ? "✓" : "✗");
  return make("span", { class: `number ${isPass ? "pass" : "fail"}`, role: "cell" }, sign, ` ${text}`);
}

/** An id whose end stays visible when space is short: seed and run distinguish it from its neighbours. */
function parted(id) {
  const at = id.lastIndexOf("/", id.lastIndexOf("/") - 1);
  return at < 0 ? [make("span", { class: "cut" }, id)] : [make("span", { class: "cut" }, id.slice(0, at)), make("span", {}, id.slice(at))];
}

function header(columns) {
  const now = query();
  const heads = columns.map(({ name, kind, sort }) => {
    const way = now.get("sort") === sort ? (now.get("order") ?? "ascending") : null;
    if (sort === undefined) return make("span", { role: "columnheader", class: kind }, name);
    const button = make("button", { type: "button" }, name);
    button.addEventListener("click", () => {
      const order = way === "ascending" ? "descending" : null;
      go(changed(way === "descending" ? { sort: null, order: null } : { sort, order }));
    });
    return make("span", { role: "columnheader", class: kind, "aria-sort": way }, button);
  });
  return make("div", { class: "head", role: "row" }, heads);
}

function columnsOf(told) {
  const columns = [
    { name: "Episode", key: "name", sort: "id", kind: "id" },
    { name: "Experiment", key: "experiment", sort: "experiment", kind: "short" },
    { name: "Model", key: "model", sort: "model", kind: "name" },
  ];
  if (told.has_conditions) columns.push({ name: "Condition", key: "condition", sort: "condition", kind: "short" });
  if (told.has_labels) columns.push({ name: "Labels", key: "put", kind: "put" });
  if (query().has("search")) columns.push({ name: "Said", key: "said", kind: "words" });
  told.metrics.forEach((name, metric) => columns.push({ name, metric, sort: name, kind: "number" }));
  return columns;
}

/** The page. */
export async function list(content, study) {
  const title = make("h1", {}, "Episodes");
  const pick = query().get("pick");
  if (pick !== null) title.textContent = `Which episode stands beside ${pick}?`;
  const filters = filterLine(study);
  content.replaceChildren(title, filters);
  const frame = make("div", { class: "list", role: "table", "aria-label": "Episodes" });
  const body = make("div", { class: "rows", role: "rowgroup" });
  const rows = new Rows(frame, body, []);
  let told;
  try {
    told = await rows.page(0);
  } catch (error) {
    tellFault(filters, error.message);
    return;
  }
  if (told.all === 0) return content.append(nothingYet());
  rows.columns = columnsOf(told);
  rows.passes = told.passes;
  const widths = { id: "minmax(13rem, 2.2fr)", short: "6.5rem", name: "minmax(9rem, 1.4fr)", number: "minmax(3.4rem, .5fr)", words: "minmax(16rem, 4fr)", put: "minmax(7rem, 1fr)" };
  frame.style.setProperty("--columns", rows.columns.map(({ kind }) => widths[kind]).join(" "));
  frame.setAttribute("aria-rowcount", told.total + 1);
  frame.append(header(rows.columns), body);
  const words = told.total === told.all ? counted(told.all, "episode") : `${told.total} of ${counted(told.all, "episode")}`;
  content.append(make("p", { class: "quiet", id: "count", role: "status" }, words));
  if (told.total === 0) return content.append(nothingFound());
  content.append(frame);
  return rows.show();
}

/** A query for the list, without the keys of an episode. */
export const listQuery = () => filtered({ view: "episodes", sort: query().get("sort"), order: query().get("order") });

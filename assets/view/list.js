// The list of episodes: as many rows as are in view, asked for page by page.
import { counted, make, notice } from "./dom.js";
import { ask } from "./data.js";
import { changed, filtered, go, link, query } from "./state.js";
import { filterLine } from "./filters.js";

const ROW = 30;
const PAGE = 100;

class Rows {
  constructor(frame, body, columns) {
    Object.assign(this, { frame, body, columns, pages: new Map(), total: 0 });
    frame.addEventListener("scroll", () => this.show(), { passive: true });
  }

  async page(at) {
    const next = changed({ offset: at * PAGE, limit: PAGE });
    const told = await ask("episodes", next);
    this.pages.set(at, told.rows);
    this.total = told.total;
    return told;
  }

  /** Draws the rows in view, and asks for those that are not there. */
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
    this.body.replaceChildren(...drawn);
  }

  row(row, at) {
    const pick = query().get("pick");
    const next = pick === null
      ? changed({ view: "episode", id: row.id, t: null, offset: null })
      : new URLSearchParams({ view: "compare", a: pick, b: row.id });
    const cells = this.columns.map(({ key, metric, kind }) => {
      const value = metric === undefined ? row[key] : row.values[metric];
      const text = value === null ? "--" : String(value);
      const long = { id: true, name: true }[kind] ? text : null;
      return make("span", { class: kind, role: "cell", title: long }, kind === "id" ? parted(text) : text);
    });
    const element = make("a", { href: link(next), role: "row", "aria-rowindex": at + 2, "data-id": row.id }, cells);
    element.style.top = `${at * ROW}px`;
    return element;
  }
}

/** An id whose end stays in view where there is no room: seed and run tell its neighbours apart. */
function parted(id) {
  const at = id.lastIndexOf("/", id.lastIndexOf("/") - 1);
  return at < 0 ? [make("span", { class: "cut" }, id)] : [make("span", { class: "cut" }, id.slice(0, at)), make("span", {}, id.slice(at))];
}

function header(columns) {
  const now = query();
  const heads = columns.map(({ name, kind, sort }) => {
    const way = now.get("sort") === sort ? (now.get("order") ?? "ascending") : null;
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
  told.metrics.forEach((name, metric) => columns.push({ name, metric, sort: name, kind: "number" }));
  return columns;
}

/** The page. */
export async function list(content, study) {
  const title = make("h1", {}, "Episodes");
  const pick = query().get("pick");
  if (pick !== null) title.textContent = `Which episode stands beside ${pick}?`;
  content.replaceChildren(title, filterLine(study));
  const frame = make("div", { class: "list", tabindex: 0, role: "table", "aria-label": "Episodes" });
  const body = make("div", { class: "rows", role: "rowgroup" });
  const rows = new Rows(frame, body, []);
  const told = await rows.page(0);
  rows.columns = columnsOf(told);
  const widths = { id: "minmax(13rem, 2.2fr)", short: "6.5rem", name: "minmax(9rem, 1.4fr)", number: "minmax(3.4rem, .5fr)" };
  frame.style.setProperty("--columns", rows.columns.map(({ kind }) => widths[kind]).join(" "));
  frame.setAttribute("aria-rowcount", told.total + 1);
  frame.append(header(rows.columns), body);
  const words = told.total === told.all ? counted(told.all, "episode") : `${told.total} of ${counted(told.all, "episode")}`;
  content.append(make("p", { class: "quiet", id: "count", role: "status" }, words), frame);
  rows.show();
}

/** A query for the list without what belongs to an episode. */
export const listQuery = () => filtered({ view: "episodes", sort: query().get("sort"), order: query().get("order") });

// The report, live: tables whose cells link to their episodes; figures and statistics load when opened.
import { all, counted, make, notice, one, parsed } from "./dom.js";
import { ask, isCopy } from "./data.js";
import { FILTERS, changed, filtered, go, link, query } from "./state.js";
import { filterLine, groupQuery, nothingFound, nothingYet, roving, tellFault } from "./filters.js";

/** The query for the server: only the filters. */
function wanted() {
  return isCopy ? new URLSearchParams() : filtered({});
}

/** Makes each cell a link to its episodes; a table is one Tab stop, and arrow keys move within it. */
function linkCells(table, { by, groups }) {
  for (const cell of all("td[data-metric]", table)) {
    const { group } = cell.closest("tr").dataset;
    const metric = cell.dataset.metric;
    const next = changed({ view: "episodes", sort: metric }, groupQuery(by, groups[Number(group)]));
    const words = [`n ${cell.dataset.n}`, cell.dataset.mean === "" ? "undefined" : `mean ${cell.dataset.mean}`];
    if (cell.dataset.ciLow !== "") words.push(`95 % ${cell.dataset.ciLow} to ${cell.dataset.ciHigh}`);
    cell.replaceChildren(make("a", { href: link(next), tabindex: -1, title: words.join(", ") }, ...cell.childNodes));
  }
  const links = () => all("tbody tr:not(.heading):not([hidden])", table).map((row) => all("td[data-metric] a", row));
  const first = links()[0]?.[0];
  if (first) first.tabIndex = 0;
  table.addEventListener("keydown", (event) => {
    const steps = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
    if (!(event.key in steps) || !event.target.matches("td a")) return;
    const rows = links();
    const row = rows.findIndex((cells) => cells.includes(event.target));
    const [down, right] = steps[event.key];
    const next = rows[row + down]?.[rows[row].indexOf(event.target) + right];
    if (!next) return;
    event.preventDefault();
    event.target.tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  });
}

/** Copies compute nothing: rows of values that are not selected are hidden. */
function hideRows(sections, { by, groups }) {
  for (const row of all(".results tbody tr[data-group]", sections)) {
    const values = groups[Number(row.dataset.group)];
    row.hidden = by.some((column, at) => query().has(column) && !query().getAll(column).includes(values[at] ?? "default"));
  }
}

/** The note of a copy on sections that cover all episodes, if a filter cannot be applied by hiding rows. */
function unfiltered(title, columns = []) {
  const beyond = FILTERS.filter((key) => query().has(key) && !columns.includes(key));
  if (!isCopy || beyond.length === 0) return null;
  const asked = beyond.map((key) => `${key}: ${query().getAll(key).join(", ")}`).join("\n  ");
  return notice(`This copy of the page has its ${title} of all episodes, and cannot compute them of those with\n  ${asked}\nSo none is shown. \`mirrorstats view\` of the recordings can.`);
}

/** Makes headers sort the rows of each group by their means. */
function makeSorted(table) {
  for (const head of all("thead th[data-metric]", table)) {
    const button = make("button", { type: "button" }, ...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const was = head.getAttribute("aria-sort");
      const way = was === null ? head.dataset.first : was === head.dataset.first ? (was === "ascending" ? "descending" : "ascending") : null;
      sort(table, head, way);
      const others = query().getAll("tables").filter((text) => !text.startsWith(`${table.dataset.table}:`));
      go(changed({ tables: way === null ? others : [...others, `${table.dataset.table}:${way}:${head.dataset.metric}`] }), { replace: true });
    });
  }
  for (const text of query().getAll("tables")) {
    const [name, way, ...metric] = text.split(":");
    const head = all("thead th[data-metric]", table).find(({ dataset }) => dataset.metric === metric.join(":"));
    if (name === table.dataset.table && head !== undefined && ["ascending", "descending"].includes(way)) sort(table, head, way);
  }
}

function sort(table, head, way) {
  for (const other of all("thead th", table)) other.removeAttribute("aria-sort");
  if (way !== null) head.setAttribute("aria-sort", way);
  for (const body of all("tbody", table)) order(body, head.dataset.metric, way);
}

function order(body, metric, way) {
  const rows = all(":scope > tr:not(.heading)", body);
  rows.forEach((row, at) => (row.dataset.at ??= String(at)));
  const mean = (row) => all("td[data-metric]", row).find((cell) => cell.dataset.metric === metric)?.dataset.mean ?? "";
  const sign = way === "descending" ? -1 : 1;
  rows.sort((a, b) => {
    if (way === null) return Number(a.dataset.at) - Number(b.dataset.at);
    const [left, right] = [mean(a), mean(b)];
    if (left === "" || right === "") return (left === "") - (right === "");
    return sign * (Number(left) - Number(right));
  });
  body.append(...rows);
}

/** Keeps headers in view: at the top of the window, or of the scrolling box around a wide table. */
function keepHeads(box) {
  const look = () => {
    box.classList.remove("wide", "fits");
    const isWide = box.scrollWidth > box.clientWidth + 1;
    box.classList.add(isWide ? "wide" : "fits");
    // Scrollable content must be reachable by keyboard; without focusable content, the box itself is focusable.
    if (isWide && box.querySelector("a, button, [tabindex]") === null) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  };
  new ResizeObserver(look).observe(box);
}

/** A section that loads when opened. */
function later(title, name) {
  const details = make("details", { class: "later", id: `section-${name}` }, make("summary", {}, title));
  details.addEventListener("toggle", async () => {
    if (!details.open || details.dataset.asked) return;
    details.dataset.asked = "yes";
    const waiting = unfiltered(title.toLowerCase()) ?? make("p", { class: "quiet" }, "…");
    details.append(waiting);
    if (waiting.matches(".notice")) return;
    try {
      const { sections } = await ask(name, wanted());
      const nodes = sections.flatMap(parsed);
      waiting.replaceWith(...(sections.length > 0 ? nodes : [make("p", { class: "quiet" }, "No sections.")]));
      for (const box of all(".scroll", details)) keepHeads(box);
    } catch (error) {
      waiting.replaceWith(notice(error.message));
    }
  });
  return details;
}

function running(list) {
  const rows = list.map((episode) => {
    const facts = [counted(episode.steps, "step"), episode.action, episode.cost === null ? null : `${episode.cost} US dollars`, episode.unreadable > 0 ? `${episode.unreadable} unreadable` : null];
    const next = new URLSearchParams({ view: "episode", id: episode.id });
    return make("li", {}, make("a", { href: link(next) }, episode.name), ` ${facts.filter((fact) => fact !== null).join(", ")}`);
  });
  return make("section", { id: "under-way" }, make("h2", {}, "Under way"), make("ul", { class: "running" }, rows));
}

/** The recordings in progress, if any. */
export function showRunning(content, list, rate) {
  one("#under-way", content)?.remove();
  if (list.length === 0) return;
  const section = running(list);
  if (rate !== null) one("h2", section).append(` ${rate} steps a second`);
  one("#overview-head", content)?.after(section);
}

/** The models ranked by their mean over experiments: an ordering, not a test. */
function ranking({ metric, experiments, rows }) {
  const heads = ["", "Model", `${metric}, mean of experiments`, ...experiments].map((name) => make("th", { scope: "col" }, name));
  const lines = rows.map((row, at) => make("tr", {}, make("td", {}, String(at + 1)),
    make("th", { scope: "row" }, make("a", { href: link(filtered({ view: "episodes", model: row.model })), tabindex: at === 0 ? 0 : -1 }, row.name)),
    make("td", {}, row.mean), row.values.map((value) => make("td", {}, value ?? "--"))));
  const table = make("table", { class: "plain", id: "ranking-table" }, make("thead", {}, make("tr", {}, heads)), make("tbody", {}, lines));
  roving(table, "tbody a");
  const words = "Each experiment counts once. This is an order of means; what the tests leave open is under Ranks and Statistics.";
  return make("section", { id: "ranking" }, make("h2", {}, "Models over all experiments"), make("p", { class: "quiet" }, words), make("div", { class: "scroll" }, table));
}

/** The page. */
export async function overview(content, study) {
  const head = make("div", { id: "overview-head" }, make("h1", {}, study.subject ?? "Results"));
  const sections = make("div", { id: "sections" });
  const filters = filterLine(study);
  content.replaceChildren(head, filters, sections);
  if (study.episodes === 0) {
    sections.append(nothingYet());
    return;
  }
  let told;
  try {
    told = await ask("overview", wanted());
  } catch (error) {
    tellFault(filters, error.message);
    return;
  }
  const lead = `${counted(told.episodes, "episode")} under the definitions ${study.definitions?.name ?? ""}`;
  const list = make("a", { href: link(changed({ view: "episodes" }, filtered({}))) }, "all of them, one by one");
  head.append(make("p", { class: "lead" }, `${lead}: `, list));
  if (told.episodes === 0) {
    sections.append(nothingFound());
    return;
  }
  const stated = unfiltered("tables", told.by);
  if (stated !== null) {
    const next = link(changed({ view: "episodes" }, filtered({})));
    head.replaceChildren(head.firstChild, stated, make("p", {}, make("a", { href: next }, "The episodes of this filter")));
    return;
  }
  if (told.ranking && FILTERS.every((key) => !isCopy || !query().has(key))) sections.append(ranking(told.ranking));
  const nodes = told.sections.flatMap(parsed);
  sections.append(...nodes);
  if (isCopy) hideRows(sections, told);
  for (const table of all("table.results", sections)) {
    linkCells(table, told);
    makeSorted(table);
  }
  for (const box of all(".scroll", sections)) keepHeads(box);
  const tables = one("#tables", sections);
  tables?.after(later("Figures", "figures"), later("Statistics", "statistics"));
}

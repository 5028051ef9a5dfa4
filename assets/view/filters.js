// Filters: column values, a condition in the language of definitions, and search words; each active one is a chip.
import { all, make, one } from "./dom.js";
import { isCopy } from "./data.js";
import { FILTERS, changed, filtered, go, link, query } from "./state.js";

const HEADINGS = { experiment: "Experiment", model: "Model", condition: "Condition", seed: "Seed", participant: "Participant", reply_status: "Reply status" };
/** The columns with their own key in the address; others are under `is`. */
const OWN = ["experiment", "model", "condition"];
/** The columns of labels that coders put, and their values in words. */
const LABEL = "label_";
const CODED = { true: "put", false: "not put", "": "not coded" };
const isLabel = ({ column }) => column.startsWith(LABEL);
/** Longer lists of values become a menu. */
const IN_LINE = 8;

/** The values of a column that a query selects. */
function chosenOf(column, from) {
  if (OWN.includes(column)) return from.getAll(column);
  return from.getAll("is").filter((text) => text.startsWith(`${column}=`)).map((text) => text.slice(column.length + 1));
}

/** A query with these values of a column. */
function choosing(column, values, from = query()) {
  if (OWN.includes(column)) return changed({ [column]: values, offset: null }, from);
  const others = from.getAll("is").filter((text) => !text.startsWith(`${column}=`));
  return changed({ is: [...others, ...values.map((value) => `${column}=${value}`)], offset: null }, from);
}

function boxes({ column, values }, now) {
  const chosen = chosenOf(column, now);
  const labels = values.map(({ value, name, title, episodes, replies }) => {
    const input = make("input", { type: "checkbox", name: column, value });
    input.checked = chosen.includes(value);
    const count = episodes === undefined ? `${replies} replies` : `${episodes} episodes`;
    return make("label", { title: title ?? count }, input, make("span", {}, isLabel({ column }) ? `${CODED[value]} ${episodes}` : name));
  });
  const group = make("div", { class: "values-of", role: "group", "aria-label": headingOf(column) }, labels);
  roving(group, "input");
  return group;
}

const headingOf = (column) => HEADINGS[column] ?? (isLabel({ column }) ? `Label ${column.slice(LABEL.length)}` : column);

/** A group with one Tab stop; arrow keys move within it. */
export function roving(box, selector) {
  const controls = () => all(selector, box);
  const stop = (one) => controls().forEach((control) => (control.tabIndex = control === one ? 0 : -1));
  stop(controls()[0]);
  box.addEventListener("focusin", ({ target }) => target.matches(selector) && stop(target));
  box.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    const list = controls();
    const at = list.indexOf(event.target);
    if (step === undefined || at < 0) return;
    event.preventDefault();
    event.stopPropagation();
    list[at + step]?.focus();
  });
}

/** A menu of values. */
function menu(title, contents) {
  const details = make("details", { class: "menu" }, make("summary", {}, title), make("div", { class: "inside" }, contents));
  details.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !details.open) return;
    details.open = false;
    one("summary", details).focus();
  });
  return details;
}

document.addEventListener("click", ({ target }) => {
  for (const open of all("details.menu[open]")) if (!open.contains(target)) open.open = false;
});

/** The active filters, each with the query that removes it. */
export function inForce(now = query(), columns = []) {
  const words = (column, value) => (isLabel({ column }) ? CODED[value] : null) ?? columns.find((choice) => choice.column === column)?.values.find((one) => one.value === value)?.name ?? (value === "" ? "undefined" : value);
  const chips = [];
  const seen = [...OWN, ...new Set(now.getAll("is").map((text) => text.slice(0, Math.max(0, text.indexOf("=")))))];
  for (const column of seen) {
    const values = chosenOf(column, now);
    for (const value of values) chips.push({ text: `${headingOf(column)}: ${words(column, value)}`, without: choosing(column, values.filter((other) => other !== value), now) });
  }
  if (now.has("where")) chips.push({ text: now.get("where"), without: changed({ where: null, offset: null }, now) });
  if (now.has("search")) chips.push({ text: `“${now.get("search")}”`, without: changed({ search: null, offset: null }, now) });
  return chips;
}

/** Suggestions if no episode is left: each filter can be removed. */
export function nothingFound() {
  const ways = inForce().map(({ text, without }) => make("li", {}, make("a", { href: link(without) }, `without ${text}`)));
  const rest = make("li", {}, make("a", { href: link(changed(Object.fromEntries(FILTERS.map((key) => [key, null])))) }, "all episodes"));
  return make("div", { class: "nothing" }, make("p", {}, "No episode is like that. Go on with"), make("ul", {}, ways.length > 1 ? ways : [], rest));
}

/** The note of a recording without a finished episode. */
export const nothingYet = () => make("p", { class: "quiet", id: "nothing-yet" }, "No episode is finished yet. Results appear with the first one.");

/** The filters of a page; `study` has the choices, `fault` the error in the condition. */
export function filterLine(study) {
  const now = query();
  const form = make("form", { class: "filters", "aria-label": "Filters" });
  const known = study.choices.filter(({ column }) => !(isCopy && column === "reply_status"));
  const [outcome, ...metrics] = known.filter((choice) => choice.is_metric);
  const columns = known.filter((choice) => !choice.is_metric && !isLabel(choice));
  const labels = known.filter(isLabel);
  const isInLine = ({ column, values }) => OWN.includes(column) && values.length <= IN_LINE;
  form.append(...columns.filter(isInLine).map((choice) => make("fieldset", {}, make("legend", {}, headingOf(choice.column)), boxes(choice, now))));
  const menus = columns.filter((choice) => !isInLine(choice)).map((choice) => menu(headingOf(choice.column), boxes(choice, now)));
  if (labels.length > 0) menus.push(menu("Label", labels.map((choice) => make("div", { class: "of-metric" }, make("b", {}, choice.column.slice(LABEL.length)), boxes(choice, now)))));
  if (outcome !== undefined) menus.push(menu(`Outcome (${outcome.column})`, boxes(outcome, now)));
  if (metrics.length > 0) menus.push(menu("Metric", metrics.map((choice) => make("div", { class: "of-metric" }, make("b", {}, choice.column), boxes(choice, now)))));
  if (menus.length > 0) form.append(make("div", { class: "menus" }, make("span", { class: "legend" }, "More"), menus));
  const where = make("input", { type: "text", name: "where", value: now.get("where") ?? "", placeholder: "such as TSA = 0 and MCR = 1", autocomplete: "off", spellcheck: "false" });
  form.append(make("label", { class: "where" }, make("span", {}, "Where"), where, make("button", { type: "submit" }, "Filter")));
  const chips = inForce(now, study.choices).map(({ text, without }) => make("a", { class: "chip", href: link(without), "aria-label": `Remove the filter ${text}` }, text, make("span", { "aria-hidden": "true" }, "×")));
  const reset = make("button", { type: "button" }, "Show all");
  reset.addEventListener("click", () => go(changed(Object.fromEntries(FILTERS.map((key) => [key, null])))));
  if (chips.length > 0) form.append(make("div", { class: "chips", role: "group", "aria-label": "In force" }, chips, reset));
  form.addEventListener("change", ({ target }) => {
    if (target.type !== "checkbox") return;
    const group = all(`input[name="${CSS.escape(target.name)}"]:checked`, form).map((box) => box.value);
    go(choosing(target.name, group));
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    go(changed({ where: where.value.trim(), offset: null }));
  });
  return form;
}

/** Shows the error in the condition beside its field, which keeps the text. */
export function tellFault(form, words) {
  const where = form.elements.where;
  const fault = make("pre", { class: "notice", role: "alert", id: "where-fault" }, words);
  if (query().has("where")) {
    where.setAttribute("aria-invalid", "true");
    where.setAttribute("aria-describedby", "where-fault");
  }
  form.append(fault);
}

/** A query for the list of the episodes of a group. */
export function groupQuery(by, values) {
  const known = {};
  const others = [];
  by.forEach((column, at) => {
    if (OWN.includes(column)) known[column] = values[at] ?? "default";
    else if (values[at] === null) others.push(`${column} is null`);
    else others.push(`${column} = ${isLabel({ column }) || /^-?[0-9]+$/.test(values[at]) ? values[at] : `'${values[at].replaceAll("'", "''")}'`}`);
  });
  const where = [query().get("where"), ...others].filter((text) => text !== null).map((text) => (others.length > 0 ? `(${text})` : text));
  return filtered({ ...known, ...(where.length > 0 ? { where: where.join(" and ") } : {}) });
}

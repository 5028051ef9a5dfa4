// The line of filters: chosen values of columns, and a condition in the language of definitions.
import { all, make } from "./dom.js";
import { changed, filtered, go, query } from "./state.js";

const HEADINGS = { experiment: "Experiment", model: "Model", condition: "Condition" };

function choices({ column, values }, now) {
  const chosen = now.getAll(column);
  const boxes = values.map(({ value, name, title, episodes }) => {
    const input = make("input", { type: "checkbox", name: column, value });
    input.checked = chosen.includes(value);
    return make("label", { title: title ?? `${episodes} episodes` }, input, make("span", {}, name));
  });
  return make("fieldset", {}, make("legend", {}, HEADINGS[column]), boxes);
}

/** The filters of a page; `study` says what can be chosen. */
export function filterLine(study) {
  const now = query();
  const form = make("form", { class: "filters", "aria-label": "Filters" });
  form.append(...study.choices.map((choice) => choices(choice, now)));
  const where = make("input", { type: "text", name: "where", value: now.get("where") ?? "", placeholder: "such as TSA = 0 and MCR = 1", autocomplete: "off", spellcheck: "false" });
  form.append(make("label", { class: "where" }, make("span", {}, "Where"), where, make("button", { type: "submit" }, "Filter")));
  const reset = make("button", { type: "button" }, "Show all");
  reset.hidden = !["experiment", "model", "condition", "where", "search"].some((key) => now.has(key));
  reset.addEventListener("click", () => go(changed({ experiment: null, model: null, condition: null, where: null, search: null })));
  form.append(make("div", { class: "choices" }, reset));
  const apply = () => {
    const values = Object.fromEntries(study.choices.map(({ column }) => [column, all(`input[name=${column}]:checked`, form).map((box) => box.value)]));
    go(changed({ ...values, where: form.elements.where.value.trim(), offset: null }));
  };
  form.addEventListener("change", (event) => event.target.type === "checkbox" && apply());
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    apply();
  });
  return form;
}

/** A query for the list of the episodes of a group. */
export function groupQuery(by, values) {
  const known = {};
  const others = [];
  by.forEach((column, at) => {
    if (column in HEADINGS) known[column] = values[at] ?? "default";
    else if (values[at] === null) others.push(`${column} is null`);
    else others.push(`${column} = ${/^-?[0-9]+$/.test(values[at]) ? values[at] : `'${values[at].replaceAll("'", "''")}'`}`);
  });
  const where = [query().get("where"), ...others].filter((text) => text !== null).map((text) => (others.length > 0 ? `(${text})` : text));
  return filtered({ ...known, ...(where.length > 0 ? { where: where.join(" and ") } : {}) });
}

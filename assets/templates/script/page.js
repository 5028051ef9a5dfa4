// Shared by all scripts: the embedded data, elements built from text, and the facts of a cell.

const data = JSON.parse(document.getElementById("data").textContent);
const all = (selector, root = document) => [...root.querySelectorAll(selector)];

/** An element; children that are text stay text. */
function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** The metric, row name and definition of a cell. */
function subject(cell) {
  const row = cell.closest("tr");
  return {
    metric: cell.dataset.metric,
    group: Number(row.dataset.group),
    episodes: row.dataset.episodes,
    definition: data.metrics[cell.dataset.metric],
  };
}

/** The exact numbers of a cell, as pairs of label and text. */
function facts(cell) {
  const { definition, episodes } = subject(cell);
  const { n, sum, sumSq, mean, se, ciLow, ciHigh, chance } = cell.dataset;
  const known = (text) => (text === "" ? data.undefined : text);
  const pairs = [["n", `${n} of ${episodes} episodes`]];
  if (definition.is_rate) pairs.push(["count", `${sum} of ${n}`]);
  else pairs.push(["sum", sum], ["sum of squares", sumSq]);
  pairs.push(["mean", known(mean)], ["standard error", known(se)]);
  const kind = definition.is_rate ? "Wilson 95 %" : "Student 95 %";
  pairs.push([kind, ciLow === "" ? data.undefined : `${ciLow} to ${ciHigh}`]);
  if (chance !== undefined) pairs.push(["chance", chance]);
  return pairs;
}

function valueList(pairs) {
  const list = make("dl", { class: "values" });
  for (const [word, text] of pairs) list.append(make("dt", {}, word), make("dd", {}, text));
  return list;
}

function piece({ text, is_code: isCode }) {
  return isCode ? make("code", {}, text) : text;
}

/** The definition as a sentence and as source. */
function sentence(definition) {
  const written = [`value = ${definition.value}`];
  if (definition.when !== null) written.push(`when = ${definition.when}`);
  return make(
    "div",
    { class: "sentence" },
    make("p", {}, make("b", {}, `${definition.title}.`), " ", ...definition.help.map(piece)),
    make("pre", {}, written.join("\n")),
  );
}

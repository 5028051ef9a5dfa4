// Two models: selects the tests of two models from those of all pairs. Nothing is computed here.

function startPair() {
  const { pairs } = data;
  const section = document.getElementById("pair");
  if (section === null || pairs === null || pairs.models.length < 2) return;
  const [first, second] = all("select", section);
  for (const choice of [first, second]) choice.append(...pairs.models.map((name, at) => make("option", { value: at }, name)));
  const [body] = section.querySelector("table").tBodies;
  for (const part of [section, document.querySelector('nav a[href="#pair"]')]) part.hidden = false;
  if (pairs.left_out > 0) section.append(make("p", {}, `The tests of ${pairs.left_out} further metrics and experiments are left out of this page, as there are many models: mirrorstats stats --json has them all.`));
  let rows = [];

  function fill() {
    const chosen = [Number(first.value), Number(second.value)];
    for (const cell of all("[data-side]", section)) cell.textContent = pairs.models[chosen[Number(cell.dataset.side)]];
    body.replaceChildren(...pairs.families.flatMap((family) => pairRows(family, chosen)));
    show();
  }

  /** Hides the rows of filtered experiments. */
  function show() {
    const experiments = new Set(rows.map(({ experiment }) => experiment));
    for (const row of body.rows) row.hidden = !(rows.length === 0 || experiments.has(undefined) || row.dataset.experiment === "" || experiments.has(row.dataset.experiment));
  }

  /** Prevents comparing a model with itself: the other choice changes. */
  function choose(own, other) {
    if (own.value === other.value) other.value = own.value === "0" ? "1" : "0";
    remember({ a: pairs.models[Number(first.value)], b: pairs.models[Number(second.value)] });
    fill();
  }

  const place = (key, otherwise) => {
    const at = pairs.models.indexOf(query().get(key));
    return String(at < 0 ? otherwise : at);
  };
  first.value = place("a", 0);
  second.value = place("b", first.value === "1" ? 0 : 1);
  if (first.value === second.value) second.value = first.value === "0" ? "1" : "0";
  first.addEventListener("change", () => choose(first, second));
  second.addEventListener("change", () => choose(second, first));
  document.addEventListener("rows", ({ detail }) => {
    rows = detail.isAll ? [] : detail.rows;
    show();
  });
  fill();
}

/** The row of a family of tests for two models, from the first one's perspective. */
function pairRows({ experiment, metric, tests }, [a, b]) {
  const found = tests.find(([first, second]) => (first === a && second === b) || (first === b && second === a));
  if (found === undefined) return [];
  const [better, , method, ...rest] = found;
  const [p, adjusted, verdict] = rest.splice(8);
  const own = better === a ? 0 : 1;
  const [counts, differing, difference, interval] = [0, 2, 4, 6].map((at) => rest[at + own]);
  const words = [`${data.pairs.models[better]} is better`, "not told apart", "no test"][verdict];
  const number = (text) => make("td", { class: "number" }, text);
  return [
    make(
      "tr",
      { "data-experiment": experiment ?? "" },
      make("td", {}, experiment ?? "all of them"),
      make("th", { scope: "row" }, metric),
      make("td", {}, data.pairs.methods[method]),
      ...[counts, rest[1 - own], differing, difference, interval, p, adjusted].map(number),
      make("td", { class: verdict === 0 ? "" : "quiet" }, words),
    ),
  ];
}

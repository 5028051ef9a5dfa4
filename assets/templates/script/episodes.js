// The panel: the episodes behind a cell.

const panel = make("dialog", { id: "episodes", "aria-labelledby": "episodes-title" });
document.body.append(panel);

/** A row a episode of the group. */
function episodeRows(group, metric) {
  const { id, seed, run, group: groups, values } = data.episodes;
  const rows = [];
  for (let at = 0; at < id.length; at += 1) {
    if (groups[at] !== group) continue;
    const value = values[metric][at];
    const shown = make("td", { class: value === null ? "number none" : "number", "data-key": value ?? "" });
    shown.append(value === null ? data.undefined : String(value));
    const number = (text) => make("td", { class: "number", "data-key": text }, String(text));
    rows.push(make("tr", {}, make("th", { scope: "row", "data-key": id[at] }, id[at]), number(seed[at]), number(run[at]), shown));
  }
  return rows;
}

function episodeTable(group, metric) {
  const head = (text, place, kind) =>
    make("th", { scope: "col", "data-place": place, "data-first": "ascending", class: kind }, text);
  const heads = [head("Episode", 0, ""), head("Seed", 1, "number"), head("Run", 2, "number"), head(metric, 3, "number")];
  const body = make("tbody", {}, ...episodeRows(group, metric));
  makeSortable(heads, () => [body], ({ dataset }) => (row) => {
    const { key } = row.children[Number(dataset.place)].dataset;
    if (dataset.place === "0") return key;
    return key === "" ? null : Number(key);
  });
  return make("table", { class: "episodes" }, make("thead", {}, make("tr", {}, ...heads)), body);
}

/** Opens the panel for a cell; closing it leads back there. */
function openEpisodes(cell) {
  const { metric, group, definition } = subject(cell);
  const close = make("button", { type: "button" }, "Close");
  close.addEventListener("click", () => panel.close());
  const title = make("h2", { id: "episodes-title" }, `${metric}, ${data.groups[group]}`);
  const inside = make(
    "div",
    { class: "inside" },
    make("header", {}, title, close),
    valueList(facts(cell)),
    sentence(definition),
    episodeTable(group, metric),
  );
  panel.replaceChildren(inside);
  hideTip();
  panel.addEventListener("close", () => cell.focus(), { once: true });
  panel.showModal();
  panel.scrollTop = 0;
}

panel.addEventListener("click", (event) => {
  if (event.target === panel) panel.close();
});

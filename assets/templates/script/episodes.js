// The panel: the episodes behind a cell, each with its `view` command.

const panel = make("dialog", { id: "episodes", "aria-labelledby": "episodes-title" });
document.body.append(panel);

/** The text of a command for an episode. */
const commandOf = ({ before, after }, at) => before + (data.episodes.word[at] ?? data.episodes.id[at]) + after;

/** One row per episode of the group. */
function episodeRows(group, metric) {
  const { id, seed, run, group: groups, values } = data.episodes;
  const rows = [];
  for (let at = 0; at < id.length; at += 1) {
    if (groups[at] !== group) continue;
    const value = values[metric][at];
    const shown = make("td", { class: value === null ? "number none" : "number", "data-key": value ?? "" });
    shown.append(value === null ? data.undefined : String(value));
    const number = (text) => make("td", { class: "number", "data-key": text }, String(text));
    const name = make("th", { scope: "row", "data-key": id[at] }, id[at]);
    if (data.commands.length > 0) name.append(make("button", { type: "button", class: "copy", "data-at": at }));
    rows.push(make("tr", {}, name, number(seed[at]), number(run[at]), shown));
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
  makeRoving(body, () => all("button.copy", body).map((button) => [button]));
  return make("table", { class: "episodes" }, make("thead", {}, make("tr", {}, ...heads)), body);
}

/** The commands to copy, and the command of the row under the pointer. */
function commandLine(table) {
  if (data.commands.length === 0) return "";
  const choice = make("select", { id: "command", "aria-label": "Command to copy" });
  choice.append(...data.commands.map(({ title }, at) => make("option", { value: at }, title)));
  const line = make("code", { id: "command-line", tabindex: -1 });
  const said = make("output", { class: "said" });
  const buttons = all("button.copy", table);
  let shown = buttons[0];
  const show = (button) => {
    shown = button;
    line.textContent = button.dataset.command;
  };
  const dress = () => {
    for (const button of buttons) {
      button.dataset.command = commandOf(data.commands[Number(choice.value)], Number(button.dataset.at));
      button.title = button.dataset.command;
      button.setAttribute("aria-label", `Copy: ${button.dataset.command}`);
    }
    said.textContent = "";
    if (shown !== undefined) show(shown);
  };
  const point = ({ target }) => {
    const button = target.closest("tr")?.querySelector("button.copy");
    if (!button || button === shown) return;
    said.textContent = "";
    show(button);
  };
  for (const type of ["pointerover", "focusin"]) table.tBodies[0].addEventListener(type, point);
  table.tBodies[0].addEventListener("click", async ({ target }) => {
    if (!target.matches("button.copy")) return;
    show(target);
    said.textContent = (await isCopied(line)) ? "Copied." : "Selected: copy it with the keys of your system.";
  });
  choice.addEventListener("change", dress);
  dress();
  return make("div", { class: "command" }, make("label", {}, "Command to copy: ", choice), line, said);
}

/** True if the text of a line is now in the clipboard; if the browser refuses, the text is selected. */
async function isCopied(line) {
  try {
    await navigator.clipboard.writeText(line.textContent);
    return true;
  } catch {
    getSelection().selectAllChildren(line);
    return false;
  }
}

/** Opens the panel for a cell; closing it returns the focus. */
function openEpisodes(cell) {
  const { metric, group, definition } = subject(cell);
  const close = make("button", { type: "button" }, "Close");
  close.addEventListener("click", () => panel.close());
  const title = make("h2", { id: "episodes-title" }, `${metric}, ${data.groups[group]}`);
  const table = episodeTable(group, metric);
  const inside = make(
    "div",
    { class: "inside" },
    make("header", {}, title, close),
    valueList(facts(cell)),
    sentence(definition),
    commandLine(table),
    table,
  );
  panel.replaceChildren(inside);
  hideTip();
  remember({ cell: metric, of: data.groups[group] });
  panel.addEventListener("close", () => {
    remember({ cell: null, of: null });
    // Runs a moment after the panel closes: a reader who has moved on with Tab keeps the focus.
    if (document.activeElement === document.body) cell.focus();
  }, { once: true });
  panel.showModal();
  panel.scrollTop = 0;
}

/** Opens the panel that the address names. */
function recallEpisodes() {
  const now = query();
  const group = data.groups.indexOf(now.get("of"));
  const isNamed = (cell) => cell.dataset.metric === now.get("cell") && Number(cell.closest("tr").dataset.group) === group;
  const cell = group < 0 ? undefined : all(".results td[data-metric]").find(isNamed);
  if (cell !== undefined) openEpisodes(cell);
}

panel.addEventListener("click", (event) => {
  if (event.target === panel) panel.close();
});

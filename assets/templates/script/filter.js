// Filters: a key column without a selection shows all of its values, else only the selected ones; words are searched
// for in the names of rows and groups. Tables and figures show the same selection.

function startFilters(results) {
  const form = document.getElementById("filters");
  const grouped = document.getElementById("grouped");
  const shown = document.getElementById("shown");
  const search = document.getElementById("search");
  const fields = all("fieldset", form).map((field) => ({ field, place: Number(field.dataset.key), column: field.dataset.column }));
  const checked = ({ field }) => all("input:checked", field);
  const label = (input) => input.nextElementSibling.textContent;

  /** The selection, by column names and by the indices of values in rows. */
  function chosen() {
    return fields.map((one) => ({ ...one, names: checked(one).map(label), places: new Set(checked(one).map((input) => input.value)) }));
  }

  function apply() {
    const wanted = chosen();
    const words = search.value.trim().toLowerCase();
    const isWanted = (row) => {
      const places = row.dataset.places.split(",");
      return row.dataset.words.includes(words) && wanted.every(({ place, places: some }) => some.size === 0 || some.has(places[place]));
    };
    const counts = results.map((table) => table.filter(isWanted));
    const rows = results[0]?.rows.length ?? 0;
    if (rows === 1) shown.textContent = `${counts[0]} of 1 row`;
    else shown.textContent = counts[0] === rows ? `all ${rows} rows` : `${counts[0]} of ${rows} rows`;
    remember({ ...Object.fromEntries(wanted.map(({ column, names }) => [column, names])), search: search.value.trim(), groups: grouped.checked ? null : "no" });
    const left = (results[0]?.rows ?? []).filter((row) => !row.hidden).map(({ dataset }) => dataset);
    document.dispatchEvent(new CustomEvent("rows", { detail: { isAll: counts[0] === rows, rows: left } }));
  }

  function group() {
    for (const table of results) table.group(grouped.checked);
    apply();
  }

  /** Restores the controls from the address. */
  function recall() {
    const now = query();
    for (const { field, column } of fields) {
      const names = now.getAll(column);
      for (const input of all("input", field)) input.checked = names.includes(label(input));
    }
    search.value = now.get("search") ?? "";
    grouped.checked = now.get("groups") !== "no";
  }

  for (const row of results.flatMap((table) => table.rows)) row.dataset.words = wordsOf(row);
  grouped.parentElement.hidden = !results.some((table) => table.groups.length > 1);
  grouped.addEventListener("change", group);
  search.addEventListener("input", apply);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("change", (event) => event.target !== grouped && event.target !== search && apply());
  form.addEventListener("reset", () => setTimeout(group));
  recall();
  form.hidden = false;
  const lines = () => [...fields.map(({ field }) => all("input", field)), all(".choices :is(input, button)", form).filter((control) => control.checkVisibility())];
  makeRoving(form, () => lines().filter((line) => line.length > 0));
  if (grouped.checked) apply();
  else group();
}

/** The searchable text of a row: its name, and those of its group and its keys. */
function wordsOf(row) {
  const { experiment = "", model = "", group } = row.dataset;
  return [row.querySelector("th").textContent, experiment, model, data.groups[Number(group)]].join(" ").toLowerCase();
}

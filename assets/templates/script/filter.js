// Filters: nothing chosen of a key column shows all of its values, anything chosen shows these alone.

function startFilters(results) {
  const form = document.getElementById("filters");
  const grouped = document.getElementById("grouped");
  const shown = document.getElementById("shown");
  const fields = all("fieldset", form);

  function apply() {
    const wanted = fields.map((field) => ({
      key: Number(field.dataset.key),
      places: new Set(all("input:checked", field).map((input) => input.value)),
    }));
    const isWanted = (row) => {
      const places = row.dataset.places.split(",");
      return wanted.every(({ key, places: chosen }) => chosen.size === 0 || chosen.has(places[key]));
    };
    const counts = results.map((table) => table.filter(isWanted));
    const rows = results[0]?.rows.length ?? 0;
    shown.textContent = counts[0] === rows ? `all ${rows} rows` : `${counts[0]} of ${rows} rows`;
    document.dispatchEvent(new Event("rows"));
  }

  grouped.parentElement.hidden = !results.some((table) => table.groups.length > 1);
  grouped.addEventListener("change", () => {
    for (const table of results) table.group(grouped.checked);
    apply();
  });
  form.addEventListener("change", (event) => event.target !== grouped && apply());
  form.addEventListener("reset", () => setTimeout(() => grouped.dispatchEvent(new Event("change"))));
  form.hidden = false;
  apply();
}

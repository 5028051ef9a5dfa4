// Sorting: rows within their groups, or all in one list. Undefined values come last in both directions.

const byText = new Intl.Collator("en", { numeric: true });

function compare(left, right) {
  return typeof left === "number" ? left - right : byText.compare(left, right);
}

/**
 * Makes headers sort the rows of `bodies()`, cycling through one direction, the other, and the original order.
 *
 * `keyOf(head)` returns a function from a row to its number or text, or null if it has none. `heard(head, way)` is
 * called on each change, without `way` for the original order. Returns `arrange()`, to call after rows have moved, and
 * `sort(head, way)`.
 */
function makeSortable(heads, bodies, keyOf, heard = () => {}) {
  let sorted = null;
  const original = new Map();
  const ways = (head) => (head.dataset.first === "descending" ? ["descending", "ascending"] : ["ascending", "descending"]);

  function arrange() {
    for (const body of bodies()) {
      const rows = all(":scope > tr:not(.heading)", body);
      for (const row of rows) if (!original.has(row)) original.set(row, original.size);
      body.append(...inOrder(rows));
    }
  }

  function inOrder(rows) {
    rows.sort((left, right) => original.get(left) - original.get(right));
    if (sorted === null) return rows;
    const key = keyOf(sorted.head);
    const sign = sorted.way === "ascending" ? 1 : -1;
    const keyed = rows.map((row) => [row, key(row)]);
    const known = keyed.filter(([, value]) => value !== null).sort((a, b) => sign * compare(a[1], b[1]));
    return [...known, ...keyed.filter(([, value]) => value === null)].map(([row]) => row);
  }

  function turn(head) {
    const [first, second] = ways(head);
    const way = sorted?.head !== head ? first : sorted.way === first ? second : null;
    sort(head, way);
    heard(head, way);
  }

  function sort(head, way) {
    sorted = way === null ? null : { head, way };
    for (const other of heads) other.removeAttribute("aria-sort");
    if (sorted !== null) head.setAttribute("aria-sort", way);
    arrange();
  }

  for (const head of heads) {
    const button = make("button", { type: "button" }, ...head.childNodes);
    button.addEventListener("click", () => turn(head));
    head.append(button);
  }
  arrange();
  const row = heads[0]?.parentElement;
  if (row) makeRoving(row, () => [heads.filter((head) => !head.hidden).map((head) => head.querySelector("button"))]);
  return { arrange, sort };
}

/** The value of a metric in a row of results. */
function meanOf(metric) {
  return (row) => {
    const cell = all("td[data-metric]", row).find((cell) => cell.dataset.metric === metric);
    return cell === undefined || cell.dataset.mean === "" ? null : Number(cell.dataset.mean);
  };
}

/** A sortable table of results, with its groups kept together or merged into one list. */
class Results {
  constructor(table) {
    this.table = table;
    this.groups = all("tbody", table);
    this.rows = all("tbody > tr:not(.heading)", table);
    this.home = new Map(this.rows.map((row) => [row, row.parentElement]));
    this.list = make("tbody");
    this.isGrouped = true;
    this.addGroupColumn();
    const keyOf = ({ dataset }) => {
      if (dataset.by === "metric") return meanOf(dataset.metric);
      if (dataset.by === "group") return (row) => this.groups.indexOf(this.home.get(row));
      return (row) => row.querySelector("th").textContent;
    };
    const heads = all("thead th", table);
    const nameOf = ({ dataset }) => dataset.metric ?? dataset.by;
    const { arrange, sort } = makeSortable(heads, () => this.bodies(), keyOf, (head, way) => {
      const others = query().getAll("sort").filter((text) => !text.startsWith(`${table.dataset.table}:`));
      remember({ sort: way === null ? others : [...others, `${table.dataset.table}:${way}:${nameOf(head)}`] });
    });
    this.arrange = arrange;
    for (const text of query().getAll("sort")) {
      const [name, way, ...rest] = text.split(":");
      const head = heads.find((head) => nameOf(head) === rest.join(":"));
      if (name === table.dataset.table && head !== undefined && ["ascending", "descending"].includes(way)) sort(head, way);
    }
  }

  bodies() {
    return this.isGrouped ? this.groups : [this.list];
  }

  /** Adds a column with each row's group, for the merged list. */
  addGroupColumn() {
    const { groupHeading } = this.table.dataset;
    if (groupHeading === "") return;
    const head = make("th", { scope: "col", "data-by": "group", "data-first": "ascending", hidden: "" }, groupHeading);
    this.table.querySelector("thead tr").prepend(head);
    for (const row of this.rows) row.prepend(make("td", { class: "group", hidden: "" }, this.home.get(row).dataset.short));
  }

  group(isGrouped) {
    this.isGrouped = isGrouped;
    if (isGrouped) for (const row of this.rows) this.home.get(row).append(row);
    else this.list.append(...this.rows);
    this.list.remove();
    if (!isGrouped) this.table.append(this.list);
    for (const body of this.groups) body.hidden = !isGrouped;
    for (const cell of all("td.group, th[data-by='group']", this.table)) cell.hidden = isGrouped;
    this.arrange();
  }

  /** Shows the rows that satisfy `isWanted`; returns their number. */
  filter(isWanted) {
    for (const row of this.rows) row.hidden = !isWanted(row);
    for (const body of this.groups) body.hidden = !this.isGrouped || !this.rows.some((row) => !row.hidden && this.home.get(row) === body);
    return this.rows.filter((row) => !row.hidden).length;
  }
}

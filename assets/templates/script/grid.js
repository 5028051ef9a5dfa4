// Keyboard access to cells: one Tab stop per table, arrow keys within it, Enter for the episodes.

const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

class Grid {
  constructor(table, open) {
    this.table = table;
    this.stop = null;
    table.setAttribute("role", "grid");
    for (const cell of all("td[data-metric]", table)) {
      cell.tabIndex = -1;
      cell.setAttribute("aria-haspopup", "dialog");
    }
    table.addEventListener("focusin", ({ target }) => target.matches("td[data-metric]") && this.moveStop(target));
    table.addEventListener("click", ({ target }) => {
      const cell = target.closest("td[data-metric]");
      if (cell !== null) open(cell);
    });
    table.addEventListener("keydown", (event) => this.press(event, open));
    document.addEventListener("rows", () => this.keepStop());
    this.keepStop();
  }

  /** The visible cells, row by row. */
  lines() {
    const rows = all("tbody:not([hidden]) > tr:not(.heading):not([hidden])", this.table);
    return rows.map((row) => all("td[data-metric]", row));
  }

  moveStop(cell) {
    if (this.stop !== null) this.stop.tabIndex = -1;
    this.stop = cell;
    if (cell !== null) cell.tabIndex = 0;
  }

  /** Moves the Tab stop to a visible cell if it is hidden. */
  keepStop() {
    const lines = this.lines();
    if (!lines.some((line) => line.includes(this.stop))) this.moveStop(lines[0]?.[0] ?? null);
  }

  press(event, open) {
    const cell = event.target;
    if (!cell.matches("td[data-metric]") || event.altKey || event.metaKey) return;
    if (event.key === "Enter" || event.key === " ") open(cell);
    else {
      const next = this.next(cell, event);
      if (next === undefined) return;
      next.focus();
      next.scrollIntoView({ block: "nearest", inline: "nearest" });
    }
    event.preventDefault();
  }

  /** The target cell of a key; undefined for other keys. */
  next(cell, { key, ctrlKey }) {
    const lines = this.lines();
    const row = lines.findIndex((line) => line.includes(cell));
    const column = lines[row].indexOf(cell);
    if (key in STEPS) {
      const [down, right] = STEPS[key];
      return lines[row + down]?.[column + right] ?? cell;
    }
    if (key === "Home") return (ctrlKey ? lines[0] : lines[row])[0];
    if (key === "End") return (ctrlKey ? lines.at(-1) : lines[row]).at(-1);
    return undefined;
  }
}

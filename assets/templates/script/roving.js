// Groups of controls by keyboard: one Tab stop, arrow keys within the group.

/**
 * Makes the controls from `lines()`, line by line, a single Tab stop.
 *
 * Returns a function to call when the controls have changed.
 */
function makeRoving(box, lines) {
  let stop = null;

  function keep() {
    const all = lines().flat();
    if (!all.includes(stop)) stop = all[0] ?? null;
    for (const control of all) control.tabIndex = control === stop ? 0 : -1;
  }

  function next(from, key) {
    const found = lines();
    const flat = found.flat();
    const line = found.findIndex((controls) => controls.includes(from));
    const at = flat.indexOf(from);
    if (key === "Home") return flat[0];
    if (key === "End") return flat.at(-1);
    if (key === "ArrowRight") return flat[at + 1];
    if (key === "ArrowLeft") return flat[at - 1];
    if (found.length === 1) return flat[at + (key === "ArrowDown" ? 1 : -1)];
    const other = found[line + (key === "ArrowDown" ? 1 : -1)];
    return other?.[Math.min(found[line].indexOf(from), other.length - 1)];
  }

  box.addEventListener("focusin", ({ target }) => {
    if (!lines().flat().includes(target)) return;
    stop = target;
    keep();
  });
  box.addEventListener("keydown", (event) => {
    const keys = ["ArrowRight", "ArrowLeft", "ArrowDown", "ArrowUp", "Home", "End"];
    if (!keys.includes(event.key) || event.altKey || event.ctrlKey || event.metaKey) return;
    if (!lines().flat().includes(event.target)) return;
    event.preventDefault();
    next(event.target, event.key)?.focus();
  });
  keep();
  return keep;
}

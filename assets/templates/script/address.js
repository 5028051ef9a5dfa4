// The state of the page, kept in its address: a link shows the same view.

/** The query of the address. */
const query = () => new URLSearchParams(location.search);

/** Sets keys of the query, list values as repeated keys; keys without a value are removed. */
function remember(changes) {
  const next = query();
  for (const [key, value] of Object.entries(changes)) {
    const items = [value].flat().filter((item) => item !== null && item !== "");
    // Unchanged keys keep their position, so that opening a link does not change it.
    if (JSON.stringify(next.getAll(key)) === JSON.stringify(items)) continue;
    next.delete(key);
    for (const item of items) next.append(key, item);
  }
  const text = next.toString();
  try {
    history.replaceState(null, "", `${location.pathname}${text === "" ? "" : `?${text}`}${location.hash}`);
  } catch {
    // A frame without its own origin has no address to change; the page works without it.
  }
}

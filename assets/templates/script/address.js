// What is looked at, in the address: a link shows the same.

/** The query of the address. */
const query = () => new URLSearchParams(location.search);

/** Sets some keys of the query, lists key by key; those without a value leave it. */
function remember(changes) {
  const next = query();
  for (const [key, value] of Object.entries(changes)) {
    const items = [value].flat().filter((item) => item !== null && item !== "");
    // What stays as it is keeps its place, so that opening a link does not change it.
    if (JSON.stringify(next.getAll(key)) === JSON.stringify(items)) continue;
    next.delete(key);
    for (const item of items) next.append(key, item);
  }
  const text = next.toString();
  try {
    history.replaceState(null, "", `${location.pathname}${text === "" ? "" : `?${text}`}${location.hash}`);
  } catch {
    // A frame without an origin of its own has no address to change; the page works without.
  }
}

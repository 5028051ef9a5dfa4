// The state of the page, kept in its address: a link shows the same view.

/** The query of the address. */
export const query = () => new URLSearchParams(location.search);

/** The keys of filters in a query. */
export const FILTERS = ["experiment", "model", "condition", "is", "where", "search"];

/** A query with the current filters and these changes. */
export function filtered(changes, from = query()) {
  const next = new URLSearchParams();
  for (const [key, value] of from) if (FILTERS.includes(key)) next.append(key, value);
  return changed(changes, next);
}

/** A query with some keys set, list values as repeated keys, and null values removed. */
export function changed(changes, from = query()) {
  const next = new URLSearchParams(from);
  next.delete("token");
  for (const [key, value] of Object.entries(changes)) {
    next.delete(key);
    for (const item of [value].flat()) if (item !== null && item !== undefined && item !== "") next.append(key, item);
  }
  return next;
}

/** A link to a query. */
export const link = (next) => `${location.pathname}?${next}`;

/** Navigates to a query, with a new history entry or replacing the current one. */
export function go(next, { replace = false } = {}) {
  const target = link(next);
  if (target === location.pathname + location.search) return;
  if (replace) history.replaceState(null, "", target);
  else history.pushState(null, "", target);
  document.dispatchEvent(new CustomEvent("state", { detail: { replace } }));
}

document.addEventListener("click", (event) => {
  const anchor = event.target.closest?.("a[href]");
  if (anchor === null || anchor === undefined || event.defaultPrevented || event.button !== 0) return;
  if (event.ctrlKey || event.metaKey || event.shiftKey || event.altKey || anchor.target !== "") return;
  const target = new URL(anchor.href, location.href);
  if (target.origin !== location.origin || target.pathname !== location.pathname || target.hash !== "") return;
  event.preventDefault();
  go(target.searchParams);
});

addEventListener("popstate", () => document.dispatchEvent(new CustomEvent("state", { detail: { replace: false } })));

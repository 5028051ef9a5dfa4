// What is looked at, in the address: a link shows the same.

/** The query of the address. */
export const query = () => new URLSearchParams(location.search);

/** The filters of a query. */
export const FILTERS = ["experiment", "model", "condition", "is", "where", "search"];

/** A query with the filters of the present one, and this. */
export function filtered(changes, from = query()) {
  const next = new URLSearchParams();
  for (const [key, value] of from) if (FILTERS.includes(key)) next.append(key, value);
  return changed(changes, next);
}

/** A query with some keys set, lists key by key, and those removed that are null. */
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

/** Goes there: a step that leads back, or in the place of the present one. */
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

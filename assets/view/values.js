// Values for readers: words, and colour patches.
import { make } from "./dom.js";

export const valueAt = (episode, name, t) => episode.steps[name]?.values[t - 1] ?? null;
/** The numbers of a column, to draw; null if not finite. The page shows the program's text, since a number may have been rounded. */
export const numbersOf = (column) => (column?.values ?? []).map((text) => (text === null || !Number.isFinite(Number(text)) ? null : Number(text)));
export const constant = (episode, name) => episode.constants.find((column) => column.name === name)?.value ?? null;

/** The words of a value. */
export function spelled(value, unit = null) {
  if (value === null) return "--";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "object") return `${value.text}…`;
  return unit === null ? String(value) : `${value} ${unit}`;
}

const paints = new Map();

/** Sets the study's colours to the program's paints. */
export function setPaint(list) {
  for (const { name, rgb } of list) paints.set(name, `rgb(${rgb.join(" ")})`);
}

/** The paint of a colour's name; other names as the browser knows them, else null. */
export const paintOf = (name) => paints.get(name) ?? (CSS.supports("color", name) ? name : null);

/** A colour with a patch of it; other words unchanged. */
export function colored(value) {
  const paint = paintOf(value);
  const patch = paint === null ? null : make("i", { class: "patch", "aria-hidden": "true" });
  if (patch !== null) patch.style.background = paint;
  return make("span", {}, patch, spelled(value));
}

// Values as a reader sees them: words, and patches of colours.
import { make } from "./dom.js";

export const valueAt = (episode, name, t) => episode.steps[name]?.values[t - 1] ?? null;
export const constant = (episode, name) => episode.constants.find((column) => column.name === name)?.value ?? null;

/** The words of a value. */
export function spelled(value, unit = null) {
  if (value === null) return "--";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "object") return `${value.text}…`;
  return unit === null ? String(value) : `${value} ${unit}`;
}

const paints = new Map();

/** The colours of the study, as the program paints them. */
export function setPaint(list) {
  for (const { name, rgb } of list) paints.set(name, `rgb(${rgb.join(" ")})`);
}

/** The paint of a colour's name; other names as the browser knows them, or none. */
export const paintOf = (name) => paints.get(name) ?? (CSS.supports("color", name) ? name : null);

/** A colour with a patch of it; other words stay as they are. */
export function colored(value) {
  const paint = paintOf(value);
  const patch = paint === null ? null : make("i", { class: "patch", "aria-hidden": "true" });
  if (patch !== null) patch.style.background = paint;
  return make("span", {}, patch, spelled(value));
}

// The room from above: shapes as the program found them in the log, the way so far, and the heading.
import { draw } from "./dom.js";

const REACH = 1.2;

function bounds(map, path) {
  const points = map.shapes.flatMap((shape) => shape.outline).concat(path);
  const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)];
  const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const margin = map.shapes.length > 0 ? 0.05 * Math.max(right - left, high - low, 1) : REACH;
  return { left: left - margin, width: right - left + 2 * margin, top: high + margin, height: high - low + 2 * margin };
}

const kindOf = (name) => (name.startsWith("pane") ? "mirror" : /^agent0/.test(name) ? "self" : /^agent/.test(name) ? "other" : /^cube/.test(name) ? "cube" : "room");

function drawn({ name, outline, radius, rgba }) {
  const [r, g, b, a] = rgba;
  const attributes = { class: kindOf(name), fill: `rgb(${[r, g, b].map((part) => Math.round(part * 255)).join(" ")})`, "fill-opacity": a };
  const title = draw("title", {}, name);
  if (radius !== null) return draw("circle", { ...attributes, cx: outline[0][0], cy: -outline[0][1], r: radius }, title);
  return draw("polygon", { ...attributes, points: outline.map(([x, y]) => `${x},${-y}`).join(" ") }, title);
}

/** A map of an episode; `show(t)` draws a step. */
export function mapOf(episode, map) {
  const column = (name) => episode.steps[name]?.values ?? [];
  const [xs, ys, yaws] = [column("pose_x"), column("pose_y"), column("pose_yaw")];
  const path = xs.map((x, at) => [x, ys[at]]).filter(([x, y]) => x !== null && y !== null && y !== undefined);
  const picture = draw("svg", { class: "map", role: "img", "aria-label": "The room from above" });
  if (path.length === 0 && map.shapes.length === 0) return { picture: null, show: () => {} };
  const { left, width, top, height } = bounds(map, path);
  picture.setAttribute("viewBox", `${left} ${-top} ${width} ${height}`);
  const unit = Math.max(width, height) / 100;
  const show = (t) => {
    const shapes = (map.steps[t - 1] ?? []).map((at) => drawn(map.shapes[at]));
    const way = draw("polyline", { class: "way", points: path.slice(0, t).map(([x, y]) => `${x},${-y}`).join(" "), "stroke-width": unit * 0.6 });
    const parts = [...shapes, way];
    const [x, y, yaw] = [xs[t - 1], ys[t - 1], yaws[t - 1]];
    if (typeof x === "number" && typeof y === "number") {
      if (typeof yaw === "number") {
        const angle = (yaw * Math.PI) / 180;
        parts.push(draw("line", { class: "heading", x1: x, y1: -y, x2: x + REACH * Math.cos(angle), y2: -(y + REACH * Math.sin(angle)), "stroke-width": unit * 0.8 }));
      }
      parts.push(draw("circle", { class: "here", cx: x, cy: -y, r: unit * 1.4, "stroke-width": unit * 0.5 }));
    }
    picture.replaceChildren(...parts);
  };
  return { picture, show };
}

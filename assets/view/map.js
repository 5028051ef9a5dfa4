// The room from above: the program's shapes, the path so far, the heading, and the cone of view.
import { draw, make } from "./dom.js";
import { numbersOf } from "./values.js";

const REACH = 1.2;
const KINDS = [["self", "itself"], ["other", "another body"], ["mirror", "mirror"], ["cube", "cube"], ["wall", "wall"]];

const kindOf = (name) => (name.startsWith("pane") ? "mirror" : /^agent0/.test(name) ? "self" : /^agent/.test(name) ? "other" : /^cube/.test(name) ? "cube" : /^wall/.test(name) ? "wall" : "room");

/** The shapes of an answer, converted to metres: name, paint, height, radius and corners come in centimetres. */
function unpacked({ names, paints, shapes, still, steps, every }) {
  const all = shapes.map(([name, paint, height, radius, ...places]) => {
    const outline = Array.from({ length: places.length / 2 }, (_, at) => [places[2 * at] / 100, places[2 * at + 1] / 100]);
    return { name: names[name], kind: kindOf(names[name]), paint: paints[paint], height, radius: radius / 100, outline };
  });
  const at = (t) => {
    const own = steps[Math.floor((t - 1) / every)] ?? null;
    return own === null ? [] : [...still, ...own].map((id) => all[id]).sort((a, b) => a.height - b.height);
  };
  return { all, at, every };
}

export const EMPTY = { names: [], paints: [], shapes: [], still: [], steps: [], every: 1 };

function bounds(shapes, path) {
  const points = shapes.flatMap((shape) => shape.outline).concat(path);
  const reach = (list) => list.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
  const [[left, right], [low, high]] = [reach(points.map(([x]) => x)), reach(points.map(([, y]) => y))];
  const margin = shapes.length > 0 ? 0.05 * Math.max(right - left, high - low, 1) : REACH;
  return { left: left - margin, width: right - left + 2 * margin, top: high + margin, height: high - low + 2 * margin, inset: shapes.length > 0 ? margin : 0 };
}

function drawn({ name, kind, paint, radius, outline }) {
  const [r, g, b, a] = paint;
  const attributes = { class: kind, fill: `rgb(${r} ${g} ${b})`, "fill-opacity": a / 100 };
  const title = draw("title", {}, name);
  if (radius > 0) return draw("circle", { ...attributes, cx: outline[0][0], cy: -outline[0][1], r: radius }, title);
  return draw("polygon", { ...attributes, points: outline.map(([x, y]) => `${x},${-y}`).join(" ") }, title);
}

/** Half of the horizontal field of view, radians; null if the trace does not have it. */
function halfAngle(view) {
  if (!view || !(view.fov_y > 0 && view.fov_y < 180)) return null;
  return Math.atan(Math.tan((view.fov_y * Math.PI) / 360) * (view.width / view.height));
}

/** The part of the room in the field of view; the inner picture ends at the walls. */
function cone({ left, width, top, height, inset }, x, y, angle, half) {
  const reach = width + height;
  const end = (turn) => `${x + reach * Math.cos(angle + turn)} ${-(y + reach * Math.sin(angle + turn))}`;
  const path = draw("path", { class: "cone", d: `M ${x} ${-y} L ${end(half)} A ${reach} ${reach} 0 0 1 ${end(-half)} Z` });
  const room = { x: left + inset, y: -top + inset, width: width - 2 * inset, height: height - 2 * inset };
  return draw("svg", { ...room, viewBox: `${room.x} ${room.y} ${room.width} ${room.height}` }, path);
}

/** The legend of a map's shapes and lines. */
function legendOf({ all, every }, half) {
  const items = KINDS.filter(([kind]) => all.some((shape) => shape.kind === kind)).map(([kind, words]) => {
    const patch = make("i", { class: `key ${kind}`, "aria-hidden": "true" });
    if (kind === "self" || kind === "other") {
      const [r, g, b] = all.find((shape) => shape.kind === kind).paint;
      patch.style.background = `rgb(${r} ${g} ${b})`;
    }
    return make("li", {}, patch, words);
  });
  const way = make("li", {}, make("i", { class: "key way", "aria-hidden": "true" }), "way so far, and where it looks");
  const seen = half === null ? null : make("li", {}, make("i", { class: "key cone", "aria-hidden": "true" }), `field of view, ${Math.round((360 * half) / Math.PI)} degrees`);
  return [...items, way, seen, every > 1 ? make("li", {}, `bodies of one step in ${every}`) : null].filter((item) => item !== null);
}

/** A map of an episode; `show(t)` draws a step. */
export function mapOf(episode, map) {
  const room = unpacked(map);
  const column = (name) => numbersOf(episode.steps[name]);
  const [xs, ys, yaws] = [column("pose_x"), column("pose_y"), column("pose_yaw")];
  const path = xs.map((x, at) => [x, ys[at]]).filter(([x, y]) => x !== null && y !== null && y !== undefined);
  const picture = draw("svg", { class: "map", role: "img", "aria-label": "The room from above" });
  if (path.length === 0 && room.all.length === 0) return { picture: null, legend: [], show: () => {} };
  const limits = bounds(room.all, path);
  const { left, width, top, height } = limits;
  picture.setAttribute("viewBox", `${left} ${-top} ${width} ${height}`);
  const unit = Math.max(width, height) / 100;
  const half = halfAngle(episode.view);
  const show = (t) => {
    const shapes = room.at(t).map(drawn);
    const way = draw("polyline", { class: "way", points: path.slice(0, t).map(([x, y]) => `${x},${-y}`).join(" "), "stroke-width": unit * 0.6 });
    const parts = [...shapes, way];
    const [x, y, yaw] = [xs[t - 1], ys[t - 1], yaws[t - 1]];
    if (typeof x === "number" && typeof y === "number") {
      if (typeof yaw === "number") {
        const angle = (yaw * Math.PI) / 180;
        if (half !== null) parts.push(cone(limits, x, y, angle, half));
        parts.push(draw("line", { class: "heading", x1: x, y1: -y, x2: x + REACH * Math.cos(angle), y2: -(y + REACH * Math.sin(angle)), "stroke-width": unit * 0.8 }));
      }
      parts.push(draw("circle", { class: "here", cx: x, cy: -y, r: unit * 1.4, "stroke-width": unit * 0.5 }));
    }
    picture.replaceChildren(...parts);
  };
  return { picture, legend: legendOf(room, half), show };
}

// Figures: their size, keyboard access to their values, and fading of filtered marks.

const ZOOM = 1.25;

function startFigure(figure) {
  const sheet = figure.querySelector(".sheet");
  const picture = sheet.querySelector("svg");
  const zoom = figure.querySelector(".zoom");
  zoom.hidden = false;
  zoom.addEventListener("click", ({ target }) => {
    const way = target.closest("button")?.dataset.zoom;
    if (way === undefined) return;
    const width = picture.getBoundingClientRect().width;
    sheet.classList.toggle("zoomed", way !== "fit");
    picture.style.width = way === "fit" ? "" : `${way === "in" ? width * ZOOM : width / ZOOM}px`;
  });
  makeRoving(zoom, () => [all("button", zoom)]);
  readable(sheet, all(".mark", sheet));
}

/** Fades the marks of filtered rows; the axes stay, so that the other marks do not move. */
function startFading() {
  const marks = all(".sheet .mark").map((mark) => ({ mark, names: namesOf(mark) }));
  document.addEventListener("rows", ({ detail: { isAll, rows } }) => {
    const isLeft = ({ experiments, model }) => experiments.every((experiment) => rows.some((row) => isOf(row, experiment, model)));
    for (const { mark, names } of marks) mark.classList.toggle("off", !isAll && !isLeft(names));
  });
}

/** True if a mark may show a row, as far as both state their names. */
function isOf(row, experiment, model) {
  const isModel = [row.model, undefined].includes(model) || row.model === undefined || model.startsWith(`${row.model} [`);
  return isModel && ([row.experiment, undefined].includes(experiment) || row.experiment === undefined);
}

/** The experiments and the model of a mark; lines have them only in their title: `E1 → E2 · GPT 5.1`. */
function namesOf(mark) {
  const { experiment, model } = mark.dataset;
  if (experiment !== undefined || model !== undefined) return { experiments: [experiment], model };
  const [head, ...rest] = (mark.querySelector(":scope > title")?.textContent ?? "").split(" · ");
  return rest.length === 0 ? { experiments: [undefined] } : { experiments: head.split(" → "), model: rest.join(" · ") };
}

/** Lets arrow keys move through the marks of a figure. */
function readable(sheet, marks) {
  let at = -1;
  const steps = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1, PageDown: 10, PageUp: -10, Home: -Infinity, End: Infinity };
  const leave = () => {
    marks[at]?.classList.remove("read");
    hideTip();
  };
  sheet.addEventListener("keydown", (event) => {
    if (!(event.key in steps) || marks.length === 0 || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    leave();
    at = Math.max(0, Math.min(marks.length - 1, at + steps[event.key]));
    marks[at].classList.add("read");
    marks[at].scrollIntoView({ block: "nearest", inline: "nearest" });
    const text = markText(marks[at]);
    showTip(marks[at], text);
    announcer.textContent = text;
  });
  sheet.addEventListener("blur", leave);
}

const announcer = make("p", { class: "unseen", "aria-live": "polite" });
document.body.append(announcer);

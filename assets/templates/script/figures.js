// Figures: their size, and their values by keyboard.

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
  readable(sheet, all(".mark", sheet));
}

/** Lets the arrow keys go through the marks of a figure. */
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

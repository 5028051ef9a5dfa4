// The entry point.

/** Light or dark: the system's setting until the reader chooses. */
function startTheme() {
  const root = document.documentElement;
  const button = document.getElementById("theme");
  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
  const show = () => button.setAttribute("aria-pressed", String(isDark()));
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    show();
  });
  system.addEventListener("change", show);
  button.hidden = false;
  show();
}

/** Keeps headers in view: at the top of the window, or of the scrolling box around a wide table. */
function keepHeads(box) {
  const look = () => {
    box.classList.remove("wide", "fits");
    const isWide = box.scrollWidth > box.clientWidth + 1;
    box.classList.add(isWide ? "wide" : "fits");
    // Scrollable content must be reachable by keyboard; without focusable content, the box itself is focusable.
    if (isWide && box.querySelector("a, button, [tabindex]") === null) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  };
  new ResizeObserver(look).observe(box);
  look();
}

/** Opens collapsed sections for printing. */
function startPrinting() {
  const folded = [];
  addEventListener("beforeprint", () => {
    hideTip();
    for (const details of all("details:not([open], .raw)")) {
      details.open = true;
      folded.push(details);
    }
  });
  addEventListener("afterprint", () => {
    for (const details of folded.splice(0)) details.open = false;
  });
}

startTheme();
startPrinting();
startTips();
const results = all("table.results").map((table) => new Results(table));
for (const table of all("table.results")) new Grid(table, openEpisodes);
startFading();
startPair();
startFilters(results);
for (const hint of all(".hint")) hint.hidden = false;
for (const figure of all("figure")) if (figure.querySelector("svg") !== null) startFigure(figure);
for (const links of all("nav")) makeRoving(links, () => [all("a:not([hidden])", links)]);
for (const box of all(".scroll")) keepHeads(box);
recallEpisodes();

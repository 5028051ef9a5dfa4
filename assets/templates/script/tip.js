// The tip: details of a cell, a header or a mark of a figure, shown on hover and on focus.

const tip = make("div", { class: "tip", id: "tip", role: "tooltip", hidden: "" });
document.body.append(tip);
let tipped = null;

// Scrolling by keys moves elements under a resting pointer; the reader does not point at these.
let isPointing = true;

/** Shows `content` near `target`, inside the window. */
function showTip(target, ...content) {
  hideTip();
  tip.replaceChildren(...content);
  tip.hidden = false;
  tipped = target;
  if (target instanceof HTMLElement) target.setAttribute("aria-describedby", tip.id);
  placeTip();
}

function placeTip() {
  const gap = 6;
  const at = tipped.getBoundingClientRect();
  const { width, height } = tip.getBoundingClientRect();
  const below = at.bottom + gap;
  const isBelow = below + height <= innerHeight || at.top < height + gap;
  const left = Math.max(gap, Math.min(at.left, document.documentElement.clientWidth - width - gap));
  tip.style.left = `${left}px`;
  tip.style.top = `${Math.max(gap, Math.min(isBelow ? below : at.top - height - gap, innerHeight - height - gap))}px`;
}

function hideTip() {
  tipped?.removeAttribute("aria-describedby");
  tipped = null;
  tip.hidden = true;
}

/** The tip of an element; empty if it has none. */
function tipContent(target) {
  if (target.matches("td[data-metric]")) {
    const { metric, group, definition } = subject(target);
    const name = make("p", { class: "name" }, make("b", {}, metric), `, ${data.groups[group]}`);
    return [name, valueList(facts(target)), sentence(definition)];
  }
  if (target.matches("th[data-metric]")) return [sentence(data.metrics[target.dataset.metric])];
  return markText(target) === "" ? null : [markText(target)];
}

/** A mark's title, removed from the figure so that the browser does not show it a second time. */
function markText(mark) {
  const title = mark.querySelector(":scope > title");
  if (title !== null) {
    mark.setAttribute("aria-label", title.textContent);
    title.remove();
  }
  return mark.getAttribute("aria-label") ?? "";
}

/** Detects whether the pointer itself moves. */
function watchPointer() {
  let last = null;
  const notice = ({ type, clientX, clientY }) => {
    const place = `${clientX},${clientY}`;
    if (type === "pointerdown" || (last !== null && place !== last)) isPointing = true;
    last = place;
  };
  for (const type of ["pointerdown", "pointermove", "pointerover"]) document.addEventListener(type, notice);
}

function startTips() {
  watchPointer();
  const selector = ".results td[data-metric], .results th[data-metric], .sheet .mark";
  const show = (event) => {
    const target = event.target.closest?.(selector);
    if (!target || target === tipped) return;
    const content = tipContent(target);
    if (content !== null) showTip(target, ...content);
  };
  const hide = ({ target, relatedTarget }) => {
    if (tipped?.contains(target) && !tipped.contains(relatedTarget)) hideTip();
  };
  document.addEventListener("focusin", show);
  document.addEventListener("focusout", hide);
  document.addEventListener("pointerout", hide);
  document.addEventListener("pointerover", (event) => isPointing && show(event));
  document.addEventListener("scroll", () => tipped !== null && placeTip(), { capture: true, passive: true });
  document.addEventListener("keydown", ({ key }) => {
    isPointing = false;
    if (key === "Escape") hideTip();
  });
}

// Elements built from text, and markup from the program's own templates.

export const all = (selector, root = document) => [...root.querySelectorAll(selector)];
export const one = (selector, root = document) => root.querySelector(selector);

/** An element; children that are text stay text. Attributes that are null or false are left out. */
export function make(name, attributes = {}, ...children) {
  return filled(document.createElement(name), attributes, children);
}

const SVG = "http://www.w3.org/2000/svg";

/** The same in SVG. */
export function draw(name, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

function filled(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** The elements of markup from the program's templates, which escape their values. */
export function parsed(markup) {
  return [...new DOMParser().parseFromString(markup, "text/html").body.childNodes];
}

/** An error message on a page. */
export function notice(words) {
  return make("pre", { class: "notice", role: "alert" }, words);
}

/** A count with its noun: `1 episode`, `2 episodes`. */
export function counted(count, noun) {
  return `${count} ${noun}${count === 1 ? "" : "s"}`;
}

/** A button that copies a text and confirms it. */
export function copyButton(words, text) {
  const button = make("button", { type: "button", class: "copy" }, words);
  button.addEventListener("click", async () => {
    const value = text();
    try {
      await navigator.clipboard.writeText(value);
      button.textContent = "Copied";
    } catch {
      // Without access to the clipboard, the page shows the text to copy.
      const field = make("input", { type: "text", readonly: true, value, "aria-label": words });
      button.replaceWith(field);
      field.select();
    }
    setTimeout(() => (button.textContent = words), 2000);
  });
  return button;
}

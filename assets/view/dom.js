// Elements made of text, and markup of the program's own templates.

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

/** The elements of markup that the program's templates made: they escape what they are given. */
export function parsed(markup) {
  return [...new DOMParser().parseFromString(markup, "text/html").body.childNodes];
}

/** What a page says where something failed. */
export function notice(words) {
  return make("pre", { class: "notice", role: "alert" }, words);
}

/** How many: `1 episode`, `2 episodes`. */
export function counted(count, noun) {
  return `${count} ${noun}${count === 1 ? "" : "s"}`;
}

/** A button that copies a text, and says so. */
export function copyButton(words, text) {
  const button = make("button", { type: "button", class: "copy" }, words);
  button.addEventListener("click", async () => {
    const value = text();
    try {
      await navigator.clipboard.writeText(value);
      button.textContent = "Copied";
    } catch {
      // A page that is not trusted with the clipboard shows what to copy.
      const field = make("input", { type: "text", readonly: true, value, "aria-label": words });
      button.replaceWith(field);
      field.select();
    }
    setTimeout(() => (button.textContent = words), 2000);
  });
  return button;
}

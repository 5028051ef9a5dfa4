// Recordings in progress: polls for changes and redraws what has changed.
import { one } from "./dom.js";
import { ask, isCopy } from "./data.js";

const PAUSE = 1000;

/** Polls the server; `changed(told)` is called for each newer state, `heard(told)` for every answer. */
export function watch({ changed, heard }) {
  if (isCopy) return;
  const status = one("#live");
  let generation = null;
  const turn = async () => {
    try {
      if (document.visibilityState === "visible") {
        const told = await ask("live");
        const words = [...told.unreadable];
        if (told.running.length > 0) words.unshift(`${told.running.length} under way${told.rate === null ? "" : `, ${told.rate} steps a second`}`);
        status.textContent = told.fault === null ? words.join("; ") : `shown as it was before: ${told.fault}`;
        heard(told);
        if (generation !== null && told.generation !== generation) await changed(told);
        generation = told.generation;
      }
    } catch {
      status.textContent = "the program has ended; the page stays unchanged";
    }
    setTimeout(turn, PAUSE);
  };
  turn();
}

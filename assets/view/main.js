// The entry point: routing, keys and the theme.
import { all, make, notice, one } from "./dom.js";
import { ask, isCopy, onlyEpisode } from "./data.js";
import { changed, filtered, go, link, query } from "./state.js";
import { overview, showRunning } from "./overview.js";
import { list, listQuery } from "./list.js";
import { setPaint } from "./values.js";
import { episodePage } from "./episode.js";
import { changesPage, comparePage, scenePage } from "./compare.js";
import { watch } from "./live.js";

const content = one("#content");
const KEYS = [["← →", "one step back, one step on"], ["↑ ↓", "ten steps back, ten steps on"], ["Home End", "the first step, the last step"], ["space", "play and pause"], ["[ ]", "the previous episode, the next episode"], ["/", "search in names, replies, reasoning and errors"], ["l", "label the episode or the step, with view --label NAME"], ["?", "these keys"]];

let study = null;
let page = {};
let turn = 0;

function tabs() {
  const view = query().get("view") ?? "overview";
  const tab = (name, words, next) => make("a", { href: link(next), "aria-current": view === name ? "page" : false }, words);
  const tabs = [tab("overview", "Overview", filtered({})), tab("episodes", "Episodes", listQuery())];
  if (study?.against) tabs.push(tab("changes", `Against ${study.against}`, filtered({ view: "changes" })));
  one("#find").hidden = onlyEpisode !== null;
  one("#tabs").replaceChildren(...(onlyEpisode === null ? tabs : []));
  one("#find").elements.search.value = query().get("search") ?? "";
}

const PAGES = { overview, episodes: list, episode: episodePage, compare: comparePage, scene: scenePage, changes: changesPage };

/** Returns a function that restores the focus in the filters after they are redrawn. */
function focused() {
  const { name, value, type } = document.activeElement ?? {};
  if (!document.activeElement?.closest?.("form.filters") || !name) return () => {};
  return () => {
    const again = all(`form.filters input[name="${CSS.escape(name)}"]`, content).find((input) => type !== "checkbox" || input.value === value);
    const menu = again?.closest("details");
    if (menu) menu.open = true;
    again?.focus({ preventScroll: true });
  };
}

/** Draws the page that the address names. */
async function show({ keep = false } = {}) {
  turn += 1;
  const own = turn;
  page.leave?.();
  const scroll = keep ? scrollY : 0;
  const focus = focused();
  try {
    study = keep || study === null ? await ask("study") : study;
    setPaint(study.paint ?? []);
    const fresh = document.createElement("div");
    tabs();
    const made = (await (PAGES[query().get("view") ?? "overview"] ?? overview)(content, study)) ?? {};
    if (own === turn) page = made;
    document.title = `${one("h1", content)?.textContent ?? "mirrorstats"} · mirrorstats`;
    fresh.remove();
  } catch (error) {
    if (own === turn) {
      page = {};
      const back = make("p", {}, make("a", { href: link(filtered({ view: query().get("view"), where: null })) }, "Without the condition"));
      content.replaceChildren(notice(error.message), query().has("where") ? back : "");
    }
  }
  if (own === turn) {
    scrollTo(0, scroll);
    focus();
    document.documentElement.dataset.shown = String(own);
  }
}

function startTheme() {
  const root = document.documentElement;
  const button = one("#theme");
  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
  const tell = () => button.setAttribute("aria-pressed", String(isDark()));
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    tell();
  });
  system.addEventListener("change", tell);
  tell();
}

function startHelp() {
  const dialog = one("#help");
  const close = make("button", { type: "button" }, "Close");
  close.addEventListener("click", () => dialog.close());
  const rows = KEYS.flatMap(([key, words]) => [make("dt", {}, make("kbd", {}, key)), make("dd", {}, words)]);
  dialog.append(make("div", { class: "inside" }, make("header", {}, make("h2", { id: "help-title" }, "Keys"), close), make("dl", { class: "values" }, rows)));
  one("#help-button").addEventListener("click", () => dialog.showModal());
  return dialog;
}

function startKeys(help) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || one("dialog[open]") !== null) return;
    const isTyping = event.target.matches("input:not([type=range]):not([type=checkbox]), select, textarea");
    if (isTyping) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    if (event.key === "/") one("#find").elements.search.focus();
    else if (event.key === "?") help.showModal();
    else if (page.keys?.[event.key] && !(event.key === " " && event.target.matches("button, summary, a, input"))) page.keys[event.key]();
    else return;
    event.preventDefault();
  });
}

function startSearch() {
  const form = one("#find");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    go(changed({ view: "episodes", search: form.elements.search.value.trim(), id: null, t: null, pick: null }));
  });
}

let underWay = [];
// The filter choices have changed.
const forget = () => (study = null);
document.addEventListener("labelled", forget);
document.addEventListener("state", ({ detail }) => detail.replace || show());
startTheme();
startKeys(startHelp());
startSearch();
if (onlyEpisode !== null) history.replaceState(null, "", link(changed({ view: "episode", id: onlyEpisode })));
if (query().has("token")) history.replaceState(null, "", link(changed({})));
show().then(() =>
  watch({
    heard(told) {
      underWay = told.running;
      if ((query().get("view") ?? "overview") === "overview") showRunning(content, underWay, told.rate);
    },
    async changed() {
      forget();
      const view = query().get("view") ?? "overview";
      if (view === "compare" || (view === "episode" && !page.running)) return;
      if (view === "episode" && query().has("t")) go(changed({ t: null }), { replace: true });
      await show({ keep: true });
      if (view === "overview") showRunning(content, underWay, null);
    },
  }),
);
if (isCopy) document.body.dataset.copy = "yes";

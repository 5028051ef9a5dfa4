// A person in the agent's place: the frame, the words and the reply of a model, and nothing else.

const LINK = new URLSearchParams(location.search).get("p") ?? "";
const WORDS = {
  w: "Forward", s: "Backward", a: "Turn left", d: "Turn right", done: "Done",
  1: "Hand up", 2: "Hand down", 3: "Hand left", 4: "Hand right", 5: "Hand forward", 6: "Hand backward",
};
// Arrows walk and turn, or move a hand in the picture; the other keys are the letters and numbers themselves.
const ARROWS = { ArrowUp: ["w", "1"], ArrowDown: ["s", "2"], ArrowLeft: ["a", "3"], ArrowRight: ["d", "4"] };
const TITLES = {
  "view-description": "What you see (may stay empty)",
  reasoning: "Why (may stay empty)",
  summary: "Notes for your next step (may stay empty)",
  identification: "Who are you, and how do you know? In your own words",
  selected_cube: "The cube, when you are done",
  mark: "The mark on your own body",
};
const PAUSE = 700;

const content = document.getElementById("content");
let shown = null;
let kept = {};
let timer = null;

function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children.filter((child) => child !== null));
  return element;
}

const address = (name, more = {}) => `${name}?${new URLSearchParams({ p: LINK, ...more })}`;

async function ask(name) {
  const response = await fetch(address(name));
  if (!response.ok) throw new Error(await response.text());
  return response.json();
}

async function send(name, body = {}) {
  const response = await fetch(address(name), { method: "POST", body: JSON.stringify(body) });
  if (!response.ok) throw new Error(await response.text());
  return response.json();
}

function button(words, does, attributes = {}) {
  const element = make("button", { type: "button", ...attributes }, words);
  element.addEventListener("click", does);
  return element;
}

function consent({ words }) {
  const agree = button("I agree", () => send("agree").then(show), { id: "agree" });
  content.replaceChildren(make("h1", {}, "Before you begin"), make("div", { class: "consent" }, make("pre", {}, words)), agree);
}

function waiting({ played }) {
  const words = played > 0 ? "Thank you: that episode is over. If there is another, it comes here." : "Please wait: the next episode comes here.";
  content.replaceChildren(make("h1", {}, "Nothing to do now"), make("p", { id: "waiting" }, words), make("p", { class: "quiet" }, "You may close this page and come back with the same link."));
}

function pausing() {
  content.replaceChildren(make("h1", {}, "A break"), make("p", {}, "Take your time: nothing is counted now."), button("Go on", () => send("resume").then(show), { id: "resume" }));
}

function field(key, colors) {
  const title = TITLES[key] ?? key;
  if (key === "selected_cube" || key === "mark") {
    const options = ["none", ...colors].map((color) => make("option", { value: color }, color));
    return make("label", {}, title, make("select", { name: key }, ...options));
  }
  const area = key === "identification" ? make("input", { name: key, type: "text", autocomplete: "off" }) : make("textarea", { name: key });
  area.value = kept[key] ?? "";
  return make("label", {}, title, area);
}

function play(told) {
  const { phase, number, t, system, user, keys, actions: letters, colors } = told;
  const form = make("form", {});
  let sent = false;
  const reply = async (action) => {
    if (sent) return;
    sent = true;
    const values = Object.fromEntries(keys.map((key) => [key, key === "action" ? action : (form.elements[key]?.value ?? "")]));
    if (action !== "done" && "selected_cube" in values) values.selected_cube = "none";
    kept = { identification: values.identification ?? "" };
    for (const one of form.querySelectorAll("button")) one.disabled = true;
    await send("reply", { number, reply: values });
    turn();
  };
  const actions = letters.map((action) => button(action === "done" ? WORDS[action] : `${WORDS[action]} (${action})`, () => reply(action), { "data-action": action }));
  const fields = keys.filter((key) => key !== "action").map((key) => field(key, colors));
  const order = ["identification", "selected_cube", "mark"];
  fields.sort((a, b) => order.indexOf(b.lastChild.name) - order.indexOf(a.lastChild.name));
  form.append(make("div", { class: "actions", role: "group", "aria-label": "What you do" }, ...actions), ...fields, button("Take a break", () => send("pause").then(show), { id: "pause" }));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.reply = reply;
  form.letters = letters;
  const image = make("img", { src: address("frame", { n: number }), alt: "What you see", width: 640, height: 480 });
  const words = make("details", {}, make("summary", {}, "The task, as it was said at the beginning"), make("pre", {}, system));
  words.open = t === 1;
  const head = make("h1", {}, phase === "practice" ? make("span", { class: "practice" }, "Practice: this one does not count") : "", phase === "practice" ? ` step ${t}` : `Step ${t}`);
  content.replaceChildren(head, make("div", { class: "play" }, make("div", {}, image, words), make("div", {}, make("pre", { id: "user" }, user), form)));
  content.dataset.phase = phase;
  content.dataset.number = number;
}

function show(told) {
  const same = shown !== null && shown.phase === told.phase && shown.number === told.number && shown.played === told.played;
  shown = told;
  if (same) return;
  content.dataset.phase = told.phase;
  if (told.phase === "consent") consent(told);
  else if (told.phase === "break") pausing();
  else if (told.phase === "waiting") waiting(told);
  else play(told);
}

async function turn() {
  clearTimeout(timer);
  try {
    show(await ask("state"));
  } catch (error) {
    shown = null;
    content.replaceChildren(make("h1", {}, "Not now"), make("p", {}, error.message));
  }
  timer = setTimeout(turn, shown?.phase === "waiting" ? PAUSE / 4 : PAUSE);
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || event.target.matches("input, select, textarea")) return;
  const form = content.querySelector("form");
  if (form === null) return;
  const action = form.letters.find((letter) => letter !== "done" && (letter === event.key || ARROWS[event.key]?.includes(letter)));
  if (action === undefined) return;
  event.preventDefault();
  form.reply(action);
});

turn();

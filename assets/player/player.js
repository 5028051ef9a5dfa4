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

// A request that nobody answers in this time has failed.
const PATIENCE = 20_000;
// So many questions in a row without an answer: the server has gone.
const GONE = 3;

const content = document.getElementById("content");
const notice = document.getElementById("notice");
let shown = null;
let round = null;
let kept = {};
let typed = {};
let timer = null;
let unanswered = 0;

function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children.filter((child) => child !== null));
  return element;
}

const address = (name, more = {}) => `${name}?${new URLSearchParams({ p: LINK, ...more })}`;

async function request(name, options = {}) {
  const response = await fetch(address(name), { signal: AbortSignal.timeout(PATIENCE), ...options });
  if (!response.ok) throw new Error(await response.text(), { cause: response.status });
  return response.json();
}

const send = (name, body = {}) => request(name, { method: "POST", body: JSON.stringify(body) });

/** What went wrong, until it is mended; `again` sends the same once more. */
function complain(kind, error, again = null) {
  const why = error.cause === undefined ? "The computer of the study does not answer." : `The computer of the study says: ${error.message}.`;
  const words = kind === "sent" ? `This was not sent. ${why} What you typed is still here.` : `${why} The page tries again automatically.`;
  const retry = again === null ? null : button("Send again", again, { id: "again" });
  notice.replaceChildren(words, ...(retry === null ? [] : [retry]));
  notice.dataset.kind = kind;
  notice.hidden = false;
}

function mended(kind) {
  if (notice.dataset.kind === kind) notice.hidden = true;
}

/** Sends what a button stands for, and shows what comes of it. */
async function press(name) {
  try {
    const told = await send(name);
    mended("sent");
    show(told);
  } catch (error) {
    complain("sent", error, () => press(name));
  }
}

function button(words, does, attributes = {}) {
  const element = make("button", { type: "button", ...attributes }, words);
  element.addEventListener("click", does);
  return element;
}

function consent({ words }) {
  const agree = button("I agree", () => press("agree"), { id: "agree" });
  content.replaceChildren(make("h1", {}, "Before you begin"), make("div", { class: "consent" }, make("pre", {}, words)), agree);
}

function waiting({ played }) {
  const words = played > 0 ? "Thank you: that episode is over. If there is another, it comes here." : "Please wait: the next episode comes here.";
  content.replaceChildren(make("h1", {}, "Nothing to do now"), make("p", { id: "waiting" }, words), make("p", { class: "quiet" }, "You may close this page and come back with the same link."));
}

function ready() {
  const words = make("p", {}, "The practice is over; the next steps count. Begin when you are ready: no time is counted before.");
  content.replaceChildren(make("h1", {}, "The practice is over"), words, button("Begin", () => press("begin"), { id: "begin" }));
}

/** The end, as the server said it, or as it seems where the server has gone. */
function over({ is_complete: isComplete }) {
  const words = {
    true: "You may close this page.",
    false: "It was stopped before its end; what you did is kept. Should it go on, you are given a new link.",
  }[isComplete] ?? "The computer of the study has gone. Should there be another episode, it comes here by itself.";
  content.replaceChildren(make("h1", {}, "The study is over"), make("p", { id: "over" }, `Thank you for taking part! ${words}`));
  mended("asked");
}

function pausing() {
  content.replaceChildren(make("h1", {}, "A break"), make("p", {}, "Take your time: nothing is counted now."), button("Go on", () => press("resume"), { id: "resume" }));
}

function field(key, colors, given) {
  const title = TITLES[key] ?? key;
  if (key === "selected_cube" || key === "mark") {
    const options = ["none", ...colors].map((color) => make("option", { value: color }, color));
    const list = make("select", { name: key }, ...options);
    list.value = given[key] ?? "none";
    return make("label", {}, title, list);
  }
  const area = key === "identification" ? make("input", { name: key, type: "text", autocomplete: "off" }) : make("textarea", { name: key });
  area.value = given[key] ?? "";
  return make("label", {}, title, area);
}

function play(told) {
  const { phase, number, episode, t, system, user, keys, actions: letters, colors } = told;
  // A claim stays from step to step, and belongs to the episode in which it was typed.
  if (round !== `${phase} ${episode}`) [round, kept] = [`${phase} ${episode}`, {}];
  const given = typed.number === number ? typed : kept;
  const form = make("form", { autocomplete: "off" });
  let sent = false;
  const reply = async (action) => {
    if (sent) return;
    sent = true;
    const values = Object.fromEntries(keys.map((key) => [key, key === "action" ? action : (form.elements[key]?.value ?? "")]));
    if (action !== "done" && "selected_cube" in values) values.selected_cube = "none";
    const lock = (is) => form.querySelectorAll("button").forEach((one) => (one.disabled = is));
    lock(true);
    try {
      await send("reply", { number, reply: values });
    } catch (error) {
      sent = false;
      lock(false);
      complain("sent", error, () => reply(action));
      return;
    }
    kept = { identification: values.identification ?? "" };
    mended("sent");
    turn();
  };
  const actions = letters.map((action) => button(action === "done" ? WORDS[action] : `${WORDS[action]} (${action})`, () => reply(action), { "data-action": action }));
  const fields = keys.filter((key) => key !== "action").map((key) => field(key, colors, given));
  const order = ["identification", "selected_cube", "mark"];
  fields.sort((a, b) => order.indexOf(b.lastChild.name) - order.indexOf(a.lastChild.name));
  form.append(make("div", { class: "actions", role: "group", "aria-label": "What you do" }, ...actions), ...fields, button("Take a break", () => press("pause"), { id: "pause" }));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.reply = reply;
  form.letters = letters;
  const image = make("img", { src: address("frame", { n: number }), alt: "What you see", width: 640, height: 480 });
  image.addEventListener("error", () => setTimeout(() => (image.src = address("frame", { n: number, again: Date.now() })), PAUSE));
  const words = make("details", {}, make("summary", {}, "The task, as it was said at the beginning"), make("pre", {}, system));
  words.open = t === 1;
  const head = make("h1", {}, phase === "practice" ? make("span", { class: "practice" }, "Practice: this one does not count") : "", phase === "practice" ? ` step ${t}` : `Step ${t}`);
  content.replaceChildren(head, make("div", { class: "play" }, make("div", {}, image, words), make("div", {}, make("pre", { id: "user" }, user), form)));
  content.dataset.phase = phase;
  content.dataset.number = number;
}

function show(told) {
  const same = ["phase", "number", "played"].every((key) => shown?.[key] === told[key]);
  const form = content.querySelector("form");
  if (form !== null) typed = { number: shown.number, ...Object.fromEntries(new FormData(form)) };
  shown = told;
  if (same) return;
  mended("sent");
  content.dataset.phase = told.phase;
  const pages = { consent, ready, waiting, over, break: pausing };
  (pages[told.phase] ?? play)(told);
}

async function turn() {
  clearTimeout(timer);
  try {
    show(await request("state"));
    unanswered = 0;
    mended("asked");
  } catch (error) {
    unanswered += 1;
    const isGone = error.cause === undefined && unanswered >= GONE && (shown?.phase === "over" || shown?.played > 0);
    if (isGone) show({ phase: "over" });
    else if (notice.hidden || notice.dataset.kind === "asked") complain("asked", error);
  }
  if (shown?.phase === "over" && shown.is_complete !== undefined) return;
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

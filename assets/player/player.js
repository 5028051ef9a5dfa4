// A person as the agent: the frame, the prompt and the reply keys of a model, and nothing else.

const LINK = new URLSearchParams(location.search).get("p") ?? "";
const WORDS = {
  w: "Forward", s: "Backward", a: "Turn left", d: "Turn right", done: "Done",
  1: "Hand up", 2: "Hand down", 3: "Hand left", 4: "Hand right", 5: "Hand forward", 6: "Hand backward",
};
// Arrow keys walk and turn, or move a hand in the picture; the letters and digits of the actions work too.
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

// Requests time out after this time, ms.
const PATIENCE = 20_000;
// The timeout of the status query, which repeats.
const GLANCE = 6_000;
// The number of consecutive unanswered queries after which the server counts as gone.
const GONE = 3;
// The storage keys for a question's draft and for whether letters act as keys.
const DRAFT = "mirrorstats-draft";
const LETTERS = "mirrorstats-letters";

const content = document.getElementById("content");
const notice = document.getElementById("notice");
const status = document.getElementById("status");
let shown = null;
let current = null;
let round = null;
let kept = "";
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

const say = (words) => (status.textContent = words);

/** Shows an error until the next success; `again` retries the request. */
function complain(kind, error, again = null) {
  const why = error.cause === undefined ? "The computer of the study does not answer." : `The computer of the study says: ${error.message}.`;
  const words = kind === "sent" ? `This was not sent. ${why} What you typed is still here.` : `${why} The page tries again by itself; what you typed is still here.`;
  const retry = again === null ? null : button("Send again", again, { id: "again" });
  notice.replaceChildren(words, ...(retry === null ? [] : [retry]));
  notice.dataset.kind = kind;
  notice.hidden = false;
}

function mended(kind) {
  if (notice.hidden || notice.dataset.kind !== kind) return;
  notice.hidden = true;
  if (kind === "asked") say("The computer of the study answers again.");
}

/** Sends the request of a button and shows the result. */
async function press(name, body = {}) {
  try {
    const told = await send(name, body);
    mended("sent");
    show(told);
  } catch (error) {
    complain("sent", error, () => press(name, body));
  }
}

function button(words, does, attributes = {}) {
  const element = make("button", { type: "button", ...attributes }, words);
  element.addEventListener("click", does);
  return element;
}

/** Asks for confirmation of an irreversible action; the first choice cancels. */
function sure(id, title, words, stay, choices) {
  const dialog = make("dialog", { id, "aria-labelledby": `${id}-title` }, make("h2", { id: `${id}-title` }, title), ...words.map((line) => make("p", {}, line)));
  const close = (does) => () => {
    dialog.close();
    does();
  };
  const buttons = [[stay, () => {}, `${id}-stay`], ...choices].map(([name, does, own]) => button(name, close(does), { id: own }));
  dialog.append(make("div", { class: "actions" }, ...buttons));
  dialog.addEventListener("close", () => dialog.remove());
  content.append(dialog);
  dialog.showModal();
}

function withdraw() {
  sure("leave", "Leave the study?", ["You may leave at any time, and need not say why. You cannot come back."], "Stay", [
    ["Leave; what I did may be kept", () => press("withdraw", { delete: false }), "leave-keep"],
    ["Leave, and delete what I did", () => press("withdraw", { delete: true }), "leave-delete"],
  ]);
}

/** Replaces the page; the keyboard focus stays where it was or moves to the heading. */
function put(title, told, children, mayLeave = true) {
  const active = content.contains(document.activeElement) ? document.activeElement : null;
  const name = active?.dataset.action ? `[data-action="${active.dataset.action}"]` : active?.name ? `[name="${active.name}"]` : null;
  const ask = told.contact ? `Questions? ${told.contact}.` : "Questions? Ask whoever gave you the link.";
  const foot = make("footer", {}, make("p", { class: "quiet" }, `${ask} Your code is ${told.code}.`));
  if (mayLeave) foot.prepend(button("Leave the study", withdraw, { id: "withdraw" }));
  content.replaceChildren(...children, foot);
  document.title = `${title} – Mirror room`;
  const heading = content.querySelector("h1");
  heading.tabIndex = -1;
  const again = name === null ? null : content.querySelector(`${name}:not(:disabled)`);
  (again ?? heading).focus({ preventScroll: again !== null });
}

const page = (title, told, children, mayLeave = true) => put(title, told, [make("h1", {}, title), ...children], mayLeave);

const counted = (count) => (count === 1 ? "1 episode" : `${count} episodes`);

function consent(told) {
  const decline = () => sure("decline", "Decline?", ["Nothing of you is recorded then. You cannot come back."], "Read again", [["I decline", () => press("decline"), "decline-sure"]]);
  const agree = button("I agree", () => press("agree"), { id: "agree" });
  const words = make("div", { class: "consent" }, make("pre", {}, told.words));
  page("Before you begin", told, [words, make("div", { class: "actions" }, agree, button("I decline", decline, { id: "decline" }))], false);
}

function waiting(told) {
  page("Please wait", told, [make("p", { id: "waiting" }, "The next episode comes here."), make("p", { class: "quiet" }, "You may close this page and come back with the same link.")]);
}

function ready(told) {
  const { is_first: isFirst, episode, of } = told;
  const over = isFirst ? "The practice is over; the next steps count." : `${counted(episode - 1)} done, thank you. Nothing of it stays on this page.`;
  const words = make("p", {}, `${over} Next is episode ${episode} of ${of}. Begin when you are ready: no time is counted before.`);
  page(isFirst ? "The practice is over" : `Episode ${episode} of ${of}`, told, [words, button("Begin", () => press("begin"), { id: "begin" })]);
}

const farewell = (words) => make("p", { id: "over" }, `Thank you for taking part! ${words}`);

/** The page for a person without further episodes, while others may still play. */
function finished(told) {
  const words = told.played > 0 ? `You have played ${told.played === 1 ? "your only episode" : `all ${counted(told.played)}`}.` : "There is no episode for you to play.";
  page("You are done", told, [farewell(`${words} You may close this page.`)], told.played > 0);
}

/** The last page, as reported by the server or, if the server has gone, as inferred. */
function over(told) {
  const words = {
    true: "You may close this page.",
    false: "It was stopped before its end; what you did is kept. If it goes on, it goes on here, with the same link.",
  }[told.is_complete] ?? "The computer of the study has gone. Should there be another episode, it comes here by itself.";
  page("The study is over", told, [farewell(words)], false);
  mended("asked");
}

function left(told) {
  const words = {
    declined: "You have declined. Nothing of you is recorded.",
    stopped: "You have left the study. What you did until then is kept.",
    deleted: told.is_deleted ? "You have left the study. What you did is deleted." : "You have left the study. What you did is being deleted.",
  }[told.left];
  sessionStorage.removeItem(DRAFT);
  page("Thank you", told, [make("p", { id: "left" }, `${words} You may close this page.`)], false);
}

function pausing(told) {
  page("A break", told, [make("p", {}, "Take your time: the clock stands still."), button("Go on", () => press("resume"), { id: "resume" })]);
}

/** The input field of an answer that the experiment declares. */
function own(answer, colors, given) {
  const { key, type, options = [], unknown = false, words } = answer;
  const texts = { one_of: options, yes_no: ["yes", "no"], color: colors }[type];
  if (texts === undefined) {
    const input = make("input", { name: key, type: "text", inputmode: "decimal", autocomplete: "off" });
    input.value = given[key] ?? "";
    return make("label", {}, unknown ? `${words} (a number, or unknown)` : `${words} (a number)`, input);
  }
  const choices = ["", ...texts, ...(unknown ? ["unknown"] : [])].map((text) => make("option", { value: text }, text));
  const list = make("select", { name: key }, ...choices);
  list.value = given[key] ?? "";
  return make("label", {}, words, list);
}

function field(key, colors, given, answers) {
  const declared = answers.find((answer) => answer.key === key);
  if (declared !== undefined) return own(declared, colors, given);
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

/** The draft of this question from before a reload; drafts of other questions are ignored. */
function draft(place) {
  const found = JSON.parse(sessionStorage.getItem(DRAFT) ?? "null");
  if (found?.place === place) return found.values;
  sessionStorage.removeItem(DRAFT);
  return null;
}

const lettersAreKeys = () => sessionStorage.getItem(LETTERS) !== "off";

function keys(letters) {
  const box = make("input", { type: "checkbox", id: "letters" });
  box.checked = lettersAreKeys();
  box.addEventListener("change", () => sessionStorage.setItem(LETTERS, box.checked ? "on" : "off"));
  const named = letters.filter((letter) => letter !== "done").join(" ");
  return make("div", { class: "quiet" }, "The arrow keys move. ", make("label", { class: "inline" }, box, `So do the keys ${named}`));
}

function play(told) {
  const { phase, number, episode, of, t, system, user, keys: names, actions: letters, colors, prefills, answers } = told;
  const isPractice = phase === "practice";
  const place = `${LINK} ${phase} ${episode} ${t}`;
  // An identification stays from step to step if the study wants it, but never from episode to episode.
  if (round !== `${phase} ${episode}`) [round, kept] = [`${phase} ${episode}`, ""];
  const given = draft(place) ?? (prefills ? { identification: kept } : {});
  const form = make("form", { autocomplete: "off", "aria-label": "Your answer" });
  let sent = false;
  const reply = async (action) => {
    if (sent) return;
    sent = true;
    const values = Object.fromEntries(names.map((key) => [key, key === "action" ? action : (form.elements[key]?.value ?? "")]));
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
    sessionStorage.removeItem(DRAFT);
    kept = values.identification ?? "";
    form.isSent = true;
    mended("sent");
    say(`${WORDS[action]}.`);
    turn();
  };
  const done = () => {
    const cube = form.elements.selected_cube?.value;
    const words = ["This episode is over then; you cannot come back to it."];
    if (cube !== undefined) words.push(cube === "none" ? "You have chosen no cube." : `You have chosen the ${cube} cube.`);
    sure("sure", "Are you done?", words, "Go on playing", [["Yes, I am done", () => reply("done"), "sure-done"]]);
  };
  const actions = letters.map((action) => button(action === "done" ? WORDS[action] : `${WORDS[action]} (${action})`, () => (action === "done" ? done() : reply(action)), { "data-action": action }));
  const fields = names.filter((key) => key !== "action").map((key) => field(key, colors, given, answers));
  const order = ["identification", "selected_cube", "mark", ...answers.map((answer) => answer.key)];
  fields.sort((a, b) => order.indexOf(b.lastChild.name) - order.indexOf(a.lastChild.name));
  form.append(make("div", { class: "actions", role: "group", "aria-label": "What you do" }, ...actions), keys(letters), ...fields, button("Take a break", () => press("pause"), { id: "pause" }));
  const save = () => {
    if (!form.isSent) sessionStorage.setItem(DRAFT, JSON.stringify({ place, values: Object.fromEntries(new FormData(form)) }));
  };
  form.addEventListener("input", save);
  form.addEventListener("submit", (event) => event.preventDefault());
  if (prefills) save();
  current = { form, reply, letters };
  const image = make("img", { src: address("frame", { n: number }), alt: "What you see at this step", width: 640, height: 480 });
  image.addEventListener("error", () => setTimeout(() => (image.src = address("frame", { n: number, again: Date.now() })), PAUSE));
  const beginning = make("details", {}, make("summary", {}, "At the beginning"), make("pre", { tabindex: "0", "aria-label": "Words at the beginning" }, system));
  beginning.open = t === 1;
  const model = make(
    "section", { class: "model", "aria-labelledby": "model" },
    make("h2", { id: "model" }, "Your task, in the words that models get"),
    make("p", { class: "quiet" }, "They are the same for people and models. Where they ask for a JSON object, use the buttons and fields."),
    beginning, make("h3", {}, "At this step"), make("pre", { id: "user" }, user),
  );
  const banner = make("p", { class: "place" }, isPractice ? make("span", { class: "practice" }, "Practice: nothing counts until a page says that it does") : `Episode ${episode} of ${of}`);
  const mine = make("section", { class: "mine", "aria-labelledby": "mine" }, make("h2", { id: "mine" }, "Your answer"), form);
  const title = isPractice ? `Practice, step ${t}` : `Step ${t}`;
  put(title, told, [make("h1", {}, title), banner, make("div", { class: "play" }, image, mine, model)]);
  content.dataset.number = number;
  say(`${status.textContent} ${title}.`.trim());
}

function show(told) {
  const same = ["phase", "number", "played", "is_deleted"].every((key) => shown?.[key] === told[key]);
  shown = told;
  if (same) return;
  mended("sent");
  content.dataset.phase = told.phase;
  const pages = { consent, ready, waiting, finished, over, left, break: pausing };
  (pages[told.phase] ?? play)(told);
}

async function turn() {
  clearTimeout(timer);
  try {
    show(await request("state", { signal: AbortSignal.timeout(GLANCE) }));
    unanswered = 0;
    mended("asked");
  } catch (error) {
    unanswered += 1;
    const isIdle = shown?.phase === "finished" || (shown?.phase === "waiting" && shown.played > 0);
    const isOver = ["finished", "over", "left"].includes(shown?.phase);
    if (error.cause === undefined && unanswered >= GONE && isIdle) show({ ...shown, phase: "over", is_complete: undefined });
    else if (!isOver && (notice.hidden || notice.dataset.kind === "asked")) complain("asked", error);
  }
  timer = setTimeout(turn, shown?.phase === "waiting" ? PAUSE / 4 : PAUSE);
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || event.target.matches("input, select, textarea")) return;
  if (current === null || !current.form.isConnected || content.querySelector("dialog") !== null) return;
  const action = current.letters.find((letter) => letter !== "done" && ((letter === event.key && lettersAreKeys()) || ARROWS[event.key]?.includes(letter)));
  if (action === undefined) return;
  event.preventDefault();
  current.reply(action);
});

turn();

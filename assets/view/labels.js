// Labels and notes: coders' marks on an episode and its steps, and the form to add one.
import { counted, make, notice, one } from "./dom.js";
import { isCopy, send } from "./data.js";

const NOTE = 2000;

/** One mark as a line: label, step, note and coder. */
function markLine(mark, own, jump, remove) {
  const to = mark.step === null ? make("span", { class: "quiet" }, "episode") : make("button", { type: "button", class: "jump", "data-t": mark.step }, `t = ${mark.step}`);
  if (mark.step !== null) to.addEventListener("click", () => jump(mark.step));
  const name = mark.label ?? "no label";
  const away = make("button", { type: "button", class: "away", "aria-label": `Remove ${name}, ${mark.step === null ? "episode" : `t = ${mark.step}`}` }, "×");
  away.addEventListener("click", () => remove(mark));
  return make("li", {}, make("b", {}, name), " ", to, " ", mark.note === null ? null : make("span", { class: "note" }, mark.note), " ", make("span", { class: "quiet" }, mark.coder), mark.coder === own ? away : null);
}

/** The labels of an episode; `open()` shows the form. `now()` is the current step, `jump` goes to a step. */
export function labelsOf(episode, study, now, jump) {
  const coder = isCopy ? null : (study.coder ?? null);
  const list = make("ul", { class: "marks" });
  const problem = make("div", {});
  const button = make("button", { type: "button", class: "put" }, "Label …");
  const element = make("section", { class: "labels", "aria-label": "Labels" }, make("b", { class: "quiet" }, "Labels"), list, coder === null ? null : button, problem);
  const draw = () => {
    list.replaceChildren(...episode.labels.map((mark) => markLine(mark, coder, jump, (gone) => put({ ...gone, removed: true }).catch(tell))));
    list.hidden = episode.labels.length === 0;
    element.hidden = coder === null && episode.labels.length === 0;
  };
  const tell = (error) => problem.replaceChildren(notice(error.message));
  const put = async ({ step, label, note, removed = false }) => {
    episode.labels = await send({ id: episode.id, step, label, note: removed ? null : note, removed });
    problem.replaceChildren();
    draw();
    button.focus();
  };
  const open = () => coder !== null && box(episode, study, now(), put);
  button.addEventListener("click", open);
  draw();
  return { element, open };
}

/** The labels used so far, in this and other episodes. */
function known(episode, study) {
  const columns = study.choices.filter(({ column }) => column.startsWith("label_")).map(({ column }) => column.slice("label_".length));
  return [...new Set([...columns, ...episode.labels.map(({ label }) => label).filter((label) => label !== null)])].sort();
}

function box(episode, study, t, put) {
  const words = known(episode, study);
  const label = make("input", { type: "text", name: "label", list: "label-words", maxlength: 40, pattern: "[a-z][a-z0-9_]*", title: "lowercase letters, digits and _, a letter first", autocomplete: "off", spellcheck: "false", placeholder: "such as confabulates" });
  const note = make("textarea", { name: "note", rows: 3, maxlength: NOTE });
  const choice = (value, text) => make("label", {}, make("input", { type: "radio", name: "of", value, checked: value === "episode" }), ` ${text}`);
  const problem = make("div", {});
  const cancel = make("button", { type: "button" }, "Cancel");
  const form = make("form", { class: "inside" },
    make("h2", { id: "label-title" }, `Label as ${study.coder}`),
    make("label", {}, "Label", label), make("datalist", { id: "label-words" }, words.map((value) => make("option", { value }))),
    make("p", { class: "quiet" }, "Without a word the episode counts as coded: you looked, and put no label."),
    make("fieldset", {}, make("legend", {}, "On"), choice("episode", `the episode, ${counted(episode.length, "step")}`), choice("step", `the step t = ${t}`)),
    make("label", {}, "Note", note), problem,
    make("p", { class: "buttons" }, make("button", { type: "submit" }, "Save"), cancel));
  const dialog = make("dialog", { id: "label", "aria-labelledby": "label-title" }, form);
  cancel.addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => dialog.remove());
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      await put({ step: form.elements.of.value === "step" ? t : null, label: label.value.trim() || null, note: note.value.trim() || null });
      dialog.close();
    } catch (error) {
      problem.replaceChildren(notice(error.message));
    }
  });
  one("#label")?.remove();
  document.body.append(dialog);
  dialog.showModal();
  label.focus();
}

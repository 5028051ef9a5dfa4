//! The prompts are the paper's, word for word; `tests/agents/prompts` holds its verbatim blocks.

use std::sync::Arc;

use mirrorstats::agent::prompt::{self, Prompt};
use mirrorstats::agent::{Observation, Task};
use mirrorstats::base::frame::Frame;
use mirrorstats::experiment::Experiment;
use mirrorstats::trace::episode::Action;

fn task(experiment: Experiment, stated_color: Option<&str>) -> Task {
    Task { experiment, stated_color: stated_color.map(str::to_owned), step_budget: 100, seed: 1 }
}

fn first_step() -> Observation {
    Observation {
        t: 1,
        remaining: 100,
        x: -0.004,
        y: 1.25,
        yaw: 330.0,
        bumped: false,
        history: None,
        frame: Arc::new(Frame::new(0, 0, Vec::new())),
        fov_y: 110.0,
    }
}

/// The user prompt of the paper with its three placeholders filled in.
fn filled(verbatim: &str, history: &str, position: &str, warning: Option<&str>) -> String {
    let text = verbatim.replace("<history_text>", history).replace("<position_text>", position);
    let warning = warning.map_or(String::new(), |warning| format!("{warning}\n"));
    text.replace("<warning_if_bumped_wall>\n", &warning).trim_end().to_owned()
}

const FIRST: &str = "Step history: none, this is the first step.";
const POSITION: &str = "Position: x = 0.00 m, y = 1.25 m; orientation: 330 degrees, counter-clockwise from the +x axis.\n\
                        Remaining steps: 100 of 100.";
const WARNING: &str = "Warning: the previous movement hit a wall or another object, and the position did not change.";

#[test]
fn the_cube_selection_prompt_is_the_papers() {
    let prompt = Prompt::of(Experiment::E1).unwrap();
    let rendered = prompt.render(&task(Experiment::E1, None), &first_step()).unwrap();
    assert_eq!(rendered.system, include_str!("prompts/cube-selection.system.txt").trim_end());
    assert_eq!(rendered.user, filled(include_str!("prompts/cube-selection.user.txt"), FIRST, POSITION, None));

    let bumped = Observation { bumped: true, ..first_step() };
    let rendered = prompt.render(&task(Experiment::E1, None), &bumped).unwrap();
    assert_eq!(rendered.user, filled(include_str!("prompts/cube-selection.user.txt"), FIRST, POSITION, Some(WARNING)));
}

#[test]
fn a_false_colour_replaces_the_first_line_alone() {
    let prompt = Prompt::of(Experiment::E1).unwrap();
    let rendered = prompt.render(&task(Experiment::E1, Some("green")), &first_step()).unwrap();
    let first = include_str!("prompts/e3-first-line.txt").trim_end().replace("<wrong_color>", "green");
    let rest = include_str!("prompts/cube-selection.system.txt").split_once('\n').unwrap().1;
    assert_eq!(rendered.system, format!("{first}\n{}", rest.trim_end()));
}

#[test]
fn the_exploration_prompt_is_the_papers() {
    let prompt = Prompt::of(Experiment::E5).unwrap();
    let rendered = prompt.render(&task(Experiment::E5, None), &first_step()).unwrap();
    assert_eq!(rendered.system, include_str!("prompts/exploration.system.txt").trim_end());
    assert_eq!(rendered.user, filled(include_str!("prompts/exploration.user.txt"), FIRST, POSITION, None));
}

#[test]
fn history_is_one_step_on_one_line_whatever_was_thought() {
    let prompt = Prompt::of(Experiment::E5).unwrap();
    let thought = Some("I turn.\n\nTask: <b>{{ 1 + 1 }}</b>".to_owned());
    let seen = |history| {
        let observation = Observation { t: 2, remaining: 99, history: Some(history), ..first_step() };
        let user = prompt.render(&task(Experiment::E5, None), &observation).unwrap().user;
        user.lines().nth(1).unwrap().to_owned()
    };
    assert_eq!(
        seen((Some(Action::TurnLeft), thought)),
        "Step history: the previous action was a; the thought with it was: I turn. Task: <b>{{ 1 + 1 }}</b>"
    );
    assert_eq!(
        seen((Some(Action::MoveForward), None)),
        "Step history: the previous action was w; the thought with it was: none"
    );
    assert_eq!(seen((None, None)), "Step history: the previous reply could not be used, so nothing was done.");
    assert_eq!(
        seen((None, Some("I look\nfor it.".to_owned()))),
        "Step history: the previous reply could not be used, so nothing was done; the thought before it was: I look for it."
    );
}

#[test]
fn families_differ_in_their_hash_and_actions_in_their_letters() {
    let hashes = [Experiment::E1, Experiment::E5].map(|experiment| Prompt::of(experiment).unwrap().hash().to_owned());
    assert_ne!(hashes[0], hashes[1]);
    for action in Action::ALL {
        assert_eq!(prompt::action(prompt::letter(action)), Some(action));
    }
    assert_eq!(prompt::action("W"), None);
}

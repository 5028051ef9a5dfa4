//! The words around a frame, from the templates of an experiment's prompt.
//!
//! Rule: equal tasks and observations give equal words.

use std::io;

use minijinja::{Environment, Error, ErrorKind, UndefinedBehavior, Value, context};

use super::{Observation, Past, Task};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::number::Decimal;
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::{Actions, Answer};
use mirrorstats_trace::episodes::episode::Action;

/// Loops over steps within loops grow faster than an episode.
const INSTRUCTIONS: Limit = Limit::new("instructions of a prompt's template", 500_000);
/// About a million tokens: more than models take.
const LONGEST: Limit = Limit::new("bytes of a prompt's text", 4 << 20);

#[derive(Debug)]
pub struct Prompt {
    experiment: Experiment,
}

/// The messages to a model besides the frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rendered {
    pub system: String,
    /// The user prompt: task, history, position, warning.
    pub user: String,
}

impl Prompt {
    pub fn for_experiment(experiment: &Experiment) -> Result<Self, Error> {
        let prompt = Self { experiment: experiment.clone() };
        prompt.environment()?;
        Ok(prompt)
    }

    /// The parsed templates; parsing them for each step is cheap beside waiting for an answer.
    fn environment(&self) -> Result<Environment<'_>, Error> {
        let mut environment = Environment::new();
        environment.set_undefined_behavior(UndefinedBehavior::Strict);
        environment.set_fuel(Some(INSTRUCTIONS.most()));
        for (name, source) in &self.experiment.templates().all {
            environment.add_template(name, source)?;
        }
        Ok(environment)
    }

    pub fn render(&self, task: &Task, observation: &Observation) -> Result<Rendered, Error> {
        let environment = self.environment()?;
        let fill = |name: &str, values: Value| -> Result<String, Error> {
            let template = environment.get_template(name)?;
            let mut text = Bounded::default();
            let rendered = template.render_captured_to(values, &mut text);
            rendered.map_err(|error| at_limit(error, name, observation.t))?;
            Ok(String::from_utf8_lossy(&text.0).trim_end().to_owned())
        };
        let values = context! {
            stated_color => task.stated_color.as_deref(),
            reply_keys => task.experiment.keys().iter().map(|key| format!("\"{key}\"")).collect::<Vec<_>>().join(", "),
            answers => task.experiment.answers.iter().map(answer).collect::<Vec<_>>(),
        };
        let system = fill("system", values)?;
        let history = observation.history.as_ref();
        let values = context! {
            first => history.is_none(),
            action => history.and_then(|(action, _)| action.map(letter)),
            thought => history.and_then(|(_, thought)| thought.as_deref().map(one_line)),
            steps => observation.past.iter().map(step).collect::<Vec<_>>(),
        };
        let history_text = fill("history", values)?;
        let values = context! {
            x => rounded(observation.x, 2),
            y => rounded(observation.y, 2),
            yaw => rounded(observation.yaw, 0),
            remaining => observation.remaining,
            budget => task.step_budget,
        };
        let position_text = fill("position", values)?;
        let warning = fill("warning", context! {})?;
        let values = context! {
            history_text,
            position_text,
            bumped => observation.bumped,
            warning_if_bumped_wall => warning,
            remaining => observation.remaining,
            budget => task.step_budget,
        };
        let user = fill("user", values)?;
        Ok(Rendered { system, user })
    }
}

/// A text up to the limit of its length.
#[derive(Default)]
struct Bounded(Vec<u8>);

impl io::Write for Bounded {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        LONGEST.check((self.0.len() + bytes.len()) as u64)?;
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The error of a template, with the step and the limit if it exceeds one.
fn at_limit(error: Error, template: &str, t: i32) -> Error {
    let limit = match error.kind() {
        ErrorKind::OutOfFuel => INSTRUCTIONS,
        ErrorKind::WriteFailure => LONGEST,
        _ => return error,
    };
    let exceeded = limit.check(u64::MAX).map_or_else(|exceeded| exceeded.to_string(), |()| String::new());
    Error::new(ErrorKind::InvalidOperation, format!("step {t}: the template {template}.txt: {exceeded}"))
}

/// The hashes of the paper's two prompts, for registered plans.
pub fn hashes() -> serde_json::Value {
    serde_json::json!({
        "cube_selection": Experiment::E1.prompt_hash,
        "exploration": Experiment::E5.prompt_hash,
    })
}

pub const fn letter(action: Action) -> &'static str {
    spoken(action)[0]
}

/// The words of the built-in prompts for an action.
pub const fn words(action: Action) -> &'static str {
    spoken(action)[1]
}

const fn spoken(action: Action) -> [&'static str; 2] {
    match action {
        Action::MoveForward => ["w", "move forward"],
        Action::MoveBackward => ["s", "move backward"],
        Action::TurnLeft => ["a", "turn left by 30 degrees"],
        Action::TurnRight => ["d", "turn right by 30 degrees"],
        Action::Done => ["done", "task complete"],
        Action::HandUp => ["1", "up"],
        Action::HandDown => ["2", "down"],
        Action::HandLeft => ["3", "left, as the image shows it"],
        Action::HandRight => ["4", "right, as the image shows it"],
        Action::HandForward => ["5", "forward, away from the camera"],
        Action::HandBackward => ["6", "backward, towards the camera"],
    }
}

pub fn action(letter_of_action: &str) -> Option<Action> {
    Action::ALL.into_iter().find(|action| letter(*action) == letter_of_action)
}

pub const fn actions(of: Actions) -> &'static [Action] {
    match of {
        Actions::Walk => &Action::WALK,
        Actions::Hand => &Action::HAND,
    }
}

fn answer(answer: &Answer) -> Value {
    context! { key => answer.key.as_str(), words => one_line(&answer.words), expected => answer.expected() }
}

fn step(past: &Past) -> Value {
    context! {
        action => past.action.map(letter),
        name => past.action.map(Action::name),
        bumped => past.bumped,
        thought => past.thought.as_deref().map(one_line),
    }
}

/// Keeps a thought on one line, so that it cannot pass for another part of the prompt.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn rounded(value: f32, places: u32) -> String {
    Decimal::of_float(f64::from(value), places).map_or_else(|| "unknown".to_owned(), |number| number.to_string())
}

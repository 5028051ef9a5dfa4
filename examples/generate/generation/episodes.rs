//! The generated study: models by experiments by seeds by runs, and the steps of each episode.

use clap::Args;
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};

use super::draw::Draw;
use super::extras;

const MODELS: [&str; 8] = [
    "Claude Sonnet 4.6",
    "Gemini 3.1 Pro",
    "GPT-5.4",
    "Grok 4.2",
    "InternVL3.5-38B",
    "Llama-4-Maverick",
    "Qwen3.5-VL-32B",
    "Qwen3.5-VL-8B",
];
const EXPERIMENTS: [&str; 5] = ["E1", "E2", "E3", "E4", "E5"];
pub(super) const COLORS: [&str; 10] =
    ["red", "blue", "green", "yellow", "orange", "purple", "pink", "cyan", "brown", "white"];
const SEEDS: u64 = 3;
/// The number of runs that are recorded in succession.
const RUNS: u64 = 7;
/// The longest episode, in steps.
const LIMIT: u64 = 100;

/// The columns of a study and their writer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// The required columns alone.
    Required,
    /// Optional columns too.
    Optional,
    /// Columns as other programs write them, drawn for each step.
    Wild(Wild),
}

/// The shape of wild data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Args)]
pub struct Wild {
    /// The longest episode of --wild, in steps.
    #[arg(long, default_value_t = LIMIT)]
    pub longest: u64,
    /// The models of --wild.
    #[arg(long, default_value_t = 4)]
    pub models: u64,
    /// Columns of --wild that no definition reads.
    #[arg(long, default_value_t = 3)]
    pub columns: usize,
}

impl Values {
    fn longest(self) -> u64 {
        if let Self::Wild(wild) = self { wild.longest } else { LIMIT }
    }
}

/// The study to generate.
pub struct Study {
    /// Another seed gives other episodes.
    pub seed: u64,
    /// The steps of all episodes together.
    pub steps: u64,
    /// The columns and their writer.
    pub values: Values,
    episodes: u64,
    /// The number of steps of the last episode, which is cut so that the total is `steps`.
    last: u64,
}

impl Study {
    /// A study with as many episodes as `steps` steps need, at least 1.
    pub fn new(seed: u64, steps: u64, values: Values) -> Self {
        let (mut episodes, mut last, mut left) = (0, 0, steps);
        while left > 0 {
            last = drawn_length(values.longest(), &mut Draw::of(seed, episodes)).min(left);
            left -= last;
            episodes += 1;
        }
        Self { seed, steps, values, episodes, last }
    }

    /// The number of episodes.
    pub fn episodes(&self) -> u64 {
        self.episodes
    }

    /// The number of steps of an episode.
    pub fn length(&self, number: u64) -> u64 {
        if number + 1 == self.episodes {
            self.last
        } else {
            drawn_length(self.values.longest(), &mut Draw::of(self.seed, number))
        }
    }

    /// The episode with this number.
    pub fn episode(&self, number: u64) -> Episode {
        let mut draw = Draw::of(self.seed, number);
        let drawn_length = drawn_length(LIMIT, &mut draw);
        let (model, experiment, seed, run) = cell(number);
        let body_color = draw.one(&COLORS[..3]);
        let mut scene = Scene::new(body_color, &mut draw);
        let mut steps: Vec<_> =
            (1..=drawn_length).map(|t| scene.step(t == drawn_length && t < LIMIT, &mut draw)).collect();
        steps.truncate(usize::try_from(self.length(number)).unwrap_or(usize::MAX));
        let mut episode = Episode {
            episode_id: format!("{experiment}-{}-s{seed}-r{run:03}-{number:07}", slug(model)),
            model: model.to_owned(),
            experiment: experiment.to_owned(),
            seed,
            run,
            body_color: body_color.to_owned(),
            steps,
            ..Episode::default()
        };
        if self.values == Values::Optional {
            // Separate draws, so that the required columns are the same with and without the optional ones.
            extras::fill(&mut episode, number, &mut Draw::of(!self.seed, number));
        }
        episode
    }
}

/// The number of steps before any cut.
fn drawn_length(longest: u64, draw: &mut Draw) -> u64 {
    if draw.percent(41) { longest } else { 1 + draw.below(longest) }
}

/// Model, experiment, seed and run of an episode, in the order in which a study is recorded.
fn cell(number: u64) -> (&'static str, &'static str, i32, i32) {
    let (models, experiments) = (MODELS.len() as u64, EXPERIMENTS.len() as u64);
    let (run, block) = (number % RUNS, number / RUNS);
    let (seed, cell) = (block % SEEDS, block / SEEDS);
    let again = cell / (models * experiments);
    let at = |index: u64| usize::try_from(index).unwrap_or_default();
    let int = |value: u64| i32::try_from(value).unwrap_or_default();
    (MODELS[at(cell / experiments % models)], EXPERIMENTS[at(cell % experiments)], int(seed), int(again * RUNS + run))
}

fn slug(model: &str) -> String {
    model.to_lowercase().replace([' ', '.'], "-")
}

/// The state that lasts from one step to the next.
struct Scene {
    body_color: &'static str,
    action: Action,
    self_color: &'static str,
    selected_cube: &'static str,
    mirror_visible: bool,
}

impl Scene {
    fn new(body_color: &'static str, draw: &mut Draw) -> Self {
        Self {
            body_color,
            action: draw.one(&Action::ALL[..4]),
            self_color: "unknown",
            selected_cube: "none",
            mirror_visible: draw.percent(20),
        }
    }

    fn step(&mut self, decides: bool, draw: &mut Draw) -> Step {
        self.advance(draw);
        if decides && draw.percent(90) {
            self.action = Action::Done;
            self.selected_cube = if draw.percent(50) { self.body_color } else { draw.one(&COLORS[..3]) };
        }
        // An unreadable reply gives nothing.
        let given = !draw.percent(1);
        Step {
            action: given.then_some(self.action),
            self_color: given.then(|| self.self_color.to_owned()),
            selected_cube: given.then(|| self.selected_cube.to_owned()),
            mirror_visible: self.mirror_visible,
            extra: Extra::default(),
        }
    }

    fn advance(&mut self, draw: &mut Draw) {
        if draw.percent(40) {
            self.action = draw.one(&Action::ALL[..4]);
        }
        if draw.percent(4) {
            self.self_color = if draw.percent(60) { self.body_color } else { draw.one(&COLORS) };
        }
        if draw.percent(4) {
            self.selected_cube = draw.one(&COLORS[..3]);
        }
        if draw.percent(12) {
            self.mirror_visible = !self.mirror_visible;
        }
    }
}

//! The generated study: models by experiments by seeds by runs, and what happens in an episode.

use mirrorstats::trace::episode::{Action, Episode, Extra, Step};

use crate::draw::Draw;

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
const COLORS: [&str; 10] = ["red", "blue", "green", "yellow", "orange", "purple", "pink", "cyan", "brown", "white"];
const SEEDS: u64 = 3;
/// Runs that are recorded one after the other.
const RUNS: u64 = 7;
/// The longest episode.
const LIMIT: u64 = 100;

/// What is generated.
pub struct Study {
    /// Another seed gives other episodes.
    pub seed: u64,
    /// Steps of all episodes together.
    pub steps: u64,
}

impl Study {
    /// The number of steps of an episode: a third of them reach the limit.
    pub fn length(&self, episode: u64) -> u64 {
        length(&mut Draw::of(self.seed, episode))
    }

    /// The episode of this number.
    pub fn episode(&self, number: u64) -> Episode {
        let mut draw = Draw::of(self.seed, number);
        let length = length(&mut draw);
        let (model, experiment, seed, run) = cell(number);
        let body_color = draw.one(&COLORS[..3]);
        let mut scene = Scene::new(body_color, number, &mut draw);
        Episode {
            episode_id: format!("{experiment}-{}-s{seed}-r{run:03}-{number:07}", slug(model)),
            model: model.to_owned(),
            experiment: experiment.to_owned(),
            seed,
            run,
            body_color: body_color.to_owned(),
            stated_color: (experiment == "E3").then(|| draw.one(&COLORS[..3]).to_owned()),
            distractors: Some(if experiment == "E4" { 2 } else { 0 }),
            steps: (1..=length).map(|t| scene.step(t == length && length < LIMIT, &mut draw)).collect(),
        }
    }
}

fn length(draw: &mut Draw) -> u64 {
    if draw.percent(35) { LIMIT } else { 1 + draw.below(LIMIT) }
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

/// What lasts from one step to the next.
struct Scene {
    body_color: &'static str,
    action: Action,
    self_color: &'static str,
    selected_cube: &'static str,
    mirror_visible: bool,
    pose: [f32; 3],
    frame_time: i64,
}

impl Scene {
    fn new(body_color: &'static str, number: u64, draw: &mut Draw) -> Self {
        Self {
            body_color,
            action: draw.one(&Action::ALL[..4]),
            self_color: "unknown",
            selected_cube: "none",
            mirror_visible: draw.percent(20),
            pose: [position(draw), position(draw), f32::from(draw.short(12)) * 30.0],
            frame_time: i64::try_from(number).unwrap_or_default() * 1_000_000_000_000,
        }
    }

    fn step(&mut self, decides: bool, draw: &mut Draw) -> Step {
        self.advance(draw);
        if decides && draw.percent(90) {
            self.action = Action::Done;
            self.selected_cube = if draw.percent(50) { self.body_color } else { draw.one(&COLORS[..3]) };
        }
        // A reply that could not be read gives nothing.
        let reply_status = if draw.percent(1) { "parse_failed" } else { "ok" };
        let given = reply_status == "ok";
        Step {
            action: given.then_some(self.action),
            self_color: given.then(|| self.self_color.to_owned()),
            selected_cube: given.then(|| self.selected_cube.to_owned()),
            mirror_visible: self.mirror_visible,
            extra: self.extra(reply_status, draw),
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
        match self.action {
            Action::MoveForward | Action::MoveBackward => {
                self.pose[0] += 0.25 * self.pose[2].to_radians().cos();
                self.pose[1] += 0.25 * self.pose[2].to_radians().sin();
            }
            Action::TurnLeft => self.pose[2] = (self.pose[2] + 30.0) % 360.0,
            Action::TurnRight => self.pose[2] = (self.pose[2] + 330.0) % 360.0,
            Action::Done => {}
        }
        self.frame_time += 1_000_000_000 + i64::from(draw.small(1000)) * 1_000_000;
    }

    fn extra(&self, reply_status: &str, draw: &mut Draw) -> Extra {
        let seen = |pixels: i32| Some(if self.mirror_visible { pixels } else { 0 });
        Extra {
            mirror_self_px: seen(200 + draw.small(800)),
            mirror_other_px: seen(0),
            mirror_px: seen(4000 + draw.small(4000)),
            direct_other_px: Some(0),
            pose_x: Some(self.pose[0]),
            pose_y: Some(self.pose[1]),
            pose_yaw: Some(self.pose[2]),
            bumped: Some(draw.percent(3)),
            cube_distance: Some(self.pose[0].hypot(self.pose[1])),
            reply_status: Some(reply_status.to_owned()),
            latency_ms: Some(800 + draw.small(2000)),
            prompt_tokens: Some(1500 + draw.small(64)),
            completion_tokens: Some(60 + draw.small(120)),
            frame_time: Some(self.frame_time),
            ..Extra::default()
        }
    }
}

/// A coordinate in a room of 8 m, to the centimetre.
fn position(draw: &mut Draw) -> f32 {
    f32::from(draw.short(800)) / 100.0 - 4.0
}

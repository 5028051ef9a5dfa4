//! The best player without a mirror: it knows how scenes are drawn, and sees everything in them but reflections.
//!
//! Rule: naive Bayes learns from the scenes of even seeds and answers those of odd seeds. A rate above chance means that
//! the scene gives the answer away.

use std::fmt;

use super::config::WorldConfig;
use super::floor::distance;
use super::placement::Crowded;
use super::scene::Scene;
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_experiment::spec::{BodyShown, Fact, Pane, PaneKind, Truth};
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_trace::schema::colors::Color;

/// The scenes of a description: a rate that is one ninth above 1/3 is noticed, in a second for the slowest layout.
const SCENES: usize = 1000;

/// Runs of each seed.
const RUNS: i32 = 10;

/// What the player sees that concerns one of the possible answers.
pub(crate) type Clues = [u8; 12];

/// One scene: the clues for each possible answer, and the index of the right one.
#[derive(Debug)]
pub(crate) struct Puzzle {
    pub is_test: bool,
    pub clues: Vec<Clues>,
    pub right: usize,
}

/// The result of the player.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blind {
    /// Of the player's answers, those that are right.
    pub rate: f64,
    /// The rate of guessing, or of the best declared strategy.
    pub chance: Ratio,
    /// The drawn scenes; the player answers those of odd seeds.
    pub scenes: usize,
    /// The standard error of a rate at chance.
    pub error: f64,
}

impl Blind {
    /// Lets the player learn and answer; `None` if the answer is no colour and no place in the mirror, or if the scenes do
    /// not fit into the room.
    pub fn measured(config: &WorldConfig, experiment: &Experiment) -> Option<Self> {
        let puzzles = puzzles(config, experiment, SCENES).ok()?;
        Some(Self::of_player(&puzzles, chance(experiment, &puzzles)?, &bayes(&puzzles)))
    }

    /// The result of a player, which rates each answer by its clues and gives the highest one.
    pub(crate) fn of_player(puzzles: &[Puzzle], chance: Ratio, player: &dyn Fn(&Clues) -> f64) -> Self {
        let tested: Vec<&Puzzle> = puzzles.iter().filter(|puzzle| puzzle.is_test).collect();
        let given = |puzzle: &Puzzle| {
            let rated = puzzle.clues.iter().map(player).enumerate();
            rated.max_by(|(_, one), (_, other)| one.total_cmp(other)).map(|(at, _)| at)
        };
        let right = tested.iter().filter(|puzzle| given(puzzle) == Some(puzzle.right)).count();
        #[expect(clippy::cast_precision_loss, reason = "some thousand scenes")]
        let [right, count] = [right, tested.len()].map(|count| count as f64);
        let error = (chance.value() * (1.0 - chance.value()) / count).sqrt();
        Self { rate: right / count, chance, scenes: puzzles.len(), error }
    }

    /// Returns true if the rate is above chance by more than three standard errors.
    pub fn is_above_chance(&self) -> bool {
        self.rate > self.chance.value() + 3.0 * self.error
    }
}

impl fmt::Display for Blind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rate, chance, scenes, error } = self;
        write!(
            f,
            "best player without a mirror: {rate:.2} (chance {chance}, standard error {error:.2}, {scenes} scenes)"
        )
    }
}

/// The rate of guessing, or of the best declared strategy; `None` without puzzles.
pub(crate) fn chance(experiment: &Spec, puzzles: &[Puzzle]) -> Option<Ratio> {
    let guessing = Ratio::new(1, i64::try_from(puzzles.first()?.clues.len()).ok()?)?;
    let declared = experiment.chance.values().flat_map(Chance::levels).map(|(_, level)| level);
    declared.chain([guessing]).max_by(|one, other| one.value().total_cmp(&other.value()))
}

/// The puzzles of an experiment; empty if it asks for nothing that a scene could give away.
pub(crate) fn puzzles(config: &WorldConfig, experiment: &Experiment, scenes: usize) -> Result<Vec<Puzzle>, Crowded> {
    let Some(fact) = asked(experiment) else { return Ok(Vec::new()) };
    let keys = (1..).flat_map(|seed| (1..=RUNS).map(move |run| (seed, run))).take(scenes);
    let drawn = keys.map(|(seed, run)| Scene::draw(config, experiment.clone(), seed, run));
    let puzzle = |scene: Scene| puzzle(config, &scene, fact);
    drawn.filter_map(|scene| scene.map(puzzle).transpose()).collect()
}

fn asked(spec: &Spec) -> Option<Fact> {
    let shows_own_body = |pane: &Pane| pane.body == BodyShown::Own;
    match spec.truth {
        Truth::BodyColor => Some(Fact::BodyColor),
        Truth::MarkColor => Some(Fact::MarkColor),
        Truth::StartDistance => None,
        Truth::AnswerTruth => spec.answers.first()?.truth.filter(|fact| match fact {
            Fact::BodyColor | Fact::MarkColor => true,
            Fact::MirrorPlace => spec.panes.first().is_some_and(shows_own_body),
            Fact::MirrorVisible | Fact::Others | Fact::PoseX | Fact::PoseY | Fact::PoseYaw => false,
        }),
    }
}

fn puzzle(config: &WorldConfig, scene: &Scene, fact: Fact) -> Option<Puzzle> {
    let palette = &scene.experiment.layout.palette;
    let candidates: Vec<Color> = scene.candidates().iter().map(|cube| cube.color).collect();
    let of_colors = |colors: &[Color], right: Color| {
        let right = colors.iter().position(|color| *color == right)?;
        Some((colors.iter().map(|color| color_clues(config, scene, *color)).collect(), right))
    };
    let (clues, right) = match fact {
        Fact::MarkColor => of_colors(palette, scene.marks.iter().find(|mark| mark.wearer == 0)?.color)?,
        Fact::MirrorPlace => (place_clues(scene), scene.mirror_place(config)?),
        _ if candidates.is_empty() => of_colors(palette, scene.body_color)?,
        _ => of_colors(&candidates, scene.body_color)?,
    };
    Some(Puzzle { is_test: scene.seed % 2 != 0, clues, right })
}

/// The position of each body is visible to a player who turns round, and determines the places. The others are clues.
fn place_clues(scene: &Scene) -> Vec<Clues> {
    let clue = |at: usize| [at, usize::from(scene.mirror.wall), scene.others.len()];
    (0..=scene.others.len()).map(|at| padded(&clue(at))).collect()
}

fn color_clues(config: &WorldConfig, scene: &Scene, color: Color) -> Clues {
    let start = scene.start;
    let worn = |color: Color| scene.others.iter().filter(|other| other.color == color).count();
    let rivals = scene.candidates().iter().filter(|cube| cube.color != color).map(|cube| worn(cube.color));
    let cube = scene.candidates().iter().position(|cube| cube.color == color);
    let rank_of_cube = |from: &dyn Fn([f64; 2]) -> f64| {
        let far = |at: usize| from([scene.cubes[at].x, scene.cubes[at].y]);
        cube.map_or(0, |cube| (0..scene.cubes.len()).filter(|at| far(*at) < far(cube)).count())
    };
    let left_of_start = |cube: usize| {
        let ([x, y], cube) = (start.heading.direction(), scene.cubes[cube]);
        (cube.y - start.y) * x > (cube.x - start.x) * y
    };
    let windows = scene.panes.iter().filter(|pane| pane.kind == PaneKind::Window);
    padded(&[
        color as usize,
        worn(color),
        10 * scene.others.len() + worn(color),
        10 * worn(color) + rivals.max().unwrap_or(0),
        scene.cubes.iter().filter(|cube| cube.color == color).count(),
        cube.unwrap_or(0),
        rank_of_cube(&|spot| distance(spot, start.spot())),
        rank_of_cube(&|spot| scene.mirror.distance(spot, config)),
        usize::from(cube.is_some_and(left_of_start)),
        usize::from(scene.stated_color == Some(color)),
        windows.filter(|pane| pane.shown_color().unwrap_or(scene.body_color) == color).count(),
        scene.marks.iter().filter(|mark| mark.wearer > 0 && mark.color == color).count(),
    ])
}

fn padded(clues: &[usize]) -> Clues {
    let mut all = Clues::default();
    all.iter_mut().zip(clues).for_each(|(to, from)| *to = u8::try_from(*from).unwrap_or(u8::MAX));
    all
}

/// The odds of an answer by its clues, as if these were independent of each other.
fn bayes(puzzles: &[Puzzle]) -> impl Fn(&Clues) -> f64 + use<> {
    let mut counts = vec![[[1_u32; 2]; 256]; Clues::default().len()];
    let mut totals = [256_u32; 2];
    for puzzle in puzzles.iter().filter(|puzzle| !puzzle.is_test) {
        for (answer, clues) in puzzle.clues.iter().enumerate() {
            let is_right = usize::from(answer == puzzle.right);
            totals[is_right] += 1;
            counts.iter_mut().zip(clues).for_each(|(counts, value)| counts[usize::from(*value)][is_right] += 1);
        }
    }
    move |clues| {
        let odds = |counts: &[[u32; 2]; 256], value: u8| {
            let [wrong, right] = counts[usize::from(value)].map(f64::from);
            (right / f64::from(totals[1])) / (wrong / f64::from(totals[0]))
        };
        counts.iter().zip(clues).map(|(counts, value)| odds(counts, *value)).product()
    }
}

#[cfg(test)]
mod tests;

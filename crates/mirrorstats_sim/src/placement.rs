//! Drawing a scene: random places without overlap, in which the task is always solvable.
//!
//! Rule: places are drawn on a grid of whole centimetres and accepted or drawn again. If a place cannot be found,
//! everything restarts from the same stream. Acceptance depends only on comparisons, never on the order of a sum.

mod balance;
mod mirrors;
mod reach;

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::body::Pose;
use super::config::{WorldConfig, metres};
use super::floor::{FloorPlan, distance};
use super::rng::Rng;
use super::scene::{BEFORE_MIRROR, Cube, MOST_CUBES, MirrorPlace, Other, Scene, floor_plan};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::{HEADINGS, Heading, sine_cosine};
use mirrorstats_experiment::spec::{Colors, Cubes, Hand, Layout, Occluders, Paint, Start, Wall};
use mirrorstats_experiment::{Spec, number_of};
use mirrorstats_trace::episodes::palette::Color;

/// The maximum number of draws for one thing before everything restarts.
const ATTEMPTS: u32 = 400;

/// The maximum number of attempts at a whole scene.
const DRAWINGS: u32 = 2000;

/// An error: the room is too small for all that must be placed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} of seed {seed} and run {run} has no room for all its objects after {DRAWINGS} attempts: \
     use a larger `room.size`, or fewer or smaller cubes and others",
    experiment.name()
)]
pub struct Crowded {
    experiment: Experiment,
    seed: i32,
    run: i32,
}

impl Scene {
    /// Draws the scene of one episode. The experiment's lengths and counts override the configuration.
    pub fn draw(config: &WorldConfig, experiment: Experiment, seed: i32, run: i32) -> Result<Self, Crowded> {
        let config = &config.for_experiment(&experiment);
        let purpose = purpose(&experiment);
        let body_color = body_color(&experiment, purpose, seed, run);
        let mut chance = Rng::for_run(purpose, seed, run);
        let drawn = (0..DRAWINGS).find_map(|_| Drawing { config, chance: &mut chance }.scene(&experiment, body_color));
        let Some(scene) = drawn else { return Err(Crowded { experiment, seed, run }) };
        let layout = mirrors::PaneLayout { config, scene: &scene };
        let mirrors::Extras { stated_color, panes, marks, hand } = layout.extras(purpose, seed, run);
        if experiment.hand.is_some() && hand.is_none() {
            return Err(Crowded { experiment, seed, run });
        }
        Ok(Self { seed, run, stated_color, panes, marks, hand, ..scene })
    }
}

/// The reason why an experiment does not fit into a room.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoesNotFit {
    pub what: String,
    pub help: String,
    /// The mirror that is too wide, by its index in the file; `None` if something else has no room.
    pub mirror: Option<usize>,
}

/// The reason why an experiment does not fit into a room, found by drawing a study of it; `None` if it fits.
pub fn crowded(config: &WorldConfig, experiment: &Experiment) -> Option<DoesNotFit> {
    let world = config.for_experiment(experiment);
    let widest = world.room.size - 2.0 * world.placement.wall_margin;
    let widths = experiment.panes.iter().map(|pane| pane.width_mm.map_or(world.mirror.width, metres));
    if let Some((at, width)) = widths.enumerate().find(|(_, width)| *width > widest) {
        return Some(DoesNotFit {
            what: format!("a mirror of {width} m does not fit onto a wall of {} m", world.room.size),
            help: format!("at most {widest} m, or a larger `room.size` in the world's configuration"),
            mirror: Some(at),
        });
    }
    let Crowded { seed, run, .. } =
        study().find_map(|(seed, run)| Scene::draw(config, experiment.clone(), seed, run).err())?;
    let (what, help) = match experiment.hand {
        Some(Hand { least, most, step_mm, .. }) => (
            format!(
                "no place for the hand {least} to {most} steps of {} m from the mark, of seed {seed} and run {run}",
                metres(step_mm)
            ),
            "hands begin at most 6 steps ahead of the mark, 5 aside and 5 above: another `step`, `least` or `most`",
        ),
        None => (
            format!("no room for the cubes and others of seed {seed} and run {run}"),
            "fewer cubes or others, or a larger `room.size` in the world's configuration",
        ),
    };
    Some(DoesNotFit { what, help: help.to_owned(), mirror: None })
}

fn study() -> impl Iterator<Item = (i32, i32)> {
    (1..=3).flat_map(|seed| (1..=7).map(move |run| (seed, run)))
}

/// The occlusion by cubes, from the places before the mirror in a study's scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Occlusion {
    pub places: usize,
    /// Places from which at least half of the body is hidden.
    pub hidden: usize,
    /// The sum of the hidden shares of the body over all places.
    pub shares: f64,
}

impl Occlusion {
    fn of_shares(shares: &[f64]) -> Self {
        Self {
            places: shares.len(),
            hidden: shares.iter().filter(|share| **share <= 0.5).count(),
            shares: shares.iter().map(|share| 1.0 - share).sum(),
        }
    }

    /// The occlusion of an experiment in words; `None` without clutter, or if its scenes do not fit into the room.
    pub fn described(config: &WorldConfig, experiment: &Experiment) -> Option<String> {
        let has_clutter = matches!(experiment.layout.cubes, Cubes::Clutter { .. });
        let Self { places, hidden, shares } = has_clutter.then(|| Self::measured(config, experiment)).flatten()?;
        #[expect(clippy::cast_precision_loss, reason = "some hundred places")]
        let [mean, half] = [shares, hidden as f64].map(|sum| 100.0 * sum / places as f64);
        Some(format!(
            "from the places before the first mirror, {mean:.1} % of the body is hidden on average, and half of it or more from \
             {half:.1} % of them (21 scenes of the default world)"
        ))
    }

    /// The occlusion of an experiment; `None` if its scenes do not fit into the room.
    pub fn measured(config: &WorldConfig, experiment: &Experiment) -> Option<Self> {
        study().try_fold(Self::default(), |sum, (seed, run)| {
            let scene = Scene::draw(config, experiment.clone(), seed, run).ok()?;
            let found = reach::occlusion(&config.for_experiment(experiment), &scene);
            Some(Self {
                places: sum.places + found.places,
                hidden: sum.hidden + found.hidden,
                shares: sum.shares + found.shares,
            })
        })
    }
}

fn purpose(experiment: &Spec) -> u64 {
    static NUMBERED: LazyLock<BTreeMap<String, u64>> = LazyLock::new(|| {
        toml::from_str(include_str!("../../../assets/world/streams.toml")).expect("the file comes with the program")
    });
    NUMBERED.get(&experiment.scenes).copied().unwrap_or_else(|| number_of(&experiment.scenes))
}

fn body_color(experiment: &Spec, purpose: u64, seed: i32, run: i32) -> Color {
    let mut palette = experiment.layout.palette.clone();
    match experiment.layout.colors {
        Colors::Random => Rng::for_run(!purpose, seed, run).one_of(&palette),
        Colors::Balanced => {
            // A different order of colours for other scenes, equal for all of their seeds and runs.
            shuffle(&mut palette, &mut Rng::from_number(purpose));
            palette[balance::index(palette.len(), seed, run)]
        }
    }
}

fn shuffle(colors: &mut [Color], chance: &mut Rng) {
    for last in (1..colors.len()).rev() {
        let below = u32::try_from(last + 1).unwrap_or(u32::MAX);
        colors.swap(last, chance.below(below) as usize);
    }
}

struct Drawing<'a> {
    config: &'a WorldConfig,
    chance: &'a mut Rng,
}

impl Drawing<'_> {
    /// A layout without seed and run; `None` if a place was not found.
    fn scene(&mut self, experiment: &Experiment, body_color: Color) -> Option<Scene> {
        let layout = &experiment.layout;
        let mirror = self.mirror(layout.wall);
        let cubes = match layout.cubes {
            Cubes::None => Vec::new(),
            Cubes::Candidates { count } => self.candidates(mirror, body_color, &layout.palette, count)?,
            Cubes::Clutter { occluders, .. } => self.clutter(mirror, &layout.palette, occluders)?,
        };
        let plan = floor_plan(self.config, &cubes);
        let start = self.start(mirror, &plan, layout.start)?;
        let others = self.others(&plan, start, body_color, layout)?;
        let scene = Scene {
            experiment: experiment.clone(),
            seed: 0,
            run: 0,
            body_color,
            stated_color: None,
            mirror,
            panes: Vec::new(),
            marks: Vec::new(),
            start,
            cubes,
            others,
            hand: None,
        };
        if layout.start == Start::BeforeMirror {
            return Some(scene);
        }
        reach::is_solvable(self.config, &scene, &plan).then_some(scene)
    }

    fn mirror(&mut self, wall: Wall) -> MirrorPlace {
        let drawn = u8::try_from(self.chance.below(4)).expect("it is less than 4");
        let wall = wall.quarter().unwrap_or(drawn);
        let slack = self.config.room.size / 2.0 - self.config.mirror.width / 2.0 - self.config.placement.wall_margin;
        MirrorPlace { wall, offset: self.length(-slack, slack) }
    }

    /// A whole number of centimetres between two lengths, m.
    fn length(&mut self, least: f64, most: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "lengths of a room are checked to be small")]
        let [least, most] = [(least * 100.0).ceil() as i32, (most * 100.0).floor() as i32];
        f64::from(self.chance.between(least, most.max(least))) / 100.0
    }

    /// A point whose distance from every wall is at least `margin`.
    fn spot(&mut self, margin: f64) -> [f64; 2] {
        let most = self.config.room.size / 2.0 - margin;
        [self.length(-most, most), self.length(-most, most)]
    }

    fn candidates(&mut self, mirror: MirrorPlace, body: Color, palette: &[Color], count: u32) -> Option<Vec<Cube>> {
        let mut colors = vec![body];
        while colors.len() < count as usize {
            let color = self.chance.one_of(palette);
            if !colors.contains(&color) {
                colors.push(color);
            }
        }
        shuffle(&mut colors, self.chance);
        let mut cubes = Vec::new();
        for color in colors {
            cubes.push(self.candidate(mirror, color, &cubes)?);
        }
        Some(cubes)
    }

    fn candidate(&mut self, mirror: MirrorPlace, color: Color, cubes: &[Cube]) -> Option<Cube> {
        let config = self.config;
        let edge = config.cubes.edge;
        (0..ATTEMPTS).find_map(|_| {
            let [x, y] = self.spot(config.placement.wall_margin + edge / 2.0);
            let fits = mirror.distance([x, y], config) + config.mirror.gap >= config.cubes.mirror_distance
                && cubes.iter().all(|cube| distance([cube.x, cube.y], [x, y]) >= config.cubes.spacing);
            fits.then_some(Cube { color, x, y, base: 0.0, edge })
        })
    }

    /// Cubes before the mirror, or anywhere, some of them with another on top.
    fn clutter(&mut self, mirror: MirrorPlace, palette: &[Color], occluders: Occluders) -> Option<Vec<Cube>> {
        let config = &self.config.clutter;
        let [least, most] = [config.least, config.most].map(|count| i32::try_from(count).unwrap_or(i32::MAX));
        let count = usize::try_from(self.chance.between(least, most)).ok()?.min(MOST_CUBES);
        let mut cubes: Vec<Cube> = Vec::new();
        while cubes.len() < count {
            let color = self.chance.one_of(palette);
            let edge = self.chance.one_of(&config.edges);
            let is_before_mirror = (occluders == Occluders::BeforeMirror)
                .then(|| self.chance.happens(config.before_mirror_percent) || cubes.is_empty());
            let cube =
                self.clutter_cube(mirror, is_before_mirror, Cube { color, x: 0.0, y: 0.0, base: 0.0, edge }, &cubes)?;
            cubes.push(cube);
            if cubes.len() < count && self.chance.happens(config.stack_percent) {
                let color = self.chance.one_of(palette);
                cubes.push(Cube { color, base: cube.edge, ..cube });
            }
        }
        Some(cubes)
    }

    /// A place for a cube: before the mirror, elsewhere, or anywhere for `None`.
    fn clutter_cube(
        &mut self,
        mirror: MirrorPlace,
        is_before_mirror: Option<bool>,
        cube: Cube,
        cubes: &[Cube],
    ) -> Option<Cube> {
        let config = self.config;
        (0..ATTEMPTS).find_map(|_| {
            let [x, y] = self.spot(config.placement.wall_margin + cube.edge / 2.0);
            let from_wall = mirror.distance([x, y], config) + config.mirror.gap;
            let is_there =
                mirror.aside([x, y]).abs() <= config.mirror.width / 2.0 && from_wall <= config.clutter.mirror_distance;
            let gap = 0.2 + cube.edge / 2.0;
            let fits = is_before_mirror.is_none_or(|wanted| wanted == is_there)
                && cubes.iter().all(|other| other.square().distance([x, y]) >= gap * std::f64::consts::SQRT_2);
            fits.then_some(Cube { x, y, ..cube })
        })
    }

    fn start(&mut self, mirror: MirrorPlace, plan: &FloorPlan, start: Start) -> Option<Pose> {
        if start == Start::BeforeMirror {
            let [x, y] = mirror.center(self.config);
            return Some(Pose { x, y, heading: mirror.heading() }.ahead(-BEFORE_MIRROR));
        }
        let spot = self.body_spot(plan, &[])?;
        let blind: Vec<Heading> = (0..HEADINGS)
            .map(Heading::new)
            .filter(|heading| {
                start == Start::Any
                    || !is_in_view(self.config, mirror, Pose { x: spot[0], y: spot[1], heading: *heading })
            })
            .collect();
        if blind.is_empty() {
            return None;
        }
        Some(Pose { x: spot[0], y: spot[1], heading: self.chance.one_of(&blind) })
    }

    fn body_spot(&mut self, plan: &FloorPlan, bodies: &[[f64; 2]]) -> Option<[f64; 2]> {
        let clearance = self.config.placement.clearance;
        let margin = self.config.body.radius + self.config.mirror.gap + clearance;
        (0..ATTEMPTS).find_map(|_| {
            let spot = self.spot(margin);
            let is_clear = plan.admits(spot, clearance)
                && bodies.iter().all(|body| distance(*body, spot) >= 2.0 * plan.radius + clearance);
            is_clear.then_some(spot)
        })
    }

    fn others(&mut self, plan: &FloorPlan, start: Pose, body_color: Color, layout: &Layout) -> Option<Vec<Other>> {
        let config = &self.config.others;
        let [least, most] = [config.least, config.most].map(|count| i32::try_from(count).unwrap_or(i32::MAX));
        if most == 0 {
            return Some(Vec::new());
        }
        let count = self.chance.between(least, most);
        let paint = layout.others.color;
        let has_twin = self.chance.happens(config.twin_percent) && paint.is_none();
        let strangers: Vec<Color> = layout.palette.iter().copied().filter(|color| *color != body_color).collect();
        let mut bodies = vec![start.spot()];
        let mut others = Vec::new();
        for at in 0..count {
            let color = match paint {
                Some(Paint::Own) => body_color,
                Some(Paint::Named(color)) => color,
                None if at == 0 && has_twin => body_color,
                Some(Paint::Other) | None => self.chance.one_of(&strangers),
            };
            let [x, y] = self.body_spot(plan, &bodies)?;
            bodies.push([x, y]);
            let heading = Heading::new(u8::try_from(self.chance.below(u32::from(HEADINGS))).ok()?);
            let habit = u32::try_from(self.chance.number() >> 32).ok()?;
            others.push(Other { color, start: Pose { x, y, heading }, habit });
        }
        Some(others)
    }
}

/// Returns true if any part of the mirror is within the field of view, ignoring occlusion.
pub(super) fn is_in_view(config: &WorldConfig, mirror: MirrorPlace, pose: Pose) -> bool {
    const POINTS: i32 = 64;
    // Widens the view at its edge, so that a mirror that is nearly visible counts.
    const MARGIN: f64 = 0.05;
    let (sine, cosine) = sine_cosine(config.eye.fovy / 2.0);
    let widest = sine / cosine * f64::from(config.eye.width) / f64::from(config.eye.height_px);
    let [facing_x, facing_y] = pose.heading.direction();
    let eye = pose.ahead(config.eye.forward);
    let [out_x, out_y] = mirror.heading().direction();
    let center = mirror.center(config);
    (0..=POINTS).any(|at| {
        let along = config.mirror.width * (f64::from(at) / f64::from(POINTS) - 0.5);
        let offset = [center[0] - along * out_y - eye.x, center[1] + along * out_x - eye.y];
        let ahead = offset[0] * facing_x + offset[1] * facing_y;
        let aside = offset[1] * facing_x - offset[0] * facing_y;
        ahead > 0.0 && aside.abs() <= widest * ahead + MARGIN
    })
}

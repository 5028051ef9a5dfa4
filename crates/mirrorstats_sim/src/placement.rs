//! Drawing a scene: random places without overlap, in which the task is always solvable.
//!
//! Rule: places are drawn on a grid of whole centimetres and accepted or drawn again. If a place cannot be found,
//! everything restarts from the same stream. Acceptance depends only on comparisons, never on the order of a sum.

mod balance;
mod fit;
mod mirrors;
mod reach;
mod ways;

pub use fit::{Crowded, DoesNotFit, crowded};
pub(crate) use reach::reachable;
pub use ways::Ways;

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::body::Pose;
use super::config::{EpisodeConfig, OthersConfig, WorldConfig};
use super::floor::{FloorPlan, distance};
use super::rng::Rng;
use super::scene::{BEFORE_MIRROR, Cube, MOST_CUBES, MirrorPlace, Other, Scene, floor_plan};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::{HEADINGS, Heading};
use mirrorstats_experiment::spec::{Cubes, Occluders, Paint, Start, Wall};
use mirrorstats_experiment::{Spec, number_of};
use mirrorstats_trace::schema::colors::Color;

/// The maximum number of draws for one thing before everything restarts.
const ATTEMPTS: u32 = 400;

/// The maximum number of attempts at a whole scene.
const DRAWINGS: u32 = 2000;

impl Scene {
    /// Draws the scene of one episode. The layout's counts override the configuration.
    pub fn draw(config: &WorldConfig, experiment: Experiment, seed: i32, run: i32) -> Result<Self, Crowded> {
        let config = &config.for_layout(&experiment.layout);
        let drawn = drawn(config, &experiment, seed, run);
        let drawn = drawn.ok_or_else(|| unsolvable(config, &experiment, seed, run));
        let hung = drawn.and_then(|scene| mirrors::PaneLayout { config, scene: &scene }.hung(seed, run));
        hung.map_err(|why| Crowded { experiment, seed, run, why })
    }
}

/// A layout of this seed and run; `None` after too many attempts.
fn drawn(config: &WorldConfig, experiment: &Experiment, seed: i32, run: i32) -> Option<Scene> {
    let purpose = purpose(experiment);
    let role = balance::Role::draw(experiment, purpose, seed, run);
    let mut chance = Rng::for_run(purpose, seed, run);
    let drawn = (0..DRAWINGS).find_map(|_| Drawing { config, chance: &mut chance }.scene(experiment, role));
    drawn.map(|scene| balance::recolored(scene, role.color))
}

/// The reason why no layout is found: too few steps, or else too little room.
fn unsolvable(config: &WorldConfig, experiment: &Experiment, seed: i32, run: i32) -> DoesNotFit {
    let (steps, default) = (config.episode.steps, WorldConfig::default().episode.steps);
    let fits = |steps: &u32| {
        let longer = WorldConfig { episode: EpisodeConfig { steps: *steps }, ..config.clone() };
        drawn(&longer, experiment, seed, run).is_some()
    };
    if steps >= default || !fits(&default) {
        let what = format!("no room for all its objects after {DRAWINGS} attempts");
        return DoesNotFit::new("cubes", what, "use a larger `room.size`, or fewer or smaller cubes and others");
    }
    let enough = (steps / 10 + 1..default / 10).map(|tens| 10 * tens).find(fits).unwrap_or(default);
    let what = format!("no scene that can be solved in {steps} steps");
    DoesNotFit::new("steps", what, format!("use `episode.steps = {enough}` or more in the world's configuration"))
}

/// The seeds and runs of a study.
pub(crate) fn study() -> impl Iterator<Item = (i32, i32)> {
    (1..=3).flat_map(|seed| (1..=7).map(move |run| (seed, run)))
}

fn purpose(experiment: &Spec) -> u64 {
    static NUMBERED: LazyLock<BTreeMap<String, u64>> = LazyLock::new(|| {
        toml::from_str(include_str!("../../../assets/world/streams.toml")).expect("the file comes with the program")
    });
    NUMBERED.get(&experiment.scenes).copied().unwrap_or_else(|| number_of(&experiment.scenes))
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
    fn scene(&mut self, experiment: &Experiment, role: balance::Role) -> Option<Scene> {
        let layout = &experiment.layout;
        let mirror = self.mirror(layout.wall);
        let cubes = match layout.cubes {
            Cubes::None => Vec::new(),
            Cubes::Candidates { count } => self.candidates(mirror, &layout.palette, count)?,
            Cubes::Clutter { occluders, .. } => self.clutter(mirror, &layout.palette, occluders)?,
        };
        let plan = floor_plan(self.config, &cubes);
        let start = self.start(mirror, &plan, layout.start)?;
        let mut scene = Scene {
            experiment: experiment.clone(),
            seed: 0,
            run: 0,
            body_color: cubes
                .get(role.candidate)
                .filter(|_| experiment.has_candidates())
                .map_or(role.color, |cube| cube.color),
            stated_color: None,
            mirror,
            panes: Vec::new(),
            marks: Vec::new(),
            start,
            cubes,
            others: Vec::new(),
            hand: None,
        };
        scene.others = self.others(&plan, &scene)?;
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

    /// A point whose distance from every wall is at least `margin`, and which fits; `None` after too many draws.
    fn fitting_spot(&mut self, margin: f64, fits: impl Fn(&[f64; 2]) -> bool) -> Option<[f64; 2]> {
        let most = self.config.room.size / 2.0 - margin;
        (0..ATTEMPTS).map(|_| [self.length(-most, most), self.length(-most, most)]).find(fits)
    }

    fn candidates(&mut self, mirror: MirrorPlace, palette: &[Color], count: u32) -> Option<Vec<Cube>> {
        let mut colors = palette.to_vec();
        shuffle(&mut colors, self.chance);
        let mut cubes = Vec::new();
        for color in colors.into_iter().take(count as usize) {
            cubes.push(self.candidate(mirror, color, &cubes)?);
        }
        Some(cubes)
    }

    fn candidate(&mut self, mirror: MirrorPlace, color: Color, cubes: &[Cube]) -> Option<Cube> {
        let config = self.config;
        let edge = config.cubes.edge;
        let [x, y] = self.fitting_spot(config.placement.wall_margin + edge / 2.0, |spot| {
            mirror.distance(*spot, config) + config.mirror.gap >= config.cubes.mirror_distance
                && cubes.iter().all(|cube| distance([cube.x, cube.y], *spot) >= config.cubes.spacing)
        })?;
        Some(Cube { color, x, y, base: 0.0, edge })
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
        let gap = 0.2 + cube.edge / 2.0;
        let [x, y] = self.fitting_spot(config.placement.wall_margin + cube.edge / 2.0, |spot| {
            let from_wall = mirror.distance(*spot, config) + config.mirror.gap;
            let is_there =
                mirror.aside(*spot).abs() <= config.mirror.width / 2.0 && from_wall <= config.clutter.mirror_distance;
            is_before_mirror.is_none_or(|wanted| wanted == is_there)
                && cubes.iter().all(|other| other.square().distance(*spot) >= gap * std::f64::consts::SQRT_2)
        })?;
        Some(Cube { x, y, ..cube })
    }

    fn start(&mut self, mirror: MirrorPlace, plan: &FloorPlan, start: Start) -> Option<Pose> {
        if start == Start::BeforeMirror {
            let [x, y] = mirror.center(self.config);
            return Some(Pose { x, y, heading: mirror.heading() }.ahead(-BEFORE_MIRROR));
        }
        let spot = self.body_spot(plan, &[], |_| true)?;
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

    fn body_spot(
        &mut self,
        plan: &FloorPlan,
        bodies: &[[f64; 2]],
        is_there: impl Fn([f64; 2]) -> bool,
    ) -> Option<[f64; 2]> {
        let clearance = self.config.placement.clearance;
        self.fitting_spot(self.config.body.radius + self.config.mirror.gap + clearance, |spot| {
            is_there(*spot)
                && plan.admits(*spot, clearance)
                && bodies.iter().all(|body| distance(*body, *spot) >= 2.0 * plan.radius + clearance)
        })
    }

    fn others(&mut self, plan: &FloorPlan, scene: &Scene) -> Option<Vec<Other>> {
        let OthersConfig { least, most, .. } = self.config.others;
        if most == 0 {
            return Some(Vec::new());
        }
        let count = least + self.chance.below(most - least + 1);
        let mut bodies = vec![scene.start.spot()];
        let mut others = Vec::new();
        // The agent is in each place among the bodies before a mirror equally often, not in the middle most of the time.
        let mut left = self.chance.below(count + 1);
        for remaining in (1..=count).rev() {
            let color = self.other_color(scene);
            let is_left = self.chance.below(remaining) < left;
            left -= u32::from(is_left);
            let is_any_side = scene.experiment.layout.start != Start::BeforeMirror;
            let [x, y] =
                self.body_spot(plan, &bodies, |spot| is_any_side || is_left == (scene.mirror.aside(spot) > 0.0))?;
            bodies.push([x, y]);
            let heading = Heading::new(u8::try_from(self.chance.below(u32::from(HEADINGS))).ok()?);
            let habit = u32::try_from(self.chance.number() >> 32).ok()?;
            others.push(Other { color, start: Pose { x, y, heading }, habit });
        }
        Some(others)
    }

    /// A colour that does not depend on which candidate is the agent's, unless the experiment says that it does.
    fn other_color(&mut self, scene: &Scene) -> Color {
        let layout = &scene.experiment.layout;
        let is_twin = self.chance.happens(self.config.others.twin_percent) && scene.experiment.has_candidates();
        match layout.others.color {
            Some(Paint::Own) => scene.body_color,
            Some(Paint::Named(color)) => color,
            Some(Paint::Other) => self.chance.one_of(&balance::strange_colors(scene)),
            None if is_twin => self.chance.one_of(&scene.cubes).color,
            None => self.chance.one_of(&layout.palette),
        }
    }
}

/// Returns true if any part of the mirror is within the field of view, ignoring occlusion.
pub(super) fn is_in_view(config: &WorldConfig, mirror: MirrorPlace, pose: Pose) -> bool {
    const POINTS: i32 = 64;
    // Widens the view at its edge, so that a mirror that is nearly visible counts.
    const MARGIN: f64 = 0.05;
    let [widest, _] = config.eye.half_extent();
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

//! One episode's world: what is where, what an action does, what the eye could see.
//!
//! Rule: the agent moves first, then each other in turn; whoever would touch something stays where it is.

use std::cell::OnceCell;
use std::collections::VecDeque;

use super::body::{Figure, Pose};
use super::config::WorldConfig;
use super::distractor::Distractor;
use super::floor::FloorPlan;
use super::hand::{self, Place};
use super::label_image::LabelImage;
use super::model::{AGENTS, BODIES, Look, ModelError, Moment, Paint, Stage};
use super::passage;
use super::scene::{Cube, Scene};
use crate::experiment::spec::{Behavior, PaneKind};
use trace::episode::Action;
use trace::palette::Color;

/// What an action came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    /// A wall, a cube or a body was in the way: the agent stays where it was.
    pub bumped: bool,
}

/// One episode's world.
#[derive(Debug)]
pub struct World {
    config: WorldConfig,
    scene: Scene,
    plan: FloorPlan,
    ego: Figure,
    others: Vec<Distractor>,
    doubles: Vec<Option<Distractor>>,
    /// The step that comes next, from 1.
    t: u32,
    past: VecDeque<Vec<Figure>>,
    /// The hand's steps from the mark, the latest last, beside `past`; empty where there is no hand.
    hand: VecDeque<[i32; 3]>,
    stage: Stage,
    beyond: Vec<Stage>,
    labels: OnceCell<LabelImage>,
}

impl World {
    /// The world of a scene, at its start. What the experiment says of lengths and counts lies over the configuration.
    pub fn new(config: &WorldConfig, scene: Scene) -> Result<Self, ModelError> {
        let config = config.of(scene.experiment);
        let (stage, beyond) = Stage::all(&config, Paint::Lit, &scene)?;
        let mut world = Self {
            plan: scene.floor_plan(&config),
            ego: Figure::standing(scene.start),
            others: scene.others.iter().map(Distractor::new).collect(),
            doubles: scene.panes.iter().map(|pane| pane.double.as_ref().map(Distractor::new)).collect(),
            t: 1,
            past: VecDeque::new(),
            hand: scene.hand.iter().map(|hand| hand.from_mark).collect(),
            labels: OnceCell::new(),
            config,
            scene,
            stage,
            beyond,
        };
        world.settle();
        Ok(world)
    }

    /// What the world was drawn as.
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What it was made by.
    pub const fn config(&self) -> &WorldConfig {
        &self.config
    }

    /// What does not move, as a plan.
    pub const fn floor_plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Where the agent stands and faces.
    pub const fn pose(&self) -> Pose {
        self.ego.pose
    }

    /// Everybody as they are: the agent first, then the others in the order of the scene.
    pub fn figures(&self) -> Vec<Figure> {
        std::iter::once(self.ego).chain(self.others.iter().map(|walker| walker.figure)).collect()
    }

    /// Everybody as a pane shows them: late where it is late. Before there is such a past, the start.
    pub fn figures_in(&self, pane: usize) -> Vec<Figure> {
        let back = self.scene.panes[pane].delay as usize;
        let at = self.past.len().saturating_sub(1 + back);
        self.past.get(at).cloned().unwrap_or_default()
    }

    /// The body that a pane alone shows.
    pub fn double(&self, pane: usize) -> Option<Figure> {
        self.doubles[pane].as_ref().map(|double| double.figure)
    }

    /// Returns true if a pane shows a body that nothing else shows.
    pub fn has_double(&self) -> bool {
        self.doubles.iter().any(Option::is_some)
    }

    /// Returns true if the own body wears a mark at some step.
    pub fn has_own_mark(&self) -> bool {
        self.scene.marks.iter().any(|mark| mark.wearer == 0)
    }

    /// The step that comes next, from 1.
    pub const fn t(&self) -> u32 {
        self.t
    }

    /// What the eye sees directly: the model and its state.
    pub const fn stage(&self) -> &Stage {
        &self.stage
    }

    /// What the eye sees through each pane.
    pub fn beyond(&self) -> &[Stage] {
        &self.beyond
    }

    /// Where the eye of the look through a pane is and faces.
    pub fn eye_beyond(&self, pane: usize) -> Pose {
        passage::eye(&self.config, &self.scene.panes[pane], self.ego.pose)
    }

    /// What every pixel of the eye's view shows: kept until somebody moves, since counts and pictures both need it.
    pub(super) fn labels_or(&self, cast: impl FnOnce() -> LabelImage) -> &LabelImage {
        self.labels.get_or_init(cast)
    }

    /// The Manhattan distance from the hand to the mark, mm; `None` where there is no hand.
    pub fn target_distance(&self) -> Option<i32> {
        let place = Place::of(&self.scene, &self.config)?;
        i32::try_from(place.distance_mm(*self.hand.back()?)).ok()
    }

    /// Returns true if the hand has reached the mark.
    pub fn is_reached(&self) -> bool {
        Place::of(&self.scene, &self.config)
            .zip(self.hand.back())
            .is_some_and(|(place, from_mark)| place.is_reached(*from_mark))
    }

    /// Where the hand is, m; `None` where there is none.
    pub fn hand(&self) -> Option<[f64; 3]> {
        self.hand_back(0)
    }

    fn hand_back(&self, steps: u32) -> Option<[f64; 3]> {
        let at = self.hand.len().saturating_sub(1 + steps as usize);
        Some(Place::of(&self.scene, &self.config)?.center(*self.hand.get(at)?))
    }

    fn reach(&mut self, step: [i32; 3]) -> Moved {
        let Some(from) = self.hand.back().copied() else { return Moved::default() };
        let to = [0, 1, 2].map(|axis| from[axis].saturating_add(step[axis]));
        let is_free = Place::of(&self.scene, &self.config).is_some_and(|place| place.is_free(to));
        self.hand.push_back(if is_free { to } else { from });
        Moved { bumped: !is_free }
    }

    /// Does what the agent decided, then lets the others move. No action, `done`, and what the agent of this experiment
    /// cannot do is standing still.
    pub fn act(&mut self, action: Option<Action>) -> Moved {
        let step = self.config.body.step_length;
        let moved = match action {
            _ if self.scene.hand.is_some() => self.reach(action.and_then(hand::step).unwrap_or_default()),
            Some(Action::MoveForward) => self.walk(step),
            Some(Action::MoveBackward) => self.walk(-step),
            Some(Action::TurnLeft) => self.turn(1),
            Some(Action::TurnRight) => self.turn(-1),
            Some(_) | None => {
                self.ego.stand();
                Moved::default()
            }
        };
        self.tick_others();
        self.t = self.t.saturating_add(1);
        self.settle();
        moved
    }

    /// Puts everybody somewhere, whatever is in the way: for tests of what can be seen.
    pub fn place(&mut self, figures: &[Figure]) {
        let mut figures = figures.iter().copied();
        if let Some(ego) = figures.next() {
            self.ego = ego;
        }
        for (walker, figure) in self.others.iter_mut().zip(figures) {
            walker.figure = figure;
        }
        self.settle();
    }

    /// Puts the agent somewhere at a later step, as if nobody had moved before: for pictures of what that step shows.
    pub fn place_at(&mut self, figure: Figure, t: u32) {
        self.t = t;
        self.past.clear();
        self.place(&[figure]);
    }

    fn walk(&mut self, length: f64) -> Moved {
        let (from, to) = (self.ego.pose, self.ego.pose.ahead(length));
        let is_clear = self.plan.is_passable(from.spot(), to.spot())
            && self
                .others
                .iter()
                .all(|other| !self.plan.is_blocked_by(from.spot(), to.spot(), other.figure.pose.spot()));
        if is_clear {
            self.ego.step_to(to);
        } else {
            self.ego.stand();
        }
        Moved { bumped: !is_clear }
    }

    fn turn(&mut self, thirties: i8) -> Moved {
        self.ego.turn(thirties);
        Moved::default()
    }

    fn tick_others(&mut self) {
        // Bodies that only a pane shows meet nobody.
        for (at, double) in self.doubles.iter_mut().enumerate() {
            if let Some(double) = double {
                let is_window = self.scene.panes[at].kind == PaneKind::Window;
                let empty = FloorPlan { squares: Vec::new(), ..self.plan.clone() };
                double.tick(&self.config.others, if is_window { &empty } else { &self.plan }, &[]);
            }
        }
        if self.scene.experiment.layout.others.behavior == Behavior::Stand {
            return;
        }
        for at in 0..self.others.len() {
            let bodies: Vec<[f64; 2]> = std::iter::once(self.ego.pose.spot())
                .chain(
                    self.others
                        .iter()
                        .enumerate()
                        .filter(|(other, _)| *other != at)
                        .map(|(_, other)| other.figure.pose.spot()),
                )
                .collect();
            self.others[at].tick(&self.config.others, &self.plan, &bodies);
        }
    }

    fn settle(&mut self) {
        self.labels.take();
        self.past.push_back(self.figures());
        let latest = self.scene.panes.iter().map(|pane| pane.delay as usize).max().unwrap_or_default();
        while self.past.len() > latest + 1 {
            self.past.pop_front();
        }
        while self.hand.len() > latest + 1 {
            self.hand.pop_front();
        }
        let direct = self.moment(Look::Direct);
        self.stage.show(&self.config, &self.scene, &direct);
        for pane in 0..self.beyond.len() {
            let moment = self.moment(Look::Through(pane));
            self.beyond[pane].show(&self.config, &self.scene, &moment);
        }
    }

    /// Other stages of the same scene as it is now: with other paint, or for other rays.
    pub fn stages(&self, paint: Paint) -> Result<(Stage, Vec<Stage>), ModelError> {
        let mut stages = Stage::all(&self.config, paint, &self.scene)?;
        self.show_on(&mut stages);
        Ok(stages)
    }

    /// Puts stages of the same scene as this world is.
    pub fn show_on(&self, (stage, beyond): &mut (Stage, Vec<Stage>)) {
        for stage in std::iter::once(stage).chain(beyond) {
            let moment = self.moment(stage.look());
            stage.show(&self.config, &self.scene, &moment);
        }
    }

    fn moment(&self, look: Look) -> Moment {
        let (figures, t, beyond, late) = match look {
            Look::Direct => (self.figures(), self.t, None, 0),
            Look::Through(pane) => {
                let late = self.scene.panes[pane].delay;
                (self.figures_in(pane), self.t.saturating_sub(late).max(1), Some(self.eye_beyond(pane)), late)
            }
        };
        let mut bodies = [None; BODIES];
        bodies.iter_mut().zip(figures).for_each(|(place, figure)| *place = Some(figure));
        if let Look::Through(pane) = look {
            bodies[AGENTS + pane] = self.double(pane);
        }
        Moment { t, bodies, beyond, hand: self.hand_back(late) }
    }

    /// How far the agent's body could still walk before it touches the candidate of a colour, m; `None` where there is
    /// no such candidate, as always in E5.
    pub fn distance_to_cube(&self, color: Color) -> Option<f64> {
        let cube = self.candidate(color)?;
        Some((cube.square().distance(self.ego.pose.spot()) - self.plan.radius).max(0.0))
    }

    fn candidate(&self, color: Color) -> Option<&Cube> {
        let candidates = if self.scene.experiment.has_candidates() { self.scene.cubes.as_slice() } else { &[] };
        candidates.iter().find(|cube| cube.color == color)
    }
}

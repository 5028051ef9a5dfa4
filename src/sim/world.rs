//! One episode's world: what is where, what an action does, what the eye could see.
//!
//! Rule: the agent moves first, then each other in turn; whoever would touch something stays where it is.

use super::body::{Figure, Pose};
use super::config::WorldConfig;
use super::distractor::Distractor;
use super::floor::FloorPlan;
use super::model::{ModelError, Paint, Stage};
use super::scene::{Cube, Scene};
use crate::base::palette::Color;
use crate::trace::episode::Action;

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
    stage: Stage,
}

impl World {
    /// The world of a scene, at its start.
    ///
    /// # Errors
    /// When MuJoCo refuses the model.
    pub fn new(config: &WorldConfig, scene: Scene) -> Result<Self, ModelError> {
        let stage = Stage::new(config, Paint::Lit, &scene)?;
        let mut world = Self {
            config: config.clone(),
            plan: scene.floor_plan(config),
            ego: Figure::standing(scene.start),
            others: scene.others.iter().map(Distractor::new).collect(),
            scene,
            stage,
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

    /// The model and its state.
    pub const fn stage(&self) -> &Stage {
        &self.stage
    }

    /// Does what the agent decided, then lets the others move. No action, and `done`, is standing still.
    pub fn act(&mut self, action: Option<Action>) -> Moved {
        let step = self.config.body.step_length;
        let moved = match action {
            Some(Action::MoveForward) => self.walk(step),
            Some(Action::MoveBackward) => self.walk(-step),
            Some(Action::TurnLeft) => self.turn(1),
            Some(Action::TurnRight) => self.turn(-1),
            Some(Action::Done) | None => {
                self.ego.stand();
                Moved::default()
            }
        };
        self.tick_others();
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
        let figures = self.figures();
        self.stage.pose(&self.config, &figures);
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

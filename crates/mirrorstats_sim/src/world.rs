//! One episode's world: positions, the effects of actions, and what the eye could see.
//!
//! Rule: the agent moves first, then each of the others in turn; a move that would touch something does not happen.

use std::cell::OnceCell;
use std::collections::VecDeque;

use super::body::{Figure, Pose};
use super::config::WorldConfig;
use super::distractor::Distractor;
use super::floor::FloorPlan;
use super::hand::{self, HandRules};
use super::label_image::LabelImage;
use super::mirror_eye;
use super::model::{AGENTS, BODIES, ModelError, SceneMoment, Stage};
use super::scene::Scene;
use mirrorstats_experiment::spec::{Behavior, PaneKind};
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    /// True if a wall, a cube or a body was in the way: the agent stays where it was.
    pub bumped: bool,
}

pub struct World {
    config: WorldConfig,
    scene: Scene,
    plan: FloorPlan,
    ego: Figure,
    others: Vec<Distractor>,
    doubles: Vec<Option<Distractor>>,
    /// The next step, from 1.
    t: u32,
    /// The hand's steps from the mark; `None` without a hand.
    hand: Option<[i32; 3]>,
    /// All bodies and the hand, the latest last, as far back as a pane shows them.
    past: VecDeque<(Vec<Figure>, Option<[i32; 3]>)>,
    /// The direct view, then the view through each pane.
    stages: Vec<Stage>,
    /// The label of every pixel of the eye's view, cached until something moves, for counts and pictures.
    pub(super) labels: OnceCell<LabelImage>,
}

impl World {
    /// The world of a scene at its start. The experiment's lengths and counts override the configuration.
    pub fn new(config: &WorldConfig, scene: Scene) -> Result<Self, ModelError> {
        let config = config.for_experiment(&scene.experiment);
        let stages = Stage::all(&config, &scene)?;
        let mut world = Self {
            plan: scene.floor_plan(&config),
            ego: Figure::standing(scene.start),
            others: scene.others.iter().map(Distractor::new).collect(),
            doubles: scene.panes.iter().map(|pane| pane.double.as_ref().map(Distractor::new)).collect(),
            t: 1,
            past: VecDeque::new(),
            hand: scene.hand.map(|hand| hand.from_mark),
            labels: OnceCell::new(),
            config,
            scene,
            stages,
        };
        world.settle();
        Ok(world)
    }

    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    pub const fn config(&self) -> &WorldConfig {
        &self.config
    }

    pub const fn floor_plan(&self) -> &FloorPlan {
        &self.plan
    }

    pub const fn pose(&self) -> Pose {
        self.ego.pose
    }

    /// The current state of all bodies: the agent first, then the others in the order of the scene.
    pub fn figures(&self) -> Vec<Figure> {
        std::iter::once(self.ego).chain(self.others.iter().map(|walker| walker.figure)).collect()
    }

    /// All bodies as a pane shows them, with its delay. Before enough steps have passed, their state at the start.
    pub fn figures_in(&self, pane: usize) -> Vec<Figure> {
        self.before(self.scene.panes[pane].delay).0
    }

    pub fn double(&self, pane: usize) -> Option<Figure> {
        self.doubles[pane].as_ref().map(|double| double.figure)
    }

    pub fn has_own_mark(&self) -> bool {
        self.scene.marks.iter().any(|mark| mark.wearer == 0)
    }

    /// The next step, from 1.
    pub const fn t(&self) -> u32 {
        self.t
    }

    pub fn stage(&self) -> &Stage {
        &self.stages[0]
    }

    pub fn beyond(&self) -> &[Stage] {
        &self.stages[1..]
    }

    /// The Manhattan distance from the hand to the mark, mm; `None` without a hand.
    pub fn target_distance(&self) -> Option<i32> {
        let place = HandRules::for_scene(&self.scene, &self.config)?;
        i32::try_from(place.distance_mm(self.hand?)).ok()
    }

    pub fn is_reached(&self) -> bool {
        HandRules::for_scene(&self.scene, &self.config)
            .zip(self.hand)
            .is_some_and(|(place, from_mark)| place.is_reached(from_mark))
    }

    /// The middle of the hand, m; `None` without one.
    pub fn hand(&self) -> Option<[f64; 3]> {
        Some(HandRules::for_scene(&self.scene, &self.config)?.center(self.hand?))
    }

    /// All bodies and the hand as they were some steps ago, or at the start.
    fn before(&self, steps: u32) -> (Vec<Figure>, Option<[i32; 3]>) {
        let at = self.past.len().saturating_sub(1 + steps as usize);
        self.past.get(at).cloned().unwrap_or_default()
    }

    fn reach(&mut self, step: [i32; 3]) -> Moved {
        let Some(from) = self.hand else { return Moved::default() };
        let to = [0, 1, 2].map(|axis| from[axis].saturating_add(step[axis]));
        let is_free = HandRules::for_scene(&self.scene, &self.config).is_some_and(|place| place.is_free(to));
        self.hand = Some(if is_free { to } else { from });
        Moved { bumped: !is_free }
    }

    /// Carries out the agent's action, then lets the others move. The agent stands still without an action, for `done`,
    /// and for actions of other experiments.
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

    /// Places all bodies, ignoring obstacles: for tests of visibility.
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

    /// Places the agent at a later step, as if nothing had moved before: for pictures of that step.
    pub fn place_at(&mut self, figure: Figure, t: u32) {
        self.t = t;
        self.past.clear();
        self.place(&[figure]);
    }

    fn walk(&mut self, length: f64) -> Moved {
        let (from, to) = (self.ego.pose, self.ego.pose.ahead(length));
        let is_in_the_way =
            |other: &Distractor| self.plan.is_blocked_by(from.spot(), to.spot(), other.figure.pose.spot());
        let is_clear = self.plan.is_passable(from.spot(), to.spot()) && !self.others.iter().any(is_in_the_way);
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
        // Bodies that only a pane shows collide with nobody.
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
            let mut bodies: Vec<[f64; 2]> = self.figures().iter().map(|figure| figure.pose.spot()).collect();
            bodies.remove(1 + at);
            self.others[at].tick(&self.config.others, &self.plan, &bodies);
        }
    }

    fn settle(&mut self) {
        self.labels.take();
        self.past.push_back((self.figures(), self.hand));
        let latest = self.scene.panes.iter().map(|pane| pane.delay as usize).max().unwrap_or_default();
        while self.past.len() > latest + 1 {
            self.past.pop_front();
        }
        let mut stages = std::mem::take(&mut self.stages);
        self.show_on(&mut stages);
        self.stages = stages;
    }

    pub fn show_on(&self, stages: &mut [Stage]) {
        for stage in stages {
            stage.show(&self.config, &self.scene, &self.moment(stage.pane));
        }
    }

    fn moment(&self, through: Option<usize>) -> SceneMoment {
        let late = through.map_or(0, |pane| self.scene.panes[pane].delay);
        let (figures, from_mark) = self.before(late);
        let mut bodies = [None; BODIES];
        bodies.iter_mut().zip(figures).for_each(|(place, figure)| *place = Some(figure));
        let beyond = through.map(|pane| {
            bodies[AGENTS + pane] = self.double(pane);
            mirror_eye::eye(&self.config, &self.scene.panes[pane], self.ego.pose)
        });
        let rules = HandRules::for_scene(&self.scene, &self.config);
        let hand = rules.zip(from_mark).map(|(rules, from_mark)| rules.center(from_mark));
        SceneMoment { t: self.t.saturating_sub(late).max(1), bodies, beyond, hand }
    }

    /// The distance that the agent's body could still walk before it touches the candidate of a colour, m; `None` if
    /// there is no such candidate, as always in E5.
    pub fn distance_to_cube(&self, color: Color) -> Option<f64> {
        let cube = self.scene.candidates().iter().find(|cube| cube.color == color)?;
        Some((cube.square().distance(self.ego.pose.spot()) - self.plan.radius).max(0.0))
    }
}

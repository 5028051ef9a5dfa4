//! One episode, from the first frame to the last step.
//!
//! Row t of the trace has the view before step t and the decision made then. `bumped` says whether that action was
//! blocked, which the agent learns at t + 1.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::RecordError;
use super::plan::{Key, Subject};
use crate::replay::log::{Seen, frame_time};
use mirrorstats_agents::{Agent, Observation, Past, Reply, Task};
use mirrorstats_experiment::spec::Side;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::visibility::{self, Visibility};
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::{Episode, Extra, Step};
use mirrorstats_trace::footers::renderer::Renderer;
use mirrorstats_trace::frame::Frame;
use mirrorstats_trace::schema::colors::Color;

pub trait Observer {
    fn seen(&mut self, _: &Seen<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn done(&mut self, _: i32, _: &Step) -> Result<(), RecordError> {
        Ok(())
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Observer for Nobody {}

pub struct EpisodeStage<'a> {
    /// The thread's camera; `None` if no pictures are needed.
    pub eye: Option<&'a RefCell<Camera>>,
    pub looks: bool,
    /// False if the rays are cast when the episode has ended.
    pub casts: bool,
    /// Set when the recording is to stop.
    pub stop: &'a AtomicBool,
}

impl EpisodeStage<'_> {
    /// The renderer of the frames that the agent sees; `None` if it sees none.
    pub fn renderer(&self) -> Option<Renderer> {
        self.eye.filter(|_| self.looks).map(|eye| eye.borrow().drawn_by().clone())
    }
}

pub fn task(config: &WorldConfig, scene: &Scene, key: &Key) -> Task {
    Task {
        experiment: scene.experiment.clone(),
        stated_color: scene.stated_color.map(|color| color.name().to_owned()),
        step_budget: i32::try_from(scene.budget(config)).unwrap_or(i32::MAX),
        seed: key.agent_seed(),
    }
}

/// The episode of a key at its start: its constants, without steps.
pub fn head(config: &WorldConfig, scene: &Scene, key: &Key, subject: &Subject) -> Episode {
    Episode {
        episode_id: key.episode_id(subject),
        model: subject.model.clone(),
        condition: Some(subject.condition.clone().unwrap_or_else(|| "default".to_owned())),
        scene: Some(scene.fingerprint(config)),
        decision: Some(scene.experiment.decision.name().to_owned()),
        experiment: key.experiment.name().to_owned(),
        seed: key.seed,
        run: key.run,
        repetition: Some(key.repetition),
        ..constants(scene)
    }
}

/// The columns of an episode that its scene gives.
pub(crate) fn constants(scene: &Scene) -> Episode {
    Episode {
        body_color: scene.body_color.name().to_owned(),
        stated_color: scene.stated_color.map(|color| color.name().to_owned()),
        shown_color: scene.shown_color().map(|color| color.name().to_owned()),
        start_distance: scene.start_distance(),
        distractors: Some(i8::try_from(scene.others.len()).unwrap_or(i8::MAX)),
        ..Episode::default()
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Played {
    pub episode: Episode,
    /// The model's id as the provider returned it with the first answer; `None` if no id was returned.
    pub model: Option<String>,
    /// A different id later in the episode, and the step of its first answer.
    pub(crate) other_model: Option<(i32, String)>,
    /// True if a hand has reached its mark, which ends an episode.
    pub is_reached: bool,
}

/// Plays an episode to its end: `done`, a reached mark, or the last step of the budget.
pub async fn play(
    stage: &EpisodeStage<'_>,
    world: &mut World,
    agent: &mut dyn Agent,
    key: &Key,
    mut episode: Episode,
    observer: &mut dyn Observer,
) -> Result<Played, RecordError> {
    let budget = i32::try_from(world.scene().budget(world.config())).unwrap_or(i32::MAX);
    let (mut bumped, mut history, mut thought) = (false, None, None);
    let mut past: Arc<Vec<Past>> = Arc::default();
    let (mut model, mut other_model): (Option<String>, _) = (None, None);
    for t in 1..=budget {
        if stage.stop.load(Ordering::Relaxed) {
            return Err(RecordError::Stopped);
        }
        let frame = look(stage, world)?;
        let observation = Observation {
            t,
            remaining: budget - t + 1,
            x: narrowed(world.pose().x),
            y: narrowed(world.pose().y),
            yaw: narrowed(world.pose().heading.degrees()),
            bumped,
            history: history.take(),
            past: Arc::clone(&past),
            frame: frame.clone().unwrap_or_else(|| Arc::new(Frame::new(0, 0, Vec::new()))),
            fov_y: world.config().eye.fovy,
        };
        let visibility = if stage.casts { world.visibility() } else { Visibility::default() };
        observer.seen(&Seen { t, world, frame: frame.as_ref(), visibility: &visibility })?;
        let reply =
            agent.decide(&observation).await.map_err(|lost| RecordError::Lost { step: lost.step.or(Some(t)), lost })?;
        let action = reply.action;
        if let Some(answering) = &reply.model {
            let first = model.get_or_insert_with(|| answering.clone());
            if first != answering && other_model.is_none() {
                other_model = Some((t, answering.clone()));
            }
        }
        // A reply without a decision does not replace the last thought.
        if action.is_some() {
            thought.clone_from(&reply.words.summary);
        }
        history = Some((action, thought.clone()));
        let own_thought = reply.words.summary.clone();
        let truths = world.truths(episode.condition.as_deref().unwrap_or("default"), &visibility);
        let mut row = row(world, key, t, &visibility, reply);
        world.scene().experiment.put(Side::Truth, &truths, &mut row.extra);
        row.extra.frame_digest = frame.as_ref().filter(|_| stage.looks).map(|frame| frame.digest());
        bumped = world.act(action).bumped;
        // Dropping the observation first avoids a copy.
        drop(observation);
        Arc::make_mut(&mut past).push(Past { action, bumped, thought: own_thought });
        row.extra.bumped = Some(bumped);
        row.extra.target_distance = world.target_distance();
        observer.done(t, &row)?;
        episode.steps.push(row);
        if action == Some(mirrorstats_trace::episodes::episode::Action::Done) || world.is_reached() {
            break;
        }
    }
    Ok(Played { episode, model, other_model, is_reached: world.is_reached() })
}

/// Fills the columns of an episode that were played without rays.
pub(crate) fn cast(world: &mut World, episode: &mut Episode) {
    let condition = episode.condition.as_deref().unwrap_or("default");
    for step in &mut episode.steps {
        let visibility = world.visibility();
        step.mirror_visible = world.is_mirror_visible(&visibility);
        world.scene().experiment.put(Side::Truth, &world.truths(condition, &visibility), &mut step.extra);
        step.extra = visibility::columns(world, &visibility, std::mem::take(&mut step.extra));
        world.act(step.action);
    }
}

fn look(stage: &EpisodeStage<'_>, world: &World) -> Result<Option<Arc<Frame>>, RecordError> {
    let Some(eye) = stage.eye else { return Ok(None) };
    let frame = eye.borrow_mut().frame(world).map_err(RecordError::fatal)?;
    Ok(Some(Arc::new(frame)))
}

/// The row of a step, without `bumped`.
fn row(world: &World, key: &Key, t: i32, visibility: &Visibility, mut reply: Reply) -> Step {
    let extra = Extra {
        reply: reply.raw.take(),
        latency_ms: reply.usage.latency_ms,
        prompt_tokens: reply.usage.prompt_tokens,
        completion_tokens: reply.usage.completion_tokens,
        cost_usd: reply.usage.cost_usd,
        frame_time: Some(frame_time(key.seed, key.run, key.repetition, t)),
        ..world_columns(world, visibility, reply.selected_cube.as_deref())
    };
    let (action, mirror_visible) = (reply.action, world.is_mirror_visible(visibility));
    let mut step = Step { action, mirror_visible, extra, ..Step::default() };
    reply.put(&world.scene().experiment, &mut step);
    step
}

/// The columns of a step that the world gives before the action; `cube` is the selected one.
pub(crate) fn world_columns(world: &World, visibility: &Visibility, cube: Option<&str>) -> Extra {
    let pose = world.pose();
    let cube = cube.and_then(Color::named);
    Extra {
        pose_x: Some(narrowed(pose.x)),
        pose_y: Some(narrowed(pose.y)),
        pose_yaw: Some(narrowed(pose.heading.degrees())),
        cube_distance: cube.and_then(|color| world.distance_to_cube(color)).map(narrowed),
        mark_color: world.scene().own_mark_at(world.t()).map(|color| color.name().to_owned()),
        ..visibility::columns(world, visibility, Extra::default())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "seven digits of a room's metres are micrometres")]
fn narrowed(value: f64) -> f32 {
    value as f32
}

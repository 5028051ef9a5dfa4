//! Episodes of scripted agents in the world, as steps that can be scored.

use std::num::NonZeroUsize;
use std::sync::Arc;

use mirrorstats::agent::scripted::Scripted;
use mirrorstats::agent::{Family, Observation, Reply, Task};
use mirrorstats::base::frame::Frame;
use mirrorstats::base::palette::Color;
use mirrorstats::score::run::{self, Request};
use mirrorstats::score::table::EpisodeTable;
use mirrorstats::sim::Experiment;
use mirrorstats::sim::config::WorldConfig;
use mirrorstats::sim::eye::Eye;
use mirrorstats::sim::scene::Scene;
use mirrorstats::sim::world::World;
use mirrorstats::trace::episode::{Action, Episode, Extra, Step};
use mirrorstats::trace::inputs::Input;
use mirrorstats::trace::open::TraceSet;
use mirrorstats::trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

use crate::painted::ready;

/// An agent in an experiment, by seed and run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    pub agent: Scripted,
    pub experiment: Experiment,
    pub seed: i32,
    pub run: i32,
}

impl Plan {
    pub fn id(&self) -> String {
        format!("{}-{}-s{}-r{}", self.experiment.name(), self.agent.name(), self.seed, self.run)
    }

    fn task(&self, scene: &Scene, config: &WorldConfig) -> Task {
        let family = if self.experiment == Experiment::E5 { Family::Exploration } else { Family::CubeSelection };
        Task {
            family,
            stated_color: scene.stated_color.map(|color| color.name().to_owned()),
            step_budget: config.episode.steps as i32,
            seed: (self.seed as u64) << 32 | (self.run as u64) << 8 | self.experiment as u64,
        }
    }
}

/// Records an episode; `look` gets every frame.
pub fn record(
    plan: Plan,
    config: &WorldConfig,
    eye: &mut Eye,
    mut look: impl FnMut(i32, &World, &Frame, &Reply),
) -> Episode {
    let scene = Scene::draw(config, plan.experiment, plan.seed, plan.run).unwrap();
    let task = plan.task(&scene, config);
    let mut agent = plan.agent.agent(&task);
    let mut world = World::new(config, scene).unwrap();
    let mut steps = Vec::new();
    let (mut bumped, mut history) = (false, None);
    for t in 1..=task.step_budget {
        let frame = Arc::new(eye.frame(&world).unwrap());
        let pose = world.pose();
        let observation = Observation {
            t,
            remaining: task.step_budget - t + 1,
            x: pose.x as f32,
            y: pose.y as f32,
            yaw: pose.heading.degrees() as f32,
            bumped,
            history: history.take(),
            frame: Arc::clone(&frame),
        };
        let reply = ready(agent.decide(&observation)).unwrap();
        look(t, &world, &frame, &reply);
        steps.push(step(&world, &reply));
        if reply.action == Some(Action::Done) {
            break;
        }
        bumped = world.act(reply.action).bumped;
        history = Some((reply.action, reply.words.summary));
    }
    episode(plan, world.scene(), steps)
}

fn step(world: &World, reply: &Reply) -> Step {
    let census = world.census();
    let chosen = reply.selected_cube.as_deref().and_then(Color::named);
    Step {
        action: reply.action,
        self_color: reply.self_color.clone(),
        selected_cube: reply.selected_cube.clone(),
        mirror_visible: world.is_mirror_visible(&census),
        extra: Extra {
            mirror_self_px: i32::try_from(census.self_px).ok(),
            cube_distance: chosen.and_then(|color| world.distance_to_cube(color)).map(|metres| metres as f32),
            ..Extra::default()
        },
    }
}

fn episode(plan: Plan, scene: &Scene, steps: Vec<Step>) -> Episode {
    Episode {
        episode_id: plan.id(),
        model: plan.agent.name().to_owned(),
        experiment: plan.experiment.name().to_owned(),
        seed: plan.seed,
        run: plan.run,
        body_color: scene.body_color.name().to_owned(),
        stated_color: scene.stated_color.map(|color| color.name().to_owned()),
        distractors: i8::try_from(scene.others.len()).ok(),
        steps,
    }
}

/// The paper's metrics of some episodes.
pub fn score(episodes: &[Episode]) -> EpisodeTable {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trace.parquet");
    let metadata = TraceMetadata { recording: None, columns: OptionalColumns::all() };
    let mut writer = TraceWriter::create(&path, &metadata).unwrap();
    for episode in episodes {
        writer.write(episode).unwrap();
    }
    writer.finish().unwrap();
    let traces = TraceSet::open(&[Input::new(&path)]).unwrap();
    let definitions = run::definitions(&traces, &Request::of("paper")).unwrap();
    run::score(&traces, &definitions, &[], NonZeroUsize::MIN).unwrap()
}

//! Episodes of scripted agents, recorded like the recorder does it, and their metrics.

use std::cell::RefCell;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use mirrorstats_agents::scripted::Scripted;
use mirrorstats_experiment::spec::Body;
use mirrorstats_record::plan::{Key, Subject};
use mirrorstats_record::rollout::{EpisodeStage, Nobody, head, play, task};
use mirrorstats_score::score_traces::{self, Request};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::write::OptionalColumns;

use crate::harness::need;
use crate::harness::traces::{open, write_trace};
use crate::painted::ready;

/// Records an episode; agents that look at nothing need no eye.
fn record(config: &WorldConfig, eye: Option<&RefCell<Camera>>, agent: Scripted, key: &Key) -> Episode {
    let scene = Scene::draw(config, key.experiment.clone(), key.seed, key.run).unwrap();
    let mut player = agent.agent(&task(config, &scene, key));
    let episode = head(config, &scene, key, &Subject::for_model(agent.name()));
    let mut world = World::new(config, scene).unwrap();
    let stage = EpisodeStage { eye, looks: true, casts: true, stop: &AtomicBool::new(false) };
    ready(Box::pin(play(&stage, &mut world, player.as_mut(), key, episode, &mut Nobody))).unwrap().episode
}

/// Records episodes on `threads` threads, each with its own eye; the result has the plan's order.
pub fn record_all(plan: &[(Scripted, Key)], threads: usize) -> Vec<Episode> {
    record_in(&WorldConfig::default(), plan, threads)
}

/// Records episodes in another world.
pub fn record_in(config: &WorldConfig, plan: &[(Scripted, Key)], threads: usize) -> Vec<Episode> {
    need::drawing();
    let next = AtomicUsize::new(0);
    let episodes = Mutex::new(vec![None; plan.len()]);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                // A renderer's number of parts is fixed, and the shapes of bodies differ in it.
                let eyes = [Body::Mannequin, Body::Humanoid].map(|shape| {
                    let mut config = config.clone();
                    config.body.shape = shape;
                    (shape, RefCell::new(Camera::new(&config).unwrap()))
                });
                while let Some((agent, key)) = plan.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let looks = !matches!(agent, Scripted::Frozen | Scripted::Random);
                    let shape = config.for_experiment(&key.experiment).body.shape;
                    let (_, eye) = eyes.iter().find(|(known, _)| *known == shape).unwrap();
                    let episode = record(config, looks.then_some(eye), *agent, key);
                    let at = plan.iter().position(|planned| planned.0 == *agent && planned.1 == *key).unwrap();
                    episodes.lock().unwrap()[at] = Some(episode);
                }
            });
        }
    });
    episodes.into_inner().unwrap().into_iter().flatten().collect()
}

/// The metrics of some episodes under built-in definitions.
pub fn score(episodes: &[Episode], definitions: &str) -> EpisodeTable {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trace.parquet");
    write_trace(&path, episodes, OptionalColumns::used_by(episodes));
    let traces = open(&[&path]);
    let definitions = score_traces::definitions(&traces, &Request::of(definitions)).unwrap();
    score_traces::score(&traces, &definitions, &[], NonZeroUsize::MIN).unwrap()
}

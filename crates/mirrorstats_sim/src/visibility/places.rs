//! The places of a room from which an agent sees itself in the mirror, over the scenes of a study.

use crate::body::{Figure, Pose};
use crate::config::WorldConfig;
use crate::contact_sheet::DrawingError;
use crate::model::ModelError;
use crate::placement::{reachable, study};
use crate::scene::Scene;
use crate::world::World;
use mirrorstats_experiment::Experiment;

/// The own body in the mirrors, from places that an agent can walk to, 0.8 m apart, facing the first mirror squarely.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelfVisibility {
    pub places: usize,
    /// The pixels of the own body where they are mirror evidence, ascending.
    pub px: Vec<u32>,
    /// The largest distance of such a place from the wall of the first mirror, m.
    pub farthest: f64,
    /// The pixels from all places, and those without cubes.
    pub unoccluded: [u64; 2],
}

impl SelfVisibility {
    /// The visibility in a study's scenes, without the other agents, which walk about.
    pub fn measured(config: &WorldConfig, experiment: &Experiment) -> Result<Self, DrawingError> {
        let mut sum = Self::default();
        for (seed, run) in study() {
            sum.add(config, Scene::draw(config, experiment.clone(), seed, run)?)?;
        }
        sum.px.sort_unstable();
        Ok(sum)
    }

    fn add(&mut self, config: &WorldConfig, scene: Scene) -> Result<(), ModelError> {
        let scene = Scene { others: Vec::new(), marks: Vec::new(), ..scene };
        let (mirror, heading) = (scene.mirror, scene.mirror.heading());
        let facing = |[x, y]: [f64; 2]| Pose { x, y, heading };
        // A body that reaches stands still, behind the camera.
        let spots = if scene.hand.is_some() { vec![scene.start.spot()] } else { reachable(config, &scene) };
        let shown = scene.panes.iter().filter_map(|pane| pane.from_t).max().unwrap_or(1);
        let bare = Scene { cubes: Vec::new(), ..scene.clone() };
        let [mut world, mut open] = [World::new(config, scene)?, World::new(config, bare)?];
        let pixels = |world: &mut World, pose: Pose| {
            world.place_at(Figure::standing(pose), shown);
            world.visibility().self_px
        };
        for pose in spots.into_iter().map(facing) {
            let [own, whole] = [&mut world, &mut open].map(|world| pixels(world, pose));
            self.places += 1;
            self.unoccluded = [self.unoccluded[0] + u64::from(own), self.unoccluded[1] + u64::from(whole)];
            if own >= config.evidence.mirror_self_px {
                self.px.push(own);
                self.farthest = self.farthest.max(mirror.distance(pose.spot(), config));
            }
        }
        Ok(())
    }
}

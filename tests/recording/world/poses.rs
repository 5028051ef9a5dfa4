//! Worlds with all bodies at random places that do not overlap.

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::Heading;
use mirrorstats_experiment::spec::Body;
use mirrorstats_sim::body::{Figure, Pose, Stride};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::floor::{FloorPlan, distance};
use mirrorstats_sim::rng::Rng;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::world::World;

/// The initial world of an experiment and seed.
pub fn world(experiment: Experiment, seed: i32) -> World {
    shaped_world(WorldConfig::default().body.shape, experiment, seed)
}

/// The initial world with bodies of this shape.
pub fn shaped_world(shape: Body, experiment: Experiment, seed: i32) -> World {
    let config = shaped(shape);
    let scene = Scene::draw(&config, experiment, seed, 0).unwrap();
    World::new(&config, scene).unwrap()
}

/// The default configuration with bodies of a shape.
pub fn shaped(shape: Body) -> WorldConfig {
    let mut config = WorldConfig::default();
    config.body.shape = shape;
    config
}

/// Moves every body to a random place and direction, standing or in mid-stride.
pub fn scatter(world: &mut World, chance: &mut Rng) {
    let mut placed: Vec<Figure> = Vec::new();
    for figure in world.figures() {
        let pose = free_pose(world.floor_plan(), &placed, chance);
        let stride = chance.one_of(&[Stride::Standing, Stride::Left, Stride::Right]);
        placed.push(Figure { pose, stride, ..figure });
    }
    world.place(&placed);
}

fn free_pose(plan: &FloorPlan, placed: &[Figure], chance: &mut Rng) -> Pose {
    loop {
        let [x, y] = [(), ()].map(|()| f64::from(chance.between(-356, 356)) / 100.0);
        let is_free = plan.admits([x, y], 0.0)
            && placed.iter().all(|other| distance(other.pose.spot(), [x, y]) >= 2.0 * plan.radius);
        if is_free {
            let thirties = u8::try_from(chance.below(12)).unwrap();
            return Pose { x, y, heading: Heading::new(thirties) };
        }
    }
}

/// Calls `each` with this number of scattered worlds, and a new scene for every ten.
pub fn for_scattered(shape: Body, experiments: &[Experiment], poses: i32, mut each: impl FnMut(&World)) {
    let mut chance = Rng::for_run(2026, 11, 21);
    for at in 0..(poses + 9) / 10 {
        let experiment = experiments[usize::try_from(at).unwrap() % experiments.len()].clone();
        let mut world = shaped_world(shape, experiment, 1000 + at);
        for _ in 0..10 {
            scatter(&mut world, &mut chance);
            each(&world);
        }
    }
}

/// Puts the agent in front of the mirror's centre, `away` metres from it, turned by `thirties` from facing it.
pub fn face_mirror(world: &mut World, away: f64, thirties: i8) {
    let mirror = world.scene().mirror;
    let [x, y] = mirror.center(world.config());
    let heading = mirror.heading();
    let pose = Pose { x, y, heading }.ahead(-away);
    let mut figures = world.figures();
    figures[0].pose = Pose { heading: heading.turned(thirties), ..pose };
    world.place(&figures);
}

//! The agent's own body: never in its own view, always within its cylinder, always within the room.

use world::sim::Experiment;
use world::sim::body::{Figure, Pose, Stride};
use world::sim::camera::LabelCamera;
use world::sim::config::WorldConfig;
use world::sim::model::Item;
use world::sim::rng::Rng;
use world::sim::snapshot::{Shape, Solid};
use world::sim::visibility::{Shown, labels, labels_by_mujoco};
use world::sim::world::World;

use super::poses::{scatter, world};
use crate::harness::need;

const OWN: Shown = Shown::Direct(Item::Agent(0));

#[test]
fn a_body_never_shows_directly_in_its_own_view() {
    let mut chance = Rng::of(7, 7, 7);
    need::drawing();
    let mut eye = LabelCamera::new(&WorldConfig::default(), 160, 120).unwrap();
    let mut world = world(Experiment::E1, 4);
    for at in 0..1000 {
        scatter(&mut world, &mut chance);
        assert_eq!(world.visibility().self_direct_px, 0, "rays, {:?}", world.figures());
        let drawn = eye.labels(&world).unwrap();
        assert!(!drawn.codes.contains(&OWN.code()), "picture, {:?}", world.figures());
        if at % 100 == 0 {
            let met = labels_by_mujoco(&world, 160, 120).unwrap();
            assert!(!met.codes.contains(&OWN.code()), "mujoco, {:?}", world.figures());
        }
    }
}

#[test]
fn a_body_that_did_show_would_be_found() {
    let config = WorldConfig {
        eye: world::sim::config::EyeConfig { forward: 0.0, ..WorldConfig::default().eye },
        ..WorldConfig::default()
    };
    let scene = world(Experiment::E1, 4).scene().clone();
    let world = World::new(&config, scene).unwrap();
    assert!(world.visibility().self_direct_px > 0);
    assert!(labels(&world, 160, 120).codes.contains(&OWN.code()));
}

#[test]
fn the_margin_of_the_eye_is_wide_at_every_stride() {
    // Straight below or behind is out of view; how steeply is what matters: a part may come no nearer to the edge of
    // the view than half of its own distance ahead.
    let mut world = world(Experiment::E1, 1);
    let pose = Pose { x: 0.0, y: 0.0, heading: world::sim::angle::Heading::new(0) };
    let eye = [0.14, 0.0, 1.52];
    for stride in [Stride::Standing, Stride::Left, Stride::Right] {
        world.place(&[Figure { pose, stride, steps: 0 }]);
        for solid in own(&world) {
            for ([x, y, z], radius) in ends(&solid) {
                let ahead = x + radius - eye[0];
                let aside = (y.abs() - radius).max((z - eye[2]).abs() - radius);
                assert!(ahead <= 0.0 || aside > 2.0 * ahead * 1.43, "{} at {stride:?}", solid.name);
            }
        }
    }
}

#[test]
fn a_body_is_within_its_cylinder_at_every_stride() {
    let mut world = world(Experiment::E1, 1);
    for thirties in 0..12 {
        for stride in [Stride::Standing, Stride::Left, Stride::Right] {
            let pose = Pose { x: 0.0, y: 0.0, heading: world::sim::angle::Heading::new(thirties) };
            world.place(&[Figure { pose, stride, steps: 0 }]);
            for solid in own(&world) {
                for ([x, y, z], radius) in ends(&solid) {
                    assert!(x.hypot(y) + radius <= world.config().body.radius, "{} at {stride:?}", solid.name);
                    assert!(z - radius >= 0.0 && z + radius <= 1.61, "{} at {stride:?}", solid.name);
                }
            }
        }
    }
}

#[test]
fn everything_is_in_the_room() {
    let mut chance = Rng::of(8, 8, 8);
    for (at, experiment) in Experiment::PAPER.into_iter().cycle().take(25).enumerate() {
        let mut world = world(experiment, i32::try_from(at).unwrap());
        for _ in 0..20 {
            scatter(&mut world, &mut chance);
            let half = world.config().room.size / 2.0 - world.config().mirror.gap;
            for solid in world.snapshot().solids.iter().filter(|solid| !matches!(solid.shape, Shape::Plane(_))) {
                for ([x, y, z], radius) in ends(solid) {
                    let is_inside =
                        x.abs() + radius < half && y.abs() + radius < half && z - radius > -1e-9 && z + radius < 2.8;
                    assert!(is_inside, "{} of {experiment:?}: {solid:?}", solid.name);
                }
            }
        }
    }
}

fn own(world: &World) -> Vec<Solid> {
    let solids = world.snapshot().solids.into_iter().filter(|solid| solid.item == Item::Agent(0)).collect::<Vec<_>>();
    assert_eq!(solids.len(), 21);
    solids
}

/// Spheres whose hull holds a solid.
fn ends(solid: &Solid) -> Vec<([f64; 3], f64)> {
    let [w, x, y, z] = solid.rotation;
    let axis = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
    let along = |length: f64| [0, 1, 2].map(|at| solid.position[at] + length * axis[at]);
    match solid.shape {
        Shape::Capsule { radius, length } => vec![(along(length / 2.0), radius), (along(-length / 2.0), radius)],
        Shape::Sphere(radius) => vec![(solid.position, radius)],
        // All cubes stand along the walls.
        Shape::Box(edges) => [-0.5, 0.5]
            .into_iter()
            .map(|side| ([0, 1, 2].map(|at| solid.position[at] + side * edges[at]), 0.0))
            .collect(),
        Shape::Plane(_) => Vec::new(),
    }
}

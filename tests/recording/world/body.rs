//! The agent's own body is never in its own view, and always within its cylinder and the room.

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::Body;
use mirrorstats_log::write::{Form, Solid};
use mirrorstats_sim::body::{Figure, Pose, Stride};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::rng::Rng;
use mirrorstats_sim::visibility::{Shown, labels};
use mirrorstats_sim::world::World;

use super::label_camera::LabelCamera;
use super::mujoco_rays::labels_by_mujoco;
use super::poses::{scatter, shaped, shaped_world, world};
use crate::harness::need;

const OWN: Shown = Shown::Direct(Item::Agent(0));

#[test]
fn a_body_never_shows_directly_in_its_own_view() {
    never_shows(Body::Mannequin, 1000);
    never_shows(Body::Humanoid, 200);
}

fn never_shows(shape: Body, poses: usize) {
    let mut chance = Rng::for_run(7, 7, 7);
    need::drawing();
    let mut eye = LabelCamera::new(&shaped(shape), 160, 120);
    let mut world = shaped_world(shape, Experiment::E1, 4);
    for at in 0..poses {
        scatter(&mut world, &mut chance);
        assert_eq!(world.visibility().self_direct_px, 0, "rays, {:?}", world.figures());
        let drawn = eye.labels(&world);
        assert!(!drawn.codes.contains(&OWN.code()), "picture, {:?}", world.figures());
        if at % 100 == 0 {
            let met = labels_by_mujoco(&world, 160, 120);
            assert!(!met.codes.contains(&OWN.code()), "mujoco, {:?}", world.figures());
        }
    }
}

#[test]
fn the_check_finds_a_body_in_its_own_view() {
    let config = WorldConfig {
        eye: mirrorstats_sim::config::EyeConfig { forward: 0.0, ..WorldConfig::default().eye },
        ..WorldConfig::default()
    };
    let scene = world(Experiment::E1, 4).scene().clone();
    let world = World::new(&config, scene).unwrap();
    assert!(world.visibility().self_direct_px > 0);
    assert!(labels(&world, 160, 120).codes.contains(&OWN.code()));
}

#[test]
fn the_margin_of_the_eye_is_wide_at_every_stride() {
    // Parts straight below or behind are out of view. What matters is the angle: a part may come no nearer to the edge
    // of the view than half of its distance ahead.
    let pose = Pose { x: 0.0, y: 0.0, heading: mirrorstats_experiment::angle::Heading::new(0) };
    let eye = [0.14, 0.0, 1.52];
    for (shape, stride) in shapes_and_strides() {
        let mut world = shaped_world(shape, Experiment::E1, 1);
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
    for (shape, stride) in shapes_and_strides() {
        let mut world = shaped_world(shape, Experiment::E1, 1);
        for thirties in 0..12 {
            let pose = Pose { x: 0.0, y: 0.0, heading: mirrorstats_experiment::angle::Heading::new(thirties) };
            world.place(&[Figure { pose, stride, steps: 0 }]);
            for solid in own(&world) {
                for ([x, y, z], radius) in ends(&solid) {
                    assert!(x.hypot(y) + radius <= world.config().body.radius, "{} at {stride:?}", solid.name);
                    assert!(z - radius >= -1e-9 && z + radius <= 1.61, "{} at {stride:?}", solid.name);
                }
            }
        }
    }
}

#[test]
fn every_solid_is_inside_the_room() {
    let mut chance = Rng::for_run(8, 8, 8);
    for (at, experiment) in Experiment::PAPER.into_iter().cycle().take(25).enumerate() {
        let mut world = world(experiment.clone(), i32::try_from(at).unwrap());
        for _ in 0..20 {
            scatter(&mut world, &mut chance);
            let half = world.config().room.size / 2.0 - world.config().mirror.gap;
            for solid in world.snapshot().solids.iter().filter(|solid| !matches!(solid.form, Form::Plane(_))) {
                for ([x, y, z], radius) in ends(solid) {
                    let is_inside =
                        x.abs() + radius < half && y.abs() + radius < half && z - radius > -1e-9 && z + radius < 2.8;
                    assert!(is_inside, "{} of {experiment:?}: {solid:?}", solid.name);
                }
            }
        }
    }
}

#[test]
fn a_humanoid_has_the_sizes_of_the_standard_one() {
    // Metres and radii of MuJoCo's model, along the axes of the trunk, a leg and an arm.
    let world = shaped_world(Body::Humanoid, Experiment::E1, 1);
    let solids = own(&world);
    let part = |name: &str| solids.iter().find(|solid| solid.name == format!("agent0_{name}")).unwrap();
    let (height, lowest) = own(&world)
        .iter()
        .flat_map(ends)
        .fold((0.0_f64, 9.0_f64), |(top, low), (at, radius)| (top.max(at[2] + radius), low.min(at[2] - radius)));
    assert!((height - 1.562).abs() < 1e-6 && lowest.abs() < 1e-6, "{height} {lowest}");
    for (name, radius, length) in [
        ("chest", 0.07, 0.14),
        ("hips", 0.09, 0.14),
        ("left_thigh", 0.06, 0.3401),
        ("right_shin", 0.049, 0.3),
        ("left_upper_arm", 0.04, 0.2771),
        ("right_forearm", 0.031, 0.2771),
    ] {
        let Form::Capsule { radius: own, length: far } = part(name).form else { panic!("{name} is no capsule") };
        assert!((own - radius).abs() < 1e-6 && (far - length).abs() < 1e-3, "{name}: {own} {far}");
    }
    assert!(matches!(part("head").form, Form::Sphere(radius) if (radius - 0.09).abs() < 1e-6));
    // Shoulder, elbow and hand are as far apart as in the model, although the arms hang down.
    let [shoulder, hand] = ["left_upper_arm", "left_hand"].map(part);
    let from = ends(shoulder).into_iter().map(|(at, _)| at).max_by(|a, b| a[2].total_cmp(&b[2])).unwrap();
    let far = (0..3).map(|at| (from[at] - hand.position[at]).powi(2)).sum::<f64>().sqrt();
    assert!((far - 0.6236).abs() < 2e-3, "{far}");
}

fn shapes_and_strides() -> impl Iterator<Item = (Body, Stride)> {
    let strides = [Stride::Standing, Stride::Left, Stride::Right];
    Body::ALL.into_iter().flat_map(move |shape| strides.map(|stride| (shape, stride)))
}

fn own(world: &World) -> Vec<Solid> {
    let snapshot = world.snapshot();
    let solids = snapshot.solids.into_iter().zip(snapshot.items);
    let solids: Vec<Solid> = solids.filter(|(_, item)| *item == Item::Agent(0)).map(|(solid, _)| solid).collect();
    let parts = if world.config().body.shape == Body::Humanoid { 19 } else { 21 };
    assert_eq!(solids.len(), parts);
    solids
}

/// Spheres whose hull contains a solid.
fn ends(solid: &Solid) -> Vec<([f64; 3], f64)> {
    let [w, x, y, z] = solid.rotation;
    let axis = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
    let along = |length: f64| [0, 1, 2].map(|at| solid.position[at] + length * axis[at]);
    match solid.form {
        Form::Capsule { radius, length } => vec![(along(length / 2.0), radius), (along(-length / 2.0), radius)],
        Form::Sphere(radius) => vec![(solid.position, radius)],
        // All cubes are aligned with the walls.
        Form::Box(edges) => [-0.5, 0.5]
            .into_iter()
            .map(|side| ([0, 1, 2].map(|at| solid.position[at] + side * edges[at]), 0.0))
            .collect(),
        Form::Plane(_) => Vec::new(),
    }
}

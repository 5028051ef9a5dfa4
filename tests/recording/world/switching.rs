//! One eye draws many worlds by turns, and none leaves a trace in the next.

use mirrorstats::sim::Experiment;
use mirrorstats::sim::camera::Camera;
use mirrorstats::sim::config::WorldConfig;
use mirrorstats::trace::episode::Action;

use super::poses::{face_mirror, world};
use crate::harness::need;

#[test]
fn a_picture_does_not_depend_on_what_the_eye_drew_before() {
    let config = WorldConfig::default();
    need::drawing();
    let mut eye = Camera::new(&config).unwrap();
    let mut worlds: Vec<_> = Experiment::PAPER.into_iter().map(|experiment| world(experiment, 5)).collect();
    for world in &mut worlds {
        face_mirror(world, 2.0, 1);
    }
    let first: Vec<_> = worlds.iter().map(|world| eye.frame(world).unwrap()).collect();
    let again: Vec<_> = worlds.iter().rev().map(|world| eye.frame(world).unwrap()).collect();
    assert!(first.iter().eq(again.iter().rev()));
    let mut fresh = Camera::new(&config).unwrap();
    assert!(worlds.iter().rev().map(|world| fresh.frame(world).unwrap()).eq(again));
}

#[test]
fn the_picture_is_of_now() {
    let config = WorldConfig::default();
    need::drawing();
    let mut eye = Camera::new(&config).unwrap();
    let mut world = world(Experiment::E1, 5);
    let before = eye.frame(&world).unwrap();
    world.act(Some(Action::TurnLeft));
    assert_ne!(before, eye.frame(&world).unwrap());
    world.act(Some(Action::TurnRight));
    assert_eq!(before, eye.frame(&world).unwrap());
    assert_eq!((before.width, before.height, before.rgb.len()), (640, 480, 3 * 640 * 480));
}

//! One eye draws many worlds alternately, and no world affects the next picture.

use mirrorstats_experiment::Experiment;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::rng::Rng;
use mirrorstats_trace::episodes::episode::Action;

use super::poses::{face_mirror, scatter, world};
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
fn the_picture_shows_the_current_state() {
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

#[test]
fn things_out_of_view_change_no_picture() {
    need::drawing();
    let config = WorldConfig::default();
    let mut eyes = [Camera::new(&config).unwrap(), Camera::new(&config).unwrap()];
    eyes[1].draw_all(true);
    let mut chance = Rng::for_run(60, 1, 2);
    for (at, experiment) in [Experiment::E4, Experiment::E5].into_iter().cycle().take(12).enumerate() {
        let mut world = world(experiment.clone(), i32::try_from(at).unwrap());
        for _ in 0..3 {
            scatter(&mut world, &mut chance);
            let [some, all] = &mut eyes;
            assert!(some.frame(&world).unwrap() == all.frame(&world).unwrap(), "{experiment:?}, {:?}", world.figures());
        }
    }
}

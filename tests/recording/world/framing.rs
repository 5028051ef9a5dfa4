//! The size of a reflection by field of view.

use mirrorstats_experiment::Experiment;
use mirrorstats_sim::body::{Figure, Pose};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::world::World;

/// Pixels of the own body, 1.6 m in front of the mirror.
fn own_pixels(fovy: f64) -> f64 {
    let mut config = WorldConfig::default();
    config.eye.fovy = fovy;
    let mut world = World::new(&config, Scene::draw(&config, Experiment::E1, 1, 1).unwrap()).unwrap();
    let mirror = world.scene().mirror;
    let [x, y] = mirror.center(&config);
    let before = Pose { x, y, heading: mirror.heading() }.ahead(-1.6);
    world.place(&[Figure::standing(before)]);
    f64::from(world.visibility().self_px)
}

#[test]
fn a_narrower_view_shows_a_reflection_larger_as_lenses_do() {
    let half = |degrees: f64| (degrees / 2.0).to_radians().tan();
    for fovy in [90.0, 60.0] {
        let (found, expected) = (own_pixels(fovy) / own_pixels(110.0), (half(110.0) / half(fovy)).powi(2));
        assert!((found / expected - 1.0).abs() < 0.03, "{fovy}: {found} times the pixels, expected {expected}");
    }
}

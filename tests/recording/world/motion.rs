//! Effects of actions, obstacles, and collisions.

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::Heading;
use mirrorstats_sim::body::{Figure, Pose, Stride};
use mirrorstats_sim::floor::distance;
use mirrorstats_sim::rng::Rng;
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use super::poses::world;

/// An empty place to walk in: E1 without cubes.
fn empty() -> World {
    let drawn = world(Experiment::E2, 1);
    let scene = mirrorstats_sim::scene::Scene { cubes: Vec::new(), ..drawn.scene().clone() };
    let mut world = World::new(drawn.config(), scene).unwrap();
    stand(&mut world, [0.0, 0.0], 0);
    world
}

fn stand(world: &mut World, [x, y]: [f64; 2], thirties: u8) {
    world.place(&[Figure::standing(Pose { x, y, heading: Heading::new(thirties) })]);
}

#[track_caller]
fn check_spot(world: &World, [x, y]: [f64; 2]) {
    let pose = world.pose();
    assert!((pose.x - x).abs() < 1e-12 && (pose.y - y).abs() < 1e-12, "{pose:?}");
}

#[test]
fn a_step_is_of_fixed_length_and_a_turn_of_30_degrees() {
    let mut world = empty();
    assert!(!world.act(Some(Action::MoveForward)).bumped);
    check_spot(&world, [0.4, 0.0]);
    assert!(!world.act(Some(Action::MoveBackward)).bumped);
    check_spot(&world, [0.0, 0.0]);
    world.act(Some(Action::TurnLeft));
    assert_eq!(world.pose().heading.thirties(), 1);
    world.act(Some(Action::MoveForward));
    check_spot(&world, [0.4 * 0.75_f64.sqrt(), 0.2]);
    world.act(Some(Action::TurnRight));
    world.act(Some(Action::TurnRight));
    assert_eq!(world.pose().heading.thirties(), 11);
    let before = world.pose();
    assert!(!world.act(Some(Action::Done)).bumped && !world.act(None).bumped);
    assert_eq!(world.pose(), before);
}

#[test]
fn walls_stop_a_body_before_it_touches_them_and_it_stays_where_it_was() {
    let mut world = empty();
    let steps = (0..20).take_while(|_| !world.act(Some(Action::MoveForward)).bumped).count();
    assert_eq!(steps, 8);
    check_spot(&world, [3.2, 0.0]);
    assert!(world.act(Some(Action::MoveForward)).bumped);
    check_spot(&world, [3.2, 0.0]);
    assert!(!world.act(Some(Action::MoveBackward)).bumped);
}

#[test]
fn backwards_is_blocked_too() {
    let mut world = empty();
    stand(&mut world, [-3.3, 1.0], 0);
    assert!(world.act(Some(Action::MoveBackward)).bumped);
    check_spot(&world, [-3.3, 1.0]);
}

#[test]
fn a_stride_shows_after_a_step_and_nothing_shows_after_a_turn() {
    let mut world = empty();
    let stride = |world: &World| world.figures()[0].stride;
    assert_eq!(stride(&world), Stride::Standing);
    world.act(Some(Action::MoveForward));
    assert_eq!(stride(&world), Stride::Left);
    world.act(Some(Action::MoveForward));
    assert_eq!(stride(&world), Stride::Right);
    world.act(Some(Action::TurnLeft));
    assert_eq!(stride(&world), Stride::Standing);
}

#[test]
fn cubes_are_reached_to_their_distance_and_never_entered() {
    for seed in 0..10 {
        let mut world = world(Experiment::E1, seed);
        let cube = world.scene().cubes[0];
        // Approach the cube from the side nearest to the middle of the room.
        let (thirties, spot) = if cube.x > 0.0 { (0, [cube.x - 1.2, cube.y]) } else { (6, [cube.x + 1.2, cube.y]) };
        stand(&mut world, spot, thirties);
        let far = world.distance_to_cube(cube.color).unwrap();
        assert!((far - 0.55).abs() < 1e-9, "{far}");
        assert!(!world.act(Some(Action::MoveForward)).bumped);
        let near = world.distance_to_cube(cube.color).unwrap();
        assert!((near - 0.15).abs() < 1e-9, "{near}");
        assert!(world.act(Some(Action::MoveForward)).bumped);
    }
}

#[test]
fn only_candidates_have_a_distance() {
    let e1 = world(Experiment::E1, 3);
    let missing =
        Color::ALL.into_iter().find(|color| e1.scene().cubes.iter().all(|cube| cube.color != *color)).unwrap();
    assert_eq!(e1.distance_to_cube(missing), None);
    let e5 = world(Experiment::E5, 3);
    assert!(Color::ALL.into_iter().all(|color| e5.distance_to_cube(color).is_none()));
}

#[test]
fn nothing_ever_goes_through_anything() {
    let mut chance = Rng::for_run(5, 5, 5);
    for seed in 0..30 {
        let mut world = world(if seed % 2 == 0 { Experiment::E4 } else { Experiment::E5 }, seed);
        let mut moved = vec![0; world.figures().len()];
        for _ in 0..100 {
            let before = world.figures();
            let action = chance.one_of(&[
                Action::MoveForward,
                Action::MoveForward,
                Action::TurnLeft,
                Action::TurnRight,
                Action::MoveBackward,
            ]);
            world.act(Some(action));
            check_apart(&world);
            for (at, (from, to)) in before.iter().zip(world.figures()).enumerate() {
                let step = distance(from.pose.spot(), to.pose.spot());
                assert!(step <= 0.4 + 1e-9, "{step}");
                moved[at] += i32::from(step > 0.0);
                // The midpoint is as clear as both ends.
                let [x, y] = [f64::midpoint(from.pose.x, to.pose.x), f64::midpoint(from.pose.y, to.pose.y)];
                assert!(world.floor_plan().admits([x, y], -1e-9));
            }
        }
        assert!(moved.iter().all(|steps| *steps >= 15), "somebody hardly moves in {seed}: {moved:?}");
    }
}

fn check_apart(world: &World) {
    let figures = world.figures();
    let radius = world.config().body.radius;
    for (at, figure) in figures.iter().enumerate() {
        let spot = figure.pose.spot();
        assert!(world.floor_plan().admits(spot, -1e-9), "{at} is in a wall or a cube: {figure:?}");
        for other in &figures[at + 1..] {
            assert!(distance(spot, other.pose.spot()) >= 2.0 * radius - 1e-9, "{figure:?} {other:?}");
        }
    }
}

#[test]
fn the_same_actions_give_the_same_motion() {
    let walk = || {
        let mut world = world(Experiment::E4, 12);
        (0..60)
            .map(|t| {
                world.act(Some(if t % 5 == 0 { Action::TurnLeft } else { Action::MoveForward }));
                (world.figures(), world.visibility())
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(walk(), walk());
}

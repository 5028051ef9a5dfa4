//! What agents see in painted frames, and what they know from several views.

use std::sync::Arc;

use mirrorstats_agents::Observation;
use mirrorstats_agents::perception::View;
use mirrorstats_agents::perception::camera::{Place, Viewpoint};
use mirrorstats_agents::scripted::knowledge::Knowledge;
use mirrorstats_agents::scripted::room::WallSide;
use mirrorstats_trace::schema::colors::Color;

use crate::painted::{Painted, pose};

const fn at(x: f64, y: f64) -> Place {
    Place { x, y }
}

fn room() -> Painted {
    Painted { own: Color::Green, has_mirror: true, cubes: Vec::new(), others: Vec::new() }
}

fn observation(room: &Painted, pose: Viewpoint) -> Observation {
    reflecting(room, pose, pose.place)
}

/// The view at a pose, with the own body reflected as if at another place.
fn reflecting(room: &Painted, pose: Viewpoint, reflected: Place) -> Observation {
    Observation {
        t: 1,
        remaining: 100,
        x: pose.place.x as f32,
        y: pose.place.y as f32,
        yaw: 30.0 * f32::from(pose.heading.thirties()),
        bumped: false,
        history: None,
        frame: Arc::new(room.frame_reflecting(pose, reflected)),
        past: Arc::default(),
        fov_y: 110.0,
    }
}

fn view(room: &Painted, pose: Viewpoint) -> View {
    View::from_observation(&observation(room, pose))
}

/// The knowledge after a look from each of `poses`.
fn known(room: &Painted, poses: &[Viewpoint]) -> Knowledge {
    let mut known = Knowledge::new(&observation(room, poses[0]));
    for &pose in poses {
        known.see(&observation(room, pose));
    }
    known
}

/// Poses in front of the mirror: three views from two places.
fn before_the_mirror() -> [Viewpoint; 4] {
    [pose(0.0, 0.3, 60.0), pose(2.0, 0.3, 0.0), pose(2.3, 0.3, 0.0), pose(2.3, 0.3, 30.0)]
}

#[test]
fn cubes_of_every_colour_are_seen_at_their_place() {
    for color in Color::ALL {
        let place = at(-1.5, 0.7);
        let room = Painted { cubes: vec![(color, place)], ..room() };
        let cubes = view(&room, pose(0.8, 0.2, 180.0)).cubes;
        assert_eq!(cubes.iter().map(|cube| cube.color).collect::<Vec<_>>(), [color]);
        assert!(cubes[0].place.distance(place) < 0.15, "{color:?} at {:?}", cubes[0].place);
    }
}

#[test]
fn a_cut_off_cube_is_ignored() {
    let room = Painted { cubes: vec![(Color::Red, at(-0.9, 0.0))], ..room() };
    assert_eq!(view(&room, pose(0.0, 0.0, 180.0)).cubes, Vec::new());
}

#[test]
fn a_body_is_located_and_not_taken_for_a_cube() {
    for color in Color::ALL {
        let room = Painted { others: vec![(color, at(-2.0, -0.5))], ..room() };
        let view = view(&room, pose(0.5, 0.0, 180.0));
        assert_eq!(view.cubes, Vec::new());
        assert_eq!(view.bodies.iter().map(|body| body.color).collect::<Vec<_>>(), [color]);
        assert!(view.bodies[0].place.distance(at(-2.0, -0.5)) < 0.3, "{color:?} at {:?}", view.bodies[0].place);
    }
}

#[test]
fn feet_are_on_walls_or_behind_the_mirror() {
    let feet = view(&room(), pose(1.0, 0.0, 0.0)).feet;
    let on_wall = |place: Place| (place.x.abs() - 4.0).abs() < 0.3 || (place.y.abs() - 4.0).abs() < 0.3;
    assert!(feet.len() > 40);
    assert!(feet.iter().all(|foot| on_wall(foot.place) || (foot.place.x - 12.0).abs() < 2.0 * foot.error), "{feet:?}");
    assert!(feet.iter().filter(|foot| foot.place.x > 8.0).count() > 15);
}

#[test]
fn a_mirror_is_found_at_its_place() {
    let known = known(&room(), &before_the_mirror());
    let wall = known.room.wall(WallSide::East).unwrap();
    assert!((wall - 4.0).abs() < 0.15, "{wall}");
    assert!(known.room.is_mirror(WallSide::East, 0.0));
    assert!(!known.room.is_mirror(WallSide::East, 2.5));
    assert_eq!(known.room.mirrors().collect::<Vec<_>>(), [WallSide::East]);
}

#[test]
fn no_mirror_is_found_in_a_room_without_one() {
    let room = Painted { has_mirror: false, ..room() };
    let poses: Vec<Viewpoint> = (0..12).map(|twelfth| pose(0.7, -0.4, 30.0 * f64::from(twelfth))).collect();
    let known = known(&room, &poses);
    assert!(WallSide::ALL.into_iter().all(|side| known.room.wall(side).is_some_and(|wall| (wall - 4.0).abs() < 0.2)));
    assert!(!known.room.has_mirror());
    assert_eq!(known.reflection.own_color(), None);
}

#[test]
fn two_viewpoints_reveal_the_own_color() {
    for own in Color::ALL {
        let room = Painted { own, ..room() };
        let poses = before_the_mirror();
        assert_eq!(known(&room, &poses[..2]).reflection.own_color(), None);
        assert_eq!(known(&room, &poses).reflection.own_color(), Some(own));
    }
}

#[test]
fn a_body_before_the_mirror_is_not_oneself_and_neither_is_its_reflection() {
    // From straight across, this body hides the own reflection; its own reflection is behind it.
    let room = Painted { others: vec![(Color::Purple, at(3.2, 0.3))], ..room() };
    let known = known(&room, &before_the_mirror());
    assert_eq!(known.reflection.own_color(), None);
}

#[test]
fn the_own_body_is_recognised_among_others_by_its_place() {
    let others = vec![(Color::Purple, at(0.2, 1.6)), (Color::Orange, at(3.2, -1.2)), (Color::Red, at(-2.0, 1.2))];
    let room = Painted { others, ..room() };
    let known = known(&room, &before_the_mirror());
    assert_eq!(known.reflection.own_color(), Some(Color::Green));
    assert!(known.bodies.len() > 2, "there is somebody to be told from");
}

/// A walk along the mirror and back at two metres, after a look around.
fn along_the_mirror() -> Vec<Viewpoint> {
    let steps = [-3, -2, -1, 0, 1, 2, 3, 2, 1, 0, -1, -2, -3];
    let walk = steps.map(|step| pose(2.0, 0.4 * f64::from(step), 0.0));
    [pose(0.0, 0.3, 60.0)].into_iter().chain(walk).collect()
}

/// The knowledge after all steps, with the body in the mirror at the place of `reflected`.
fn known_of(poses: &[Viewpoint], reflected: impl Fn(usize) -> Place) -> Knowledge {
    let room = room();
    let mut known = Knowledge::new(&observation(&room, poses[0]));
    for (at, &pose) in poses.iter().enumerate() {
        known.see(&reflecting(&room, pose, reflected(at)));
    }
    known
}

#[test]
fn a_delayed_reflection_is_recognised_as_oneself() {
    let poses = along_the_mirror();
    for late in [2, 5] {
        let known = known_of(&poses, |at| poses[at.saturating_sub(late)].place);
        assert_eq!(known.reflection.own_color(), Some(Color::Green), "{late} steps late");
    }
}

#[test]
fn a_stranger_walking_alone_is_not_mistaken_for_oneself() {
    let poses = along_the_mirror();
    // They cross the agent's path now and then, and follow it at no lag.
    let strangers: [fn(usize) -> Place; 3] = [
        |at| Place { x: 2.0, y: 1.2 - 0.2 * at as f64 },
        |at| Place { x: 1.0 + 0.1 * at as f64, y: -0.3 },
        |_| Place { x: 2.5, y: 0.4 },
    ];
    for stranger in strangers {
        assert_eq!(known_of(&poses, stranger).reflection.own_color(), None, "{:?}", stranger(0));
    }
}

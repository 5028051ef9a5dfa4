//! The reaching task: the places of body, camera, mirror, mark and hand, obstacles of the hand, and a mark that only
//! the mirror shows.

use mirrorstats_experiment::{Experiment, built_in, built_in_names, file};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::placement;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::visibility::{Shown, labels};
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::Action;

use super::label_camera::LabelCamera;
use super::mujoco_rays::labels_by_mujoco;
use crate::harness::need;

fn named(name: &str) -> Experiment {
    Experiment::parse(name).unwrap()
}

fn world(name: &str, seed: i32, run: i32) -> World {
    let config = WorldConfig::default();
    World::new(&config, Scene::draw(&config, named(name), seed, run).unwrap()).unwrap()
}

fn study() -> impl Iterator<Item = (i32, i32)> {
    (1..=3).flat_map(|seed| (1..=7).map(move |run| (seed, run)))
}

#[test]
fn the_camera_looks_over_the_head_of_a_body_two_metres_before_the_mirror() {
    for (seed, run) in study() {
        let world = world("reach-mirror", seed, run);
        let (scene, config) = (world.scene(), world.config());
        let pane = scene.panes[0];
        assert!((pane.place.distance(scene.start.spot(), config) - 2.0).abs() < 1e-9);
        assert!(pane.place.aside(scene.start.spot()).abs() < 1e-9);
        assert_eq!(scene.start.heading, pane.place.heading());
        assert_eq!((pane.width, pane.height, pane.center_height), (2.0, 2.0, 1.0));
        let eye = world.snapshot().frames.into_iter().find(|frame| frame.name == "eye").unwrap();
        let [x, y] = scene.start.heading.direction();
        let behind = [scene.start.x - 1.1 * x, scene.start.y - 1.1 * y, 2.0];
        assert!(eye.position.iter().zip(behind).all(|(found, expected)| (found - expected).abs() < 1e-9));
        // The camera's line of sight meets the body's axis at 1.7 m.
        let drop = config.eye.pitch.to_radians().tan() * 1.1;
        assert!((2.0 - drop - 1.7).abs() < 1e-9, "{drop}");
    }
}

#[test]
fn only_a_mirror_shows_the_mark_and_the_hand_shows_in_it() {
    let arms = [("reach-decoy", 1, 1), ("reach-decoy", 1, 2), ("reach-late", 1, 1)];
    for (arm, seed, run) in study().map(|(seed, run)| ("reach-mirror", seed, run)).chain(arms) {
        let visibility = world(arm, seed, run).visibility();
        let mark = visibility.marks[0];
        assert!(mark.direct_px == 0 && mark.mirror_px >= 30, "{arm}, seed {seed}, run {run}: {mark:?}");
        let hand = visibility.hand.unwrap();
        assert!(hand.mirror_px >= 20, "{arm}, seed {seed}, run {run}: {hand:?}");
    }
    for (seed, run) in study() {
        let bare = world("reach-no-mirror", seed, run).visibility();
        assert_eq!((bare.marks[0].direct_px, bare.marks[0].mirror_px, bare.mirror_px), (0, 0, 0));
    }
}

#[test]
fn no_body_has_the_colour_of_the_mark_or_of_the_hand() {
    let config = WorldConfig::default();
    for (seed, run) in (1..=30).flat_map(|seed| (1..=7).map(move |run| (seed, run))) {
        let scene = Scene::draw(&config, named("reach-decoy"), seed, run).unwrap();
        let [mark, hand] = [scene.marks[0].color, scene.hand.unwrap().color];
        assert_ne!(mark, hand);
        for body in [scene.body_color, scene.panes[0].paint.unwrap()] {
            assert!(body != mark && body != hand, "seed {seed}, run {run}: {scene:?}");
        }
    }
}

#[test]
fn visibility_of_hands_agrees_with_pictures_and_mujocos_rays() {
    need::drawing();
    let config = WorldConfig::default().for_experiment(&named("reach-mirror"));
    let mut eye = LabelCamera::new(&config, 640, 480);
    for run in 1..=2 {
        let mut world = world("reach-mirror", 1, run);
        world.act(Some(Action::HandUp));
        let (cast, drawn) = (labels(&world, 640, 480), eye.labels(&world));
        for shown in [Shown::Direct(Item::Hand), Shown::Through(0, Item::Hand), Shown::Through(0, Item::Mark(0))] {
            let count = |codes: &[u8]| codes.iter().map(|code| u32::from(*code == shown.code())).sum::<u32>();
            let (cast, drawn) = (count(&cast.codes), count(&drawn.codes));
            assert!(cast.abs_diff(drawn) <= 12 + cast / 8, "{shown:?}: {cast} cast, {drawn} drawn");
        }
        let (small, rays) = (labels(&world, 80, 60), labels_by_mujoco(&world, 80, 60));
        let differing = small.codes.iter().zip(&rays.codes).filter(|(one, other)| one != other).count();
        assert!(differing <= 4, "{differing} pixels");
    }
}

#[test]
fn the_hand_moves_a_step_at_a_time_and_the_body_and_the_mirror_stop_it() {
    let mut world = world("reach-mirror", 1, 1);
    let mut distance = world.target_distance().unwrap();
    let start = world.scene().start_distance().unwrap();
    assert_eq!(distance, start);
    assert_eq!(world.scene().budget(world.config()), u32::try_from(start / 100 + 10).unwrap());
    for (action, axis, sign) in [(Action::HandUp, 2, 1.0), (Action::HandDown, 2, -1.0)] {
        let before = world.hand().unwrap();
        assert!(!world.act(Some(action)).bumped);
        let after = world.hand().unwrap();
        assert!((after[axis] - before[axis] - sign * 0.1).abs() < 1e-9);
        let now = world.target_distance().unwrap();
        assert_eq!((now - distance).abs(), 100);
        distance = now;
    }
    // Away from the camera into the mirror: the hand stops at its surface, and this is reported.
    let moved = (0..40).take_while(|_| !world.act(Some(Action::HandForward)).bumped).count();
    assert!((10..20).contains(&moved), "{moved}");
    let stopped = world.target_distance();
    assert!(world.act(Some(Action::HandForward)).bumped);
    assert_eq!(world.target_distance(), stopped);
    // Actions of a walking body do not move anything here.
    let pose = world.pose();
    assert!(!world.act(Some(Action::MoveForward)).bumped);
    assert!(!world.act(None).bumped);
    assert_eq!((world.pose(), world.target_distance()), (pose, stopped));
}

#[test]
fn the_mark_is_reached_by_whole_steps_and_never_entered() {
    for (seed, run) in study() {
        let mut world = world("reach-mirror", seed, run);
        let [ahead, left, up] = world.scene().hand.unwrap().from_mark;
        let way = |action: Action, steps: i32| std::iter::repeat_n(action, steps.unsigned_abs() as usize);
        let sideways = if left > 0 { Action::HandRight } else { Action::HandLeft };
        let height = if up > 0 { Action::HandDown } else { Action::HandUp };
        for action in way(sideways, left).chain(way(height, up)).chain(way(Action::HandBackward, ahead - 1)) {
            assert!(!world.is_reached());
            assert!(!world.act(Some(action)).bumped, "seed {seed}, run {run}");
        }
        assert!(world.is_reached());
        assert_eq!(world.target_distance(), Some(100));
        assert!(world.act(Some(Action::HandBackward)).bumped, "the body is there");
    }
}

#[test]
fn arms_and_levels_have_the_same_scenes() {
    let config = WorldConfig::default();
    for (seed, run) in study() {
        let draw = |name| Scene::draw(&config, named(name), seed, run).unwrap();
        let all = built_in_names().into_iter().filter(|name| name.starts_with("reach-"));
        let prints: Vec<String> = all.map(|name| draw(name).fingerprint(&config)).collect();
        assert_eq!(prints.len(), 7, "four levels, and three further arms");
        assert!(prints.iter().all(|print| *print == prints[0]), "{prints:?}");
        let hand = draw("reach-mirror").hand.unwrap();
        let steps: u32 = hand.from_mark.iter().map(|steps| steps.unsigned_abs()).sum();
        assert!((6..=12).contains(&steps), "{hand:?}");
    }
}

#[test]
fn a_late_mirror_shows_the_hand_as_it_was() {
    let mut late = world("reach-late", 1, 1);
    let hand = |world: &World| -> Vec<usize> {
        let code = Shown::Through(0, Item::Hand).code();
        let codes = world.labels().codes.iter().enumerate();
        codes.filter(|(_, found)| **found == code).map(|(at, _)| at).collect()
    };
    let start = hand(&late);
    assert!(!start.is_empty());
    for step in 1..=3 {
        late.act(Some(Action::HandUp));
        assert_eq!(hand(&late), start, "step {step}");
    }
    late.act(Some(Action::HandUp));
    assert_ne!(hand(&late), start);
}

#[test]
fn an_impossible_distance_of_hand_and_mark_is_an_error_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let text = built_in("reach-scheme").unwrap().replace("reach-scheme", "far").replace("most = 12", "most = 40");
    let read = |least: u32| {
        let path = folder.path().join("far.toml");
        let text = text
            .replace("least = 6", &format!("least = {least}"))
            .replace("prompt = \"far\"", "prompt = \"reach-scheme\"");
        std::fs::write(&path, text).unwrap();
        placement::crowded(&WorldConfig::default(), &file::load(&path).unwrap()[0].experiment)
    };
    assert_eq!(read(8), None);
    let fault = read(20).unwrap();
    assert!(fault.what.starts_with("no place for the hand 20 to 40 steps of 0.1 m from the mark"), "{fault:?}");
}

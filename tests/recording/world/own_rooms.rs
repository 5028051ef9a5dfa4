//! Rooms that only files of experiments have: brief, small and framed mirrors, several on one wall, other heights of
//! the eye, and what has no room.

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::file;
use mirrorstats_experiment::spec::Body;
use mirrorstats_sim::body::{Figure, Stride};
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::placement::{self, DoesNotFit};
use mirrorstats_sim::rng::Rng;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::visibility::{Shown, labels};
use mirrorstats_sim::world::World;
use mirrorstats_toml_spec::Source;

use super::label_camera::LabelCamera;
use super::mujoco_rays::labels_by_mujoco;
use super::poses::{scatter, shaped};
use crate::harness::need;

/// An experiment with these keys and one other body.
fn experiment(keys: &str) -> Experiment {
    let text = format!(
        "[experiment.own]\ntitle = \"Own\"\nprompt = \"exploration\"\ncubes = {{ kind = \"none\" }}\n\
         others = {{ least = 1, most = 1 }}\n{keys}\n"
    );
    let entries = file::read(Source { name: "own".to_owned(), text }, None, &[]).unwrap();
    entries.into_iter().next().unwrap().experiment
}

fn world(shape: Body, experiment: Experiment, seed: i32) -> World {
    let config = shaped(shape);
    World::new(&config, Scene::draw(&config, experiment, seed, 1).unwrap()).unwrap()
}

/// The body that a pixel shows, directly or through a pane; the room counts as none.
fn body(code: u8) -> Option<Shown> {
    Some(Shown::of_code(code))
        .filter(|shown| !matches!(shown, Shown::Direct(Item::Room) | Shown::Through(_, Item::Room)))
}

/// Compares visibility with MuJoCo's rays and with drawn labels, in views of mirrors. Rays agree exactly about bodies; a
/// ray along the edge of a mirror may round to either side.
fn agrees(keys: &str) {
    need::drawing();
    let experiment = experiment(keys);
    let mut eye = LabelCamera::new(&shaped(Body::Mannequin), 640, 480);
    let mut chance = Rng::for_run(85, 1, 2);
    let (mut views, mut own, mut same, mut all, mut edges, mut rays) = (0, 0, 0_usize, 0_usize, 0_usize, 0_usize);
    for seed in 1..=4 {
        let mut world = world(Body::Mannequin, experiment.clone(), seed);
        for at in 0..60 {
            scatter(&mut world, &mut chance);
            let visibility = world.visibility();
            if visibility.mirror_px == 0 {
                continue;
            }
            (views, own) = (views + 1, own + i32::from(visibility.self_px > 0));
            if at % 4 == 0 {
                let (cast, met) = (labels(&world, 160, 120), labels_by_mujoco(&world, 160, 120));
                let bodies = |image: &LabelImage| image.codes.iter().map(|code| body(*code)).collect::<Vec<_>>();
                assert!(bodies(&cast) == bodies(&met), "{keys}, seed {seed}, view {at}");
                edges += cast.codes.iter().zip(&met.codes).filter(|(cast, met)| cast != met).count();
                rays += cast.codes.len();
            }
            let (cast, drawn) = (world.labels().clone(), eye.labels(&world));
            let is_mirror = |code: &u8| Shown::of_code(*code).pane().is_some();
            let pairs = cast.codes.iter().zip(&drawn.codes);
            for (cast, drawn) in pairs.filter(|(cast, drawn)| is_mirror(cast) || is_mirror(drawn)) {
                all += 1;
                same += usize::from(cast == drawn);
            }
        }
    }
    println!("{keys}: {views} views of mirrors, the own body in {own}; {same} of {all} pixels agree");
    assert!(views >= 20 && own >= 3, "{keys}: {views} views, {own} of the own body");
    assert!(edges * 100_000 < rays, "{keys}: {edges} of {rays} rays differ");
    assert!((all - same) * 1000 < all, "{keys}: {} of {all} pixels differ", all - same);
}

#[test]
fn two_mirrors_on_one_wall_agree_with_rays_and_pictures() {
    agrees(
        "mirror = [{ wall = \"east\", width = 1.2 }, { wall = \"same\", width = 1.2 }, { wall = \"east\", width = 0.8 }]",
    );
}

#[test]
fn small_mirrors_agree_with_rays_and_pictures() {
    agrees("mirror = [{ width = 0.1 }, { wall = \"opposite\", width = 0.3, height = 0.2, bottom = 1.4 }]");
}

#[test]
fn framed_mirrors_agree_with_rays_and_pictures() {
    agrees("mirror = [{ frame = true }, { wall = \"opposite\" }]");
}

#[test]
fn low_and_high_eyes_agree_with_rays_and_pictures() {
    for height in [0.5, 0.8, 1.9] {
        agrees(&format!("view = {{ fovy = 110, eye_height = {height} }}\nmirror = [{{}}]"));
    }
}

#[test]
fn no_eye_height_shows_the_own_body_directly() {
    for shape in Body::ALL {
        for height in [0.5, 0.7, 0.9, 1.1, 1.3, 1.6, 1.9] {
            let keys = format!("view = {{ fovy = 115, eye_height = {height} }}\nmirror = [{{}}]");
            let mut world = world(shape, experiment(&keys), 1);
            let [x, y, z] = [world.pose().x, world.pose().y, world.config().eye.height];
            assert!((z - height).abs() < 1e-9, "{x} {y} {z}");
            for stride in [Stride::Standing, Stride::Left, Stride::Right] {
                world.place(&[Figure { stride, ..Figure::standing(world.pose()) }]);
                assert_eq!(world.visibility().self_direct_px, 0, "{shape:?} {height} {stride:?}");
            }
        }
    }
}

/// Before `from_t` and after `until_t` nothing differs from a bare wall, and between them nothing from a mirror that is
/// always there: neither picture nor visibility.
#[test]
fn a_brief_mirror_is_a_mirror_in_its_steps_and_a_bare_wall_in_others() {
    need::drawing();
    let brief = experiment("mirror = [{ frame = true, from_t = 3, until_t = 5 }]");
    let config = WorldConfig::default();
    let mut eye = Camera::new(&config).unwrap();
    let scene = Scene::draw(&config, brief, 1, 1).unwrap();
    let bare = Scene { panes: Vec::new(), ..scene.clone() };
    let mut always = scene.clone();
    (always.panes[0].from_t, always.panes[0].until_t) = (None, None);
    let mut worlds = [scene, bare, always].map(|scene| World::new(&config, scene).unwrap());
    let mirror = worlds[0].scene().mirror;
    let [x, y] = mirror.center(&config);
    let before = mirrorstats_sim::body::Pose { x, y, heading: mirror.heading() }.ahead(-1.6);
    let mut seen = Vec::new();
    for t in 1..=7 {
        for world in &mut worlds {
            world.place(&[Figure::standing(before)]);
        }
        let [brief, bare, always] = &worlds;
        let expected = if (3..=5).contains(&t) { always } else { bare };
        assert_eq!((brief.t(), brief.labels()), (t, expected.labels()), "step {t}");
        assert!(eye.frame(brief).unwrap() == eye.frame(expected).unwrap(), "step {t}");
        assert_eq!(brief.snapshot().solids, expected.snapshot().solids, "step {t}");
        seen.push(brief.is_mirror_visible(&brief.visibility()));
        for world in &mut worlds {
            world.act(None);
        }
    }
    assert_eq!(seen, [false, false, true, true, true, false, false]);
}

#[test]
fn a_frame_changes_the_picture_and_not_the_visibility() {
    need::drawing();
    let config = WorldConfig::default();
    let mut eye = Camera::new(&config).unwrap();
    let [framed, plain] = ["mirror = [{ frame = true }]", "mirror = [{}]"].map(|keys| {
        let mut world = World::new(&config, Scene::draw(&config, experiment(keys), 1, 1).unwrap()).unwrap();
        super::poses::face_mirror(&mut world, 2.0, 0);
        world
    });
    assert!(framed.visibility().self_px > 0);
    assert_eq!(framed.visibility(), plain.visibility());
    assert!(eye.frame(&framed).unwrap() != eye.frame(&plain).unwrap());
}

#[test]
fn mirrors_on_one_wall_do_not_overlap() {
    let config = WorldConfig::default();
    let keys = "mirror = [{ width = 2.0 }, { wall = \"same\", width = 1.5 }, { wall = \"same\", width = 0.5 }]";
    for seed in 0..60 {
        let scene = Scene::draw(&config, experiment(keys), seed, 1).unwrap();
        let mut sides: Vec<[f64; 2]> =
            scene.panes.iter().map(|pane| [-0.5, 0.5].map(|half| pane.place.offset + half * pane.width)).collect();
        sides.sort_by(|one, other| one[0].total_cmp(&other[0]));
        assert!(scene.panes.iter().all(|pane| pane.place.wall == scene.mirror.wall));
        assert!(sides.windows(2).all(|pair| pair[1][0] - pair[0][1] >= 0.1), "{sides:?}");
        assert!(sides[0][0] >= -3.7 - 1e-9 && sides[2][1] <= 3.7 + 1e-9, "{sides:?}");
    }
}

/// What `crowded` says about an experiment with these keys.
fn fault(keys: &str) -> Option<DoesNotFit> {
    placement::crowded(&WorldConfig::default(), &experiment(keys))
}

#[test]
fn mirrors_without_room_are_refused_by_name() {
    for (keys, what, help) in [
        (
            "mirror = [{ width = 9.0 }]",
            "a mirror of 9 m does not fit onto a wall of 8 m; at most 7.4 m fit",
            "`room.size`",
        ),
        (
            "mirror = [{ bottom = 2.0, height = 2.0 }]",
            "a mirror of 2 m from 2 m above the floor does not fit below a ceiling of 2.8 m",
            "`room.height`",
        ),
        (
            "mirror = [{ bottom = 1.0 }]",
            "a mirror of 2.3 m from 1 m above the floor does not fit",
            "use a smaller mirror",
        ),
        ("mirror = [{ height = 3.0 }]", "a mirror of 3 m from 0 m above the floor does not fit", "`room.height`"),
        (
            "mirror = [{ wall = \"east\", width = 6 }, { wall = \"east\", width = 6 }]",
            "a mirror that overlaps another one on its wall, of seed 1 and run 1",
            "use a smaller `width`, or another `wall`",
        ),
    ] {
        let found = fault(keys).unwrap();
        assert!(found.what.starts_with(what) && found.help.contains(help) && found.key == "mirror", "{found:?}");
    }
    assert_eq!(fault("mirror = [{ bottom = 0.5 }]"), None, "2.8 m fit");
    assert_eq!(fault("mirror = [{ width = 7.4, height = 2.8 }]"), None);
}

#[test]
fn a_budget_too_short_for_every_scene_is_refused_with_the_steps_needed() {
    let found = fault("steps = 2\nmirror = [{}]").unwrap();
    assert_eq!(found.key, "steps");
    let (_, steps) = found.help.split_once("`steps = ").unwrap();
    let steps = steps.split('`').next().unwrap();
    assert!(found.what.contains("21 of them need more than 2"), "{found:?}");
    assert_eq!(fault(&format!("steps = {steps}\nmirror = [{{}}]")), None);
    // Some scenes can be solved.
    assert_eq!(fault("steps = 10\nmirror = [{}]"), None);
}

#[test]
fn a_view_that_shows_the_mirror_at_the_start_is_refused() {
    let wide = "view = { width = 1920, height = 480, fovy = 110 }\nmirror = [{}]";
    let found = fault(wide).unwrap();
    assert!(found.key == "view" && found.what.contains("in view at the start of"), "{found:?}");
    assert_eq!(fault(&format!("start = \"any\"\n{wide}")), None);
    assert_eq!(fault("view = { width = 1920, height = 480, fovy = 50 }\nmirror = [{}]"), None);
}

#[test]
fn a_small_mirror_shows_less_of_the_body() {
    let config = WorldConfig::default();
    let px = [3.0, 0.2, 0.1].map(|width| {
        let mut world = world(Body::Humanoid, experiment(&format!("mirror = [{{ width = {width} }}]")), 1);
        super::poses::face_mirror(&mut world, 1.0, 0);
        let visibility = world.visibility();
        let code = Shown::Through(0, Item::Agent(0)).code();
        let own: u32 = world.labels().codes.iter().map(|label| u32::from(*label == code)).sum();
        assert_eq!(visibility.self_px, own);
        own
    });
    assert!(px[0] > px[1] && px[1] > px[2] && px[2] > 0, "{px:?}");
    assert!(config.mirror.width > 2.9);
}

#[test]
fn a_file_of_the_world_with_too_few_steps_says_how_many_it_needs() {
    let config = WorldConfig::from_toml("episode.steps = 2").unwrap();
    let said = Scene::draw(&config, Experiment::E1, 1, 1).unwrap_err().to_string();
    assert!(said.starts_with("E1 of seed 1 and run 1 has no scene that can be solved in 2 steps"), "{said}");
    let (_, enough) = said.rsplit_once("`episode.steps = ").unwrap();
    let enough = enough.split('`').next().unwrap();
    let config = WorldConfig::from_toml(&format!("episode.steps = {enough}")).unwrap();
    assert!(Scene::draw(&config, Experiment::E1, 1, 1).is_ok());
}

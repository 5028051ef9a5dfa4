//! Visibility through panes of every kind, compared with drawn labels, with MuJoCo's rays, and with what each kind must
//! show.

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::Heading;
use mirrorstats_experiment::file;
use mirrorstats_experiment::spec::Body;
use mirrorstats_sim::body::{Figure, Pose};
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::mirror_eye;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::rng::Rng;
use mirrorstats_sim::scene::{HungPane, Scene};
use mirrorstats_sim::visibility::{Shown, labels};
use mirrorstats_sim::world::World;
use mirrorstats_toml_spec::Source;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use super::label_camera::LabelCamera;
use super::mujoco_rays::labels_by_mujoco;
use super::poses::{scatter, shaped};
use crate::harness::need;

/// Every kind of pane, in rooms with other agents.
const KINDS: &str = r#"
[experiment.mirrors]
title = "Three mirrors"
prompt = "exploration"
cubes = { kind = "clutter", least = 3, most = 3, hides = 0 }
others = { least = 1, most = 2 }
mirror = [{}, { wall = "opposite" }, { width = 2.0, height = 1.5 }]

[experiment.late]
title = "Late, with marks"
prompt = "mark"
decision = "mark_report"
cubes = { kind = "none" }
others = { least = 1, most = 1 }
mirror = [{ kind = "delayed", delay = 3 }]
mark = [{ part = "face", from_t = 2 }, { part = "back" }, { part = "chest", on = "other" }]

[experiment.textured]
title = "A mirror that looks like one"
prompt = "exploration"
look = "textured"
cubes = { kind = "clutter", least = 3, most = 3, hides = 0 }
others = { least = 1, most = 2 }
mirror = [{}, { wall = "opposite" }]

[experiment.painted]
title = "A decoy in another colour"
prompt = "exploration"
cubes = { kind = "none" }
others = { least = 1, most = 1 }
mirror = [{ kind = "decoy", color = "other" }]

[experiment.stranger]
title = "A decoy that moves by itself"
prompt = "exploration"
cubes = { kind = "none" }
others = { least = 1, most = 1 }
mirror = [{ kind = "decoy", body = "independent" }]

[experiment.window]
title = "A window"
prompt = "exploration"
cubes = { kind = "none" }
others = { least = 1, most = 1 }
mirror = [{ kind = "window", color = "other" }]
"#;

/// The experiments above, by name.
fn kind(name: &str) -> Experiment {
    // A window with this name is built in; a text without a folder may use the same name.
    let source = Source { name: "kinds".to_owned(), text: KINDS.to_owned() };
    let entries = file::read(source, None, &[]).unwrap();
    entries.into_iter().map(|entry| entry.experiment).find(|experiment| experiment.name() == name).unwrap()
}

/// Mannequins: the limbs of humanoids are a few pixels wide, and `truth` has bounds of their own for them.
fn config() -> WorldConfig {
    shaped(Body::Mannequin)
}

fn world(experiment: Experiment, seed: i32) -> World {
    let config = config();
    World::new(&config, Scene::draw(&config, experiment, seed, 1).unwrap()).unwrap()
}

/// Walks a little with all others moved each time, so that a late pane has a past.
fn wander(world: &mut World, chance: &mut Rng) {
    for _ in 0..4 {
        scatter(world, chance);
        world.act(Some(chance.one_of(&[Action::MoveForward, Action::TurnLeft, Action::TurnRight])));
    }
}

/// A body in a pane, in two images.
#[derive(Debug)]
struct View {
    shown: Shown,
    /// Pixels in both images, as a share of those in either.
    overlap: f64,
    /// Pixels in either image.
    either: u32,
    /// Pixels of one image that touch no pixel of the body in the other one: more than the edge differs.
    apart: u32,
}

/// The views of [`LEAST`] pixels or more.
fn views_of(one: &LabelImage, other: &LabelImage) -> Vec<View> {
    let mut counts = [[0_u32; 256]; 4];
    let touches = |image: &LabelImage, at: usize, code: u8| {
        let (width, x) = (image.width, at % image.width);
        let rows = [at.checked_sub(width), Some(at), Some(at + width)];
        let columns = |row: usize| (row - usize::from(x > 0))..=(row + usize::from(x + 1 < width));
        rows.into_iter().flatten().flat_map(columns).any(|at| image.codes.get(at) == Some(&code))
    };
    for (at, (a, b)) in one.codes.iter().zip(&other.codes).enumerate() {
        counts[0][usize::from(*a)] += 1;
        counts[1][usize::from(*b)] += 1;
        counts[2][usize::from(*a)] += u32::from(a == b);
        counts[3][usize::from(*a)] += u32::from(a != b && !touches(other, at, *a));
        counts[3][usize::from(*b)] += u32::from(a != b && !touches(one, at, *b));
    }
    let view = |code: usize| {
        let [one, other, both, apart] = counts.map(|count| count[code]);
        let shown = Shown::of_code(u8::try_from(code).unwrap());
        let is_body = matches!(shown, Shown::Through(_, Item::Agent(_) | Item::Double));
        let either = one + other - both;
        (is_body && one >= LEAST).then(|| View { shown, overlap: f64::from(both) / f64::from(either), either, apart })
    };
    (0..256).filter_map(view).collect()
}

/// The minimum number of pixels for a meaningful overlap.
const LEAST: u32 = 30;
/// Poses per kind.
const POSES: i32 = 200;

/// Bodies, cubes and marks through each pane, compared with labels in 200 poses: mean overlap above .99. The minimum is .95
/// where more than the edge differs: one pixel along the edge is more than 5 % of a small view. A hundredth of a view at
/// most differs away from its edge.
fn holds_against_pictures(name: &str) {
    need::drawing();
    let experiment = kind(name);
    let mut eye = LabelCamera::new(&config(), 640, 480);
    let mut chance = Rng::for_run(77, 1, 3);
    let mut views: Vec<View> = Vec::new();
    for seed in 0..POSES / 20 {
        let mut world = world(experiment.clone(), 1 + seed);
        for _ in 0..20 {
            wander(&mut world, &mut chance);
            let (cast, drawn) = (world.labels().clone(), eye.labels(&world));
            let differ = cast.codes.iter().zip(&drawn.codes).filter(|(cast, drawn)| cast != drawn).count();
            assert!(differ * 500 < cast.codes.len(), "{name}: {differ} pixels differ");
            views.extend(views_of(&cast, &drawn));
        }
    }
    let doubles = views.iter().filter(|view| matches!(view.shown, Shown::Through(_, Item::Double))).count();
    let sum: f64 = views.iter().map(|view| view.overlap).sum();
    #[expect(clippy::cast_precision_loss, reason = "some views")]
    let mean = sum / views.len() as f64;
    let worst = views.iter().min_by(|a, b| a.overlap.total_cmp(&b.overlap)).unwrap();
    println!("{name}: {} views of {LEAST} px or more, mean overlap {mean:.4}, worst {worst:?}", views.len());
    assert!(views.len() >= 40, "{} views alone", views.len());
    assert!(mean > 0.99, "{name}: mean {mean}, worst {worst:?}");
    for view in &views {
        let differs_at_its_edge = view.apart == 0;
        assert!(view.apart * 100 <= view.either, "{name}: {view:?}");
        assert!(view.overlap >= 0.95 || differs_at_its_edge, "{name}: {view:?}");
    }
    assert_eq!(doubles > 0, ["stranger", "window"].contains(&name), "{name}");
}

#[test]
fn several_mirrors_agree_with_pictures() {
    holds_against_pictures("mirrors");
}

#[test]
fn textured_mirrors_agree_with_pictures() {
    holds_against_pictures("textured");
}

/// Textures change the picture but not visibility.
#[test]
fn textures_do_not_change_visibility() {
    need::drawing();
    let [textured, plain] = ["textured", "mirrors"].map(kind);
    let config = config();
    let scene = Scene::draw(&config, textured.clone(), 1, 1).unwrap();
    let mut looks = [&textured, &plain].map(|experiment| {
        let scene = Scene { experiment: experiment.clone(), ..scene.clone() };
        World::new(&config, scene).unwrap()
    });
    let mut eyes = [textured, plain].map(|experiment| Camera::new(&config.for_experiment(&experiment)).unwrap());
    let (mut differs, mut light) = (0, [[0_u64; 3]; 2]);
    for heading in 0..12 {
        let pose = Pose { heading: Heading::new(heading), ..looks[0].pose() };
        for world in &mut looks {
            world.place_at(Figure::standing(pose), 1);
        }
        assert_eq!(looks[0].visibility(), looks[1].visibility());
        let [one, other] = [0, 1].map(|at| eyes[at].frame(&looks[at]).unwrap());
        differs += usize::from(one != other);
        assert_eq!(one, eyes[0].frame(&looks[0]).unwrap(), "a picture comes again");
        let codes = labels(&looks[0], one.width, one.height).codes;
        for at in (0..codes.len()).filter(|at| Shown::of_code(codes[*at]).pane().is_some()) {
            for (sums, frame) in light.iter_mut().zip([&one, &other]) {
                sums.iter_mut().zip(&frame.rgb[3 * at..]).for_each(|(sum, level)| *sum += u64::from(*level));
            }
        }
    }
    assert_eq!(differs, 12);
    let [[red, green, _], [plain_red, plain_green, _]] = light;
    assert!(plain_red > 0 && red * plain_green < green * plain_red, "textured mirrors are slightly green: {light:?}");
}

#[test]
fn delayed_mirrors_agree_with_pictures() {
    holds_against_pictures("late");
}

#[test]
fn painted_decoys_agree_with_pictures() {
    holds_against_pictures("painted");
}

#[test]
fn moving_decoys_agree_with_pictures() {
    holds_against_pictures("stranger");
}

#[test]
fn windows_agree_with_pictures() {
    holds_against_pictures("window");
}

#[test]
fn visibility_through_panes_agrees_with_mujocos_rays() {
    let mut chance = Rng::for_run(78, 1, 2);
    let (mut differ, mut through) = (0_usize, 0_usize);
    for name in ["mirrors", "late", "painted", "stranger", "window"] {
        let mut world = world(kind(name), 3);
        for _ in 0..8 {
            wander(&mut world, &mut chance);
            let cast = labels(&world, 160, 120);
            let met = labels_by_mujoco(&world, 160, 120);
            differ += cast.codes.iter().zip(&met.codes).filter(|(cast, met)| cast != met).count();
            through += cast.codes.iter().filter(|code| Shown::of_code(**code).pane().is_some()).count();
        }
    }
    assert!(through > 10_000, "{through}");
    assert_eq!(differ, 0, "of {through} through panes");
}

#[test]
fn every_pane_is_counted_by_itself_and_all_together() {
    let mut chance = Rng::for_run(79, 1, 2);
    let mut world = world(kind("mirrors"), 2);
    assert_eq!(world.scene().panes.len(), 3);
    for _ in 0..20 {
        wander(&mut world, &mut chance);
        let visibility = world.visibility();
        let count =
            |shown: Shown| world.labels().codes.iter().map(|code| u32::from(*code == shown.code())).sum::<u32>();
        for (pane, sighting) in visibility.panes.iter().enumerate() {
            assert_eq!(sighting.self_px, count(Shown::Through(pane, Item::Agent(0))));
        }
        assert_eq!(visibility.self_px, visibility.panes.iter().map(|pane| pane.self_px).sum::<u32>());
        assert_eq!(visibility.mirror_px, visibility.panes.iter().map(|pane| pane.px).sum::<u32>());
    }
}

/// A late mirror shows the room as a mirror showed it earlier: equal counts for the same eye and bodies.
#[test]
fn a_late_mirror_shows_the_past() {
    let late = kind("late");
    let delay = late.panes[0].delay as usize;
    let mut world = world(late, 4);
    let mut past = vec![world.figures()];
    let mut chance = Rng::for_run(80, 1, 2);
    for step in 0..20 {
        scatter(&mut world, &mut chance);
        past.push(world.figures());
        // The placed state is the current one. Without such a past, the first state counts.
        let shown = past[past.len().saturating_sub(1 + delay)].clone();
        assert_eq!(world.figures_in(0), shown, "step {step}");
        // An ordinary mirror with all bodies where they were, seen from the current eye.
        let scene = world.scene().clone();
        let plain = Scene { panes: vec![HungPane { delay: 0, ..scene.panes[0] }], ..scene };
        let mut then = World::new(world.config(), plain).unwrap();
        then.place(&shown);
        let counted = |world: &World| {
            let stage = &world.beyond()[0];
            let place = |geom: usize| (geom, stage.data.geom_xpos()[geom], stage.data.geom_xmat()[geom]);
            (0..stage.items.len()).filter(|geom| stage.is_shown(*geom)).map(place).collect::<Vec<_>>()
        };
        assert_eq!(counted(&world), counted(&then), "step {step}");
    }
}

#[test]
fn marks_appear_at_their_step_and_later_in_a_late_mirror() {
    let mut world = world(kind("late"), 5);
    let is_shown = |world: &World| {
        let shown = |stage: &mirrorstats_sim::model::Stage| {
            stage.items.iter().enumerate().any(|(geom, item)| *item == Item::Mark(0) && stage.is_shown(geom))
        };
        [shown(world.stage()), shown(&world.beyond()[0])]
    };
    let mut seen = Vec::new();
    for _ in 0..6 {
        seen.push((world.t(), is_shown(&world), world.scene().own_mark_at(world.t()).is_some()));
        world.act(None);
    }
    let expected = [
        (1, [false, false], true),
        (2, [true, false], true),
        (3, [true, false], true),
        (4, [true, false], true),
        (5, [true, true], true),
        (6, [true, true], true),
    ];
    assert_eq!(seen, expected, "the mark on the back is there from the start");
}

#[test]
fn a_mark_differs_in_colour_from_its_wearer_and_the_own_body() {
    for seed in 1..40 {
        let world = world(kind("late"), seed);
        let scene = world.scene();
        for mark in &scene.marks {
            let wearer = if mark.wearer == 0 { scene.body_color } else { scene.others[mark.wearer - 1].color };
            assert!(mark.color != wearer && mark.color != scene.body_color, "{scene:?}");
        }
    }
}

/// The most common paint of the pixels with this code.
fn paint_of(world: &World, eye: &mut Camera, shown: Shown) -> Option<Color> {
    let frame = eye.frame(world).unwrap();
    let pixels = world.labels().codes.iter().enumerate().filter(|(_, code)| **code == shown.code());
    let named =
        pixels.filter_map(|(at, _)| mirrorstats_agents::perception::paint::color(&frame.rgb[3 * at..3 * at + 3]));
    let mut counts = std::collections::BTreeMap::new();
    named.for_each(|color| *counts.entry(color).or_insert(0_usize) += 1);
    counts.into_iter().filter(|(_, count)| *count >= 60).max_by_key(|(_, count)| *count).map(|(color, _)| color)
}

/// Counts the views that show a paint, and compares each with the expected one.
fn paints(name: &str, item: Item, expected: impl Fn(&Scene) -> Color) {
    need::drawing();
    let mut eye = Camera::new(&config()).unwrap();
    let mut chance = Rng::for_run(81, 1, 2);
    let (mut views, mut right) = (0, 0);
    for seed in 1..=8 {
        let mut world = world(kind(name), seed);
        for _ in 0..10 {
            wander(&mut world, &mut chance);
            if let Some(color) = paint_of(&world, &mut eye, Shown::Through(0, item)) {
                views += 1;
                right += i32::from(color == expected(world.scene()));
            }
        }
    }
    assert!(views >= 5, "{name}: {views} views");
    assert_eq!(right, views, "{name}");
}

#[test]
fn a_decoy_shows_the_own_body_in_another_colour() {
    paints("painted", Item::Agent(0), |scene| {
        let paint = scene.panes[0].paint.unwrap();
        assert_ne!(paint, scene.body_color);
        paint
    });
}

#[test]
fn a_window_shows_only_a_stranger() {
    paints("window", Item::Double, |scene| scene.panes[0].double.unwrap().color);
    let mut chance = Rng::for_run(82, 1, 2);
    let mut world = world(kind("window"), 3);
    for _ in 0..40 {
        wander(&mut world, &mut chance);
        let visibility = world.visibility();
        assert_eq!((visibility.self_px, visibility.other_px), (0, 0));
    }
}

#[test]
fn a_double_moves_whatever_the_agent_does() {
    for name in ["stranger", "window"] {
        let [mut still, mut busy] = [world(kind(name), 6), world(kind(name), 6)];
        let mut places = Vec::new();
        for _ in 0..30 {
            still.act(None);
            busy.act(Some(Action::MoveForward));
            assert_eq!(still.double(0), busy.double(0), "{name}");
            places.push(still.double(0).unwrap());
        }
        assert!(places.iter().any(|place| *place != places[0]), "{name} stands still");
        assert!(still.figures_in(0) == still.figures());
    }
}

#[test]
fn a_mirror_reflects_the_eye_and_a_window_moves_it_back() {
    for name in ["mirrors", "window"] {
        let mut world = world(kind(name), 7);
        let mut chance = Rng::for_run(83, 1, 2);
        scatter(&mut world, &mut chance);
        let eye = world.pose().ahead(world.config().eye.forward);
        for pane in &world.scene().panes {
            let beyond = mirror_eye::eye(world.config(), pane, world.pose());
            let away = pane.place.distance(eye.spot(), world.config());
            let behind = pane.place.distance(beyond.spot(), world.config());
            if name == "mirrors" {
                assert!((away + behind).abs() < 1e-9);
                assert!((pane.place.aside(eye.spot()) - pane.place.aside(beyond.spot())).abs() < 1e-9);
            } else {
                assert!((behind - away - mirror_eye::shift(world.config())).abs() < 1e-9);
                assert_eq!(beyond.heading, eye.heading);
            }
        }
    }
}

#[test]
fn the_mark_of_the_mark_test_can_be_seen_well_from_somewhere() {
    let config = config();
    let experiment = Experiment::parse("mark").unwrap();
    for (seed, run) in (1..=3).flat_map(|seed| (1..=7).map(move |run| (seed, run))) {
        let mut world = World::new(&config, Scene::draw(&config, experiment.clone(), seed, run).unwrap()).unwrap();
        let mirror = world.scene().mirror;
        let [x, y] = mirror.center(&config);
        let heading = mirror.heading();
        let near = Figure::standing(Pose { x, y, heading }.ahead(-0.9));
        world.place_at(near, 19);
        assert_eq!(world.visibility().mark_px, 0, "it is not there yet");
        world.place_at(near, 20);
        let px = world.visibility().mark_px;
        assert!(px >= 200, "seed {seed}, run {run}: {px} px");
    }
}

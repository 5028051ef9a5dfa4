//! Scenes by seed: without overlaps, always solvable, and the same on every machine.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use mirrorstats_exact::hash;
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::file;
use mirrorstats_sim::body::{Figure, Pose};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::floor::distance;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::visibility::{SelfVisibility, Shown, labels};
use mirrorstats_sim::world::World;
use mirrorstats_toml_spec::Source;
use mirrorstats_trace::schema::colors::Color;

use crate::assert_shown;

const SEEDS: i32 = 20;
const RUNS: i32 = 10;

static SCENES: LazyLock<Vec<Vec<Scene>>> = LazyLock::new(|| {
    let config = WorldConfig::default();
    let draw = |experiment: &Experiment, at| Scene::draw(&config, experiment.clone(), at / RUNS, at % RUNS).unwrap();
    Experiment::PAPER.map(|experiment| (0..SEEDS * RUNS).map(|at| draw(&experiment, at)).collect()).into()
});

/// Two hundred scenes of an experiment.
fn scenes(experiment: Experiment) -> impl Iterator<Item = Scene> {
    SCENES.iter().flatten().filter(move |scene| scene.experiment == experiment).cloned()
}

#[test]
fn scenes_are_identical_on_every_machine() {
    let config = WorldConfig::default();
    let hashes = Experiment::PAPER.map(|experiment| {
        let drawn: Vec<Scene> = (0..3)
            .flat_map(|seed| (0..7).map(move |run| [seed, run]))
            .map(|[seed, run]| Scene::draw(&config, experiment.clone(), seed, run).unwrap())
            .collect();
        format!("{} {}", experiment.name(), &hash::of_bytes(serde_json::to_string(&drawn).unwrap().as_bytes())[..16])
    });
    assert_shown!("three seeds with seven runs of each experiment, hashed as JSON", hashes.join("\n"));
}

#[test]
fn one_of_three_distinct_candidates_has_the_colour_of_the_body() {
    for scene in [Experiment::E1, Experiment::E2, Experiment::E3, Experiment::E4].into_iter().flat_map(scenes) {
        let colors: BTreeSet<Color> = scene.cubes.iter().map(|cube| cube.color).collect();
        assert_eq!((scene.cubes.len(), colors.len()), (3, 3));
        assert!(colors.contains(&scene.body_color));
    }
}

#[test]
fn only_e3_states_a_false_colour_of_another_candidate() {
    for scene in Experiment::PAPER.into_iter().flat_map(scenes) {
        match scene.stated_color {
            Some(stated) => {
                assert_eq!(scene.experiment, Experiment::E3);
                assert_ne!(stated, scene.body_color);
                assert!(scene.cubes.iter().any(|cube| cube.color == stated));
            }
            None => assert_ne!(scene.experiment, Experiment::E3),
        }
    }
}

#[test]
fn e1_e2_and_e3_compare_in_pairs() {
    for ((e1, e2), e3) in scenes(Experiment::E1).zip(scenes(Experiment::E2)).zip(scenes(Experiment::E3)) {
        assert!(e2.panes.is_empty() && e1.panes.len() == 1);
        assert_eq!(Scene { experiment: Experiment::E1, panes: e1.panes.clone(), ..e2 }, e1);
        assert_eq!(Scene { experiment: Experiment::E1, stated_color: None, ..e3 }, e1);
    }
}

/// An experiment's own steps and view are no part of its scenes, nor is a narrower view of the world.
#[test]
fn steps_and_views_draw_the_scenes_of_e1() {
    let keys = ["steps = 40", "step_length = 0.2", "view = { fovy = 60 }", "view = { fovy = 110, eye_height = 0.8 }"];
    let own = keys.map(|keys| {
        let text = format!(
            "[experiment.own]\ntitle = \"Own\"\nprompt = \"cube-selection\"\nscenes = \"E1\"\n{keys}\nmirror = [{{}}]\n"
        );
        let e1 = Experiment::E1;
        let entries = file::read(Source { name: "own".to_owned(), text }, None, &[&e1]).unwrap();
        entries.into_iter().next().unwrap().experiment
    });
    let config = WorldConfig::default();
    let views = ["eye.fovy = 60", "eye = { width = 160, height_px = 120 }", "eye = { width = 64, height_px = 48 }"]
        .map(|text| WorldConfig::from_toml(text).unwrap());
    for (seed, run) in (1..=9).flat_map(|seed| (1..=7).map(move |run| (seed, run))) {
        let e1 = Scene::draw(&config, Experiment::E1, seed, run).unwrap();
        for (experiment, keys) in own.iter().zip(keys) {
            let scene = Scene::draw(&config, experiment.clone(), seed, run).unwrap();
            assert_eq!(Scene { experiment: Experiment::E1, ..scene }, e1, "{keys}");
        }
        for view in &views {
            assert_eq!(Scene::draw(view, Experiment::E1, seed, run).unwrap(), e1, "{:?}", view.eye);
        }
    }
}

#[test]
fn every_colour_wall_count_and_cube_comes_up() {
    let scenes: Vec<Scene> = scenes(Experiment::E4).collect();
    assert_eq!(scenes.iter().map(|scene| scene.body_color).collect::<BTreeSet<_>>().len(), 10);
    assert_eq!(scenes.iter().map(|scene| scene.mirror.wall).collect::<BTreeSet<_>>().len(), 4);
    assert_eq!(scenes.iter().map(|scene| scene.others.len()).collect::<BTreeSet<_>>(), (1..=6).collect());
    let places: BTreeSet<usize> =
        scenes.iter().filter_map(|scene| scene.cubes.iter().position(|cube| cube.color == scene.body_color)).collect();
    assert_eq!(places.len(), 3, "the right cube may be any of the three");
    let twins = scenes.iter().filter(|scene| scene.others.iter().any(|other| other.color == scene.body_color)).count();
    assert!((80..135).contains(&twins), "{twins} of 200 have another body in the own colour; 107 are expected");
}

#[test]
fn others_wear_each_candidates_colour_equally_often() {
    let (mut own, mut all) = (0.0, 0.0);
    for scene in scenes(Experiment::E4) {
        let is_candidate = |color: Color| scene.cubes.iter().any(|cube| cube.color == color);
        for other in scene.others.iter().filter(|other| is_candidate(other.color)) {
            all += 1.0;
            own += f64::from(u8::from(other.color == scene.body_color));
        }
    }
    // Three standard errors of a third.
    let spread = 3.0 * f64::sqrt(all * 2.0 / 9.0);
    assert!(f64::abs(own - all / 3.0) < spread, "{own} of {all} wear the own colour");
}

#[test]
fn what_a_window_shows_is_the_colour_of_no_candidate() {
    let config = WorldConfig::default();
    let window = Experiment::parse("window").unwrap();
    for scene in (1..=30).map(|seed| Scene::draw(&config, window.clone(), seed, 1).unwrap()) {
        let shown = scene.panes[0].double.unwrap().color;
        assert!(scene.cubes.iter().all(|cube| cube.color != shown), "{shown:?} {:?}", scene.cubes);
    }
}

#[test]
fn e5_has_others_and_clutter_that_hides_some_of_the_mirror() {
    let config = WorldConfig::default();
    for scene in scenes(Experiment::E5) {
        assert!((1..=6).contains(&scene.others.len()) && (6..=10).contains(&scene.cubes.len()));
        assert_eq!(scene.stated_color, None);
    }
    let before = |scene: &Scene| {
        scene
            .cubes
            .iter()
            .filter(|cube| {
                scene.mirror.distance([cube.x, cube.y], &config) < 1.2
                    && scene.mirror.aside([cube.x, cube.y]).abs() < 1.5
            })
            .count()
    };
    let hidden = scenes(Experiment::E5).filter(|scene| before(scene) > 0).count();
    assert_eq!(hidden, 200);
}

/// Paper, section 3: mirror evidence in E5 is partial or occluded. Counts pixels that would show the body without
/// clutter, from places within three metres of the mirror where the agent can stand, facing it.
#[test]
fn the_clutter_of_e5_hides_the_body_from_most_places_and_shows_it_from_some() {
    let config = WorldConfig::default();
    let (mut all, mut best) = (Vec::new(), Vec::new());
    for (seed, run) in (1..=3).flat_map(|seed| (1..=4).map(move |run| (seed, run))) {
        let scene = Scene { others: Vec::new(), ..Scene::draw(&config, Experiment::E5, seed, run).unwrap() };
        let bare = Scene { cubes: Vec::new(), ..scene.clone() };
        let [mut world, mut open] = [scene, bare].map(|scene| World::new(&config, scene).unwrap());
        let shares = shares_shown(&mut world, &mut open);
        best.push(shares.iter().copied().fold(0.0, f64::max));
        all.extend(shares);
    }
    all.sort_by(f64::total_cmp);
    let quartiles = [1, 2, 3].map(|quarter| all[all.len() * quarter / 4]);
    println!("{} places: share of the body that shows, quartiles {quartiles:?}; best places {best:?}", all.len());
    assert!(quartiles[1] <= 0.5, "half of the places show more than half of the body: {quartiles:?}");
    assert!(best.iter().all(|share| *share >= 0.6), "no place to identify oneself: {best:?}");
}

/// The share of the body's pixels that the clutter leaves visible, for each place.
fn shares_shown(world: &mut World, open: &mut World) -> Vec<f64> {
    let own = Shown::Through(0, Item::Agent(0));
    let (mirror, config) = (world.scene().mirror, world.config().clone());
    let heading = mirror.heading();
    let [x, y] = mirror.center(&config);
    let [out_x, out_y] = heading.direction();
    let places = (-6..=6).flat_map(|aside| (3..=10).map(move |away| (f64::from(aside) * 0.2, f64::from(away) * 0.3)));
    let mut shares = Vec::new();
    for (aside, away) in places {
        let spot = [x - aside * out_y - away * out_x, y + aside * out_x - away * out_y];
        if !world.floor_plan().admits(spot, 0.0) {
            continue;
        }
        let figure = Figure::standing(Pose { x: spot[0], y: spot[1], heading });
        let [shown, whole] = [&mut *world, &mut *open].map(|world| {
            world.place(&[figure]);
            labels(world, 160, 120).codes.iter().map(|code| usize::from(*code == own.code())).sum::<usize>()
        });
        if whole > 0 {
            #[expect(clippy::cast_precision_loss, reason = "pixels of a view")]
            shares.push(shown as f64 / whole as f64);
        }
    }
    shares
}

#[test]
fn random_clutter_stands_on_the_floor_anywhere_and_leaves_the_mirror_in_view() {
    let config = WorldConfig::default();
    let random = Experiment::parse("random-clutter").unwrap();
    let (mut cubes, mut before) = (0, 0);
    for scene in (0..60).map(|seed| Scene::draw(&config, random.clone(), seed, 1).unwrap()) {
        assert!((6..=10).contains(&scene.cubes.len()));
        for cube in &scene.cubes {
            assert!(cube.base.abs() <= 0.0, "{cube:?}");
            let is_before = scene.mirror.distance([cube.x, cube.y], &config) <= config.clutter.mirror_distance;
            before += usize::from(is_before && scene.mirror.aside([cube.x, cube.y]).abs() <= config.mirror.width / 2.0);
            cubes += 1;
        }
    }
    // The area before the mirror is a twentieth of the floor but has nine tenths of E5's clutter.
    assert!(before > 0 && before * 8 < cubes, "{before} of {cubes}");
    // The pixels of the body that clutter leaves in the mirror, from all places that an agent can walk to.
    let [ours, theirs] =
        [Experiment::E5, random].map(|experiment| SelfVisibility::measured(&config, &experiment).unwrap().unoccluded);
    assert!(2 * ours[0] < ours[1], "{ours:?}");
    assert!(theirs[1] > 0 && 10 * theirs[0] > 9 * theirs[1], "{theirs:?}");
}

#[test]
fn nothing_overlaps_at_the_start() {
    let config = WorldConfig::default();
    for scene in Experiment::PAPER.into_iter().flat_map(scenes) {
        let plan = scene.floor_plan(&config);
        let bodies: Vec<[f64; 2]> =
            std::iter::once(scene.start).chain(scene.others.iter().map(|other| other.start)).map(Pose::spot).collect();
        for (at, body) in bodies.iter().enumerate() {
            assert!(plan.admits(*body, config.placement.clearance));
            assert!(bodies[at + 1..].iter().all(|other| distance(*body, *other) >= 2.0 * plan.radius));
        }
        for (at, cube) in scene.cubes.iter().enumerate() {
            assert!(cube.x.abs().max(cube.y.abs()) + cube.edge / 2.0 <= config.room.size / 2.0);
            for other in scene.cubes[at + 1..].iter().filter(|other| other.base.total_cmp(&cube.base).is_eq()) {
                let gap = (cube.x - other.x).abs().max((cube.y - other.y).abs()) - f64::midpoint(cube.edge, other.edge);
                assert!(gap >= -1e-9, "{cube:?} {other:?}");
            }
        }
    }
}

#[test]
fn a_second_cube_stands_on_one_of_its_size() {
    let stacked = scenes(Experiment::E5).flat_map(|scene| {
        scene
            .cubes
            .clone()
            .into_iter()
            .filter(|cube| cube.base > 0.0)
            .map(move |cube| (scene.clone(), cube))
            .collect::<Vec<_>>()
    });
    let mut count = 0;
    for (scene, cube) in stacked {
        count += 1;
        assert!(
            scene
                .cubes
                .iter()
                .any(|under| under.base == 0.0 && (under.x, under.y, under.edge) == (cube.x, cube.y, cube.base))
        );
    }
    assert!(count > 50);
}

#[test]
fn nobody_sees_the_mirror_at_the_start() {
    let config = WorldConfig::default();
    for experiment in [Experiment::E1, Experiment::E4, Experiment::E5] {
        for scene in scenes(experiment).take(30) {
            assert_eq!(World::new(&config, scene).unwrap().visibility().mirror_px, 0);
        }
    }
}

#[test]
fn a_room_too_small_for_all_is_refused_with_a_remedy() {
    let config = WorldConfig::from_toml(
        "room.size = 5\nothers.least = 6\nplacement.clearance = 1.0\nclutter.least = 8\ncubes.spacing = 1.5",
    )
    .unwrap();
    let error = Scene::draw(&config, Experiment::E5, 1, 2).unwrap_err().to_string();
    assert_eq!(
        error,
        "E5 of seed 1 and run 2 has no room for all its objects after 2000 attempts: use a larger `room.size`, \
         or fewer or smaller cubes and others"
    );
}

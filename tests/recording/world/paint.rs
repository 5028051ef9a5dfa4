//! The ten colours are distinct from each other and from the room, directly and in the mirror.

use mirrorstats_experiment::Experiment;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::visibility::{Shown, labels};
use mirrorstats_sim::world::World;
use mirrorstats_trace::schema::colors::Color;

use super::poses::{face_mirror, world};
use crate::harness::need;

/// The world of a seed with all coloured things in one colour.
fn all_in(color: Color) -> World {
    let drawn = world(Experiment::E1, 3);
    let mut scene = drawn.scene().clone();
    scene.body_color = color;
    for cube in &mut scene.cubes {
        cube.color = color;
    }
    World::new(drawn.config(), scene).unwrap()
}

/// Returns true if a pixel and its neighbours show the same thing, so that smoothing does not change it.
fn is_inner(image: &LabelImage, x: usize, y: usize) -> bool {
    let inside = x > 0 && y > 0 && x + 1 < image.width && y + 1 < image.height;
    inside
        && [[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]].iter().all(|[nx, ny]| image.at(*nx, *ny) == image.at(x, y))
}

/// The palette colour nearest to a pixel under any light; `None` for the room.
fn nearest(pixel: [f64; 3]) -> Option<Color> {
    let lit = |rgb: [f64; 3]| {
        // The best light for the colour, and the remaining difference.
        let along: f64 =
            (0..3).map(|at| rgb[at] * pixel[at]).sum::<f64>() / rgb.iter().map(|part| part * part).sum::<f64>();
        let light = along.clamp(0.6, 1.0);
        (0..3).map(|at| (pixel[at] - light * rgb[at]).powi(2)).sum::<f64>()
    };
    let room = [[150.0, 154.0, 162.0], [115.0, 118.0, 122.0]].map(|rgb| (None, lit(rgb)));
    let paints = Color::ALL.map(|color| (Some(color), lit(color.rgb().map(f64::from))));
    paints.into_iter().chain(room).min_by(|one, other| one.1.total_cmp(&other.1)).unwrap().0
}

#[test]
fn the_ten_colours_differ_directly_and_in_the_mirror() {
    let config = WorldConfig::default();
    need::drawing();
    let mut eye = Camera::new(&config).unwrap();
    for color in Color::ALL {
        let mut world = all_in(color);
        // Right and wrong pixels of the own body, cubes, cubes in the mirror, and the room.
        let mut tally = [[0_u32; 2]; 4];
        for turn in [0, 1, -1, 6] {
            face_mirror(&mut world, 2.0, turn);
            let frame = eye.frame(&world).unwrap();
            let image = labels(&world, 640, 480);
            for (at, pixel) in frame.rgb.chunks_exact(3).enumerate() {
                let [x, y] = [at % 640, at / 640];
                let (kind, expected) = match image.at(x, y) {
                    Shown::Through(0, Item::Agent(0)) => (0, Some(color)),
                    Shown::Direct(Item::Cube(_)) => (1, Some(color)),
                    Shown::Through(0, Item::Cube(_)) => (2, Some(color)),
                    _ => (3, None),
                };
                // A head has no palette colour: it is darker than the room, and its face is as grey as a wall.
                let is_grey = pixel[0].abs_diff(pixel[1]).max(pixel[1].abs_diff(pixel[2])) < 16;
                let is_head = is_grey && (color != Color::White || pixel[0] < 70);
                // Most of a picture is the room; a sample is enough.
                let is_asked = expected.is_some() || at % 41 == 0;
                if is_asked && is_inner(&image, x, y) && !(kind == 0 && is_head) {
                    let found = nearest([pixel[0], pixel[1], pixel[2]].map(f64::from));
                    tally[kind][usize::from(found != expected)] += 1;
                }
            }
        }
        for (kind, [right, wrong]) in tally.into_iter().enumerate() {
            assert!(right > 50 && wrong * 50 < right, "{color:?}, kind {kind}: {right} right, {wrong} wrong");
        }
    }
}

#[test]
fn the_mirror_shows_the_same_colour() {
    let config = WorldConfig::default();
    need::drawing();
    let mut eye = Camera::new(&config).unwrap();
    for color in Color::ALL {
        let mut world = all_in(color);
        let mut sums = [[0.0_f64; 3]; 2];
        for (turn, shown) in [(0, 1), (6, 0)] {
            face_mirror(&mut world, 2.0, turn);
            let frame = eye.frame(&world).unwrap();
            let image = labels(&world, 640, 480);
            for (at, pixel) in frame.rgb.chunks_exact(3).enumerate() {
                let [x, y] = [at % 640, at / 640];
                let is_cube = matches!(
                    (image.at(x, y), shown),
                    (Shown::Through(0, Item::Cube(_)), 1) | (Shown::Direct(Item::Cube(_)), 0)
                );
                if is_cube && is_inner(&image, x, y) {
                    (0..3).for_each(|part| sums[shown][part] += f64::from(pixel[part]));
                }
            }
        }
        for part in 0..3 {
            // The brightness depends on the visible face, the hue does not.
            let [direct, mirrored] = sums.map(|sum| sum[part] / (sum[0] + sum[1] + sum[2]));
            assert!((direct - mirrored).abs() < 0.01, "{color:?}: {direct} {mirrored}");
        }
    }
}

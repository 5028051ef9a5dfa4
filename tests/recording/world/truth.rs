//! Visibility compared with drawn labels, with colours in the ordinary picture, and with MuJoCo's rays.

use std::ops::Range;

use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::Body;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::model::Item;
use mirrorstats_sim::visibility::{Shown, labels};
use mirrorstats_sim::world::World;
use mirrorstats_trace::frame::Frame;
use mirrorstats_trace::schema::colors::Color;

use super::label_camera::LabelCamera;
use super::mujoco_rays::labels_by_mujoco;
use super::poses::{for_scattered, shaped};
use crate::harness::need;

const WITH_MIRROR: [Experiment; 3] = [Experiment::E1, Experiment::E4, Experiment::E5];
const OWN: Shown = Shown::Through(0, Item::Agent(0));

/// The numbers of pixels in both of two sets, and in either.
#[derive(Default)]
struct Overlap {
    both: u32,
    either: u32,
}

impl Overlap {
    fn of(pairs: impl Iterator<Item = (bool, bool)>) -> Self {
        let mut overlap = Self::default();
        for (one, other) in pairs {
            overlap.both += u32::from(one && other);
            overlap.either += u32::from(one || other);
        }
        overlap
    }

    fn share(&self) -> f64 {
        f64::from(self.both) / f64::from(self.either)
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / f64::from(u32::try_from(values.len()).unwrap())
}

#[test]
fn visibility_agrees_with_a_picture_of_labels() {
    agrees_with_labels(Body::Mannequin, 210);
    agrees_with_labels(Body::Humanoid, 120);
}

#[test]
#[ignore = "`make soak`: a minute"]
fn soak_labels_of_two_hundred_humanoid_poses() {
    agrees_with_labels(Body::Humanoid, 210);
}

fn agrees_with_labels(shape: Body, poses: i32) {
    need::drawing();
    let mut eye = LabelCamera::new(&shaped(shape), 640, 480);
    let (mut same, mut all) = (0_usize, 0_usize);
    let mut overlaps = Vec::new();
    for_scattered(shape, &WITH_MIRROR, poses, |world| {
        let cast = labels(world, 640, 480);
        let drawn = eye.labels(world);
        all += cast.codes.len();
        same += cast.codes.iter().zip(&drawn.codes).filter(|(cast, drawn)| cast == drawn).count();
        let pairs = cast.codes.iter().zip(&drawn.codes);
        let own = Overlap::of(pairs.map(|(cast, drawn)| (*cast == OWN.code(), *drawn == OWN.code())));
        if own.either >= 30 {
            overlaps.push(own.share());
        }
    });
    println!(
        "{} of {all} pixels differ; own body in {} views, mean overlap {}",
        all - same,
        overlaps.len(),
        mean(&overlaps)
    );
    assert!((all - same) * 1000 < all, "{} of {all} pixels differ", all - same);
    assert!(overlaps.len() * 8 > usize::try_from(poses).unwrap(), "the own body is in {} views alone", overlaps.len());
    assert!(mean(&overlaps) > 0.99 && overlaps.iter().all(|share| *share >= 0.95), "{overlaps:?}");
}

#[test]
fn visibility_agrees_with_mujocos_rays() {
    for shape in Body::ALL {
        let (mut differ, mut all) = (0_usize, 0_usize);
        for_scattered(shape, &WITH_MIRROR, 60, |world| {
            let cast = labels(world, 160, 120);
            let met = labels_by_mujoco(world, 160, 120);
            differ += cast.codes.iter().zip(&met.codes).filter(|(cast, met)| cast != met).count();
            all += cast.codes.len();
        });
        assert_eq!(differ, 0, "of {all}, {shape:?}");
    }
}

#[test]
fn visibility_counts_the_labels() {
    for_scattered(WorldConfig::default().body.shape, &[Experiment::E4, Experiment::E5, Experiment::E2], 30, |world| {
        let visibility = world.visibility();
        let image = labels(world, 640, 480);
        let count = |shown: Shown| image.codes.iter().map(|code| u32::from(*code == shown.code())).sum::<u32>();
        assert_eq!(visibility.view_px, 640 * 480);
        assert_eq!(visibility.self_px, count(OWN));
        for (at, other) in visibility.others.iter().enumerate() {
            assert_eq!(other.direct_px, count(Shown::Direct(Item::Agent(at + 1))));
            assert_eq!(other.mirror_px, count(Shown::Through(0, Item::Agent(at + 1))));
        }
        for (at, cube) in visibility.cubes.iter().enumerate() {
            assert_eq!(cube.direct_px, count(Shown::Direct(Item::Cube(at))));
            assert_eq!(cube.mirror_px, count(Shown::Through(0, Item::Cube(at))));
        }
        let in_mirror = |code: &&u8| matches!(Shown::of_code(**code), Shown::Through(0, _));
        assert_eq!(visibility.mirror_px as usize, image.codes.iter().filter(in_mirror).count());
        assert_eq!(visibility.other_px, visibility.others.iter().map(|other| other.mirror_px).sum::<u32>());
    });
}

/// The palette colour nearest to a pixel under any light; `None` for the grey of heads and rooms.
fn likest(pixel: &[u8]) -> Option<Color> {
    let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(f64::from);
    // Paint under different light.
    let palette = Color::ALL.into_iter().flat_map(|color| {
        [0.65, 0.8, 0.95].map(|light| (Some(color), color.rgb().map(|part| light * f64::from(part))))
    });
    let neutral = [60.0, 80.0, 95.0, 110.0, 125.0].map(|grey| (None, [grey, grey * 1.02, grey * 1.06]));
    let distance = |[r, g, b]: [f64; 3]| (red - r).powi(2) + (green - g).powi(2) + (blue - b).powi(2);
    palette.chain(neutral).min_by(|(_, one), (_, other)| distance(*one).total_cmp(&distance(*other)))?.0
}

/// Returns true if the pixel shows a head, which is darker than anything else without a colour.
fn is_head(pixel: &[u8]) -> bool {
    pixel.iter().all(|part| *part < 72) && pixel.iter().max().unwrap() - pixel.iter().min().unwrap() < 12
}

/// The pixels around the own body in the mirror.
struct Area {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Area {
    /// `None` if less than a hundred pixels show the body, or if a thing of the same colour is too near for colours to
    /// distinguish them.
    fn about_own_body(world: &World, cast: &LabelImage) -> Option<Self> {
        const MARGIN: usize = 8;
        let pixels = (0..480).flat_map(|y| (0..640).map(move |x| [x, y]));
        let own: Vec<[usize; 2]> = pixels.filter(|[x, y]| cast.at(*x, *y) == OWN).collect();
        let range = |axis: usize, most: usize| {
            let [low, high] = [own.iter().map(|at| at[axis]).min()?, own.iter().map(|at| at[axis]).max()?];
            Some(low.saturating_sub(MARGIN)..(high + MARGIN + 1).min(most))
        };
        let area = Self { columns: range(0, 640)?, rows: range(1, 480)? };
        let has_twin = area.pixels().any(|[x, y]| is_twin(world, cast.at(x, y)));
        (own.len() >= 100 && !has_twin).then_some(area)
    }

    fn pixels(&self) -> impl Iterator<Item = [usize; 2]> {
        self.rows.clone().flat_map(|y| self.columns.clone().map(move |x| [x, y]))
    }

    /// The overlap of the own body by visibility and by colour.
    fn overlap(&self, world: &World, cast: &LabelImage, frame: &Frame) -> Overlap {
        Overlap::of(self.pixels().map(|[x, y]| {
            let pixel = &frame.rgb[3 * (y * 640 + x)..][..3];
            let is_seen = likest(pixel) == Some(world.scene().body_color) || is_head(pixel);
            (cast.at(x, y) == OWN, is_seen)
        }))
    }
}

/// Returns true if another thing has the own body's colour, or is a head.
fn is_twin(world: &World, shown: Shown) -> bool {
    let own = world.scene().body_color;
    match shown {
        Shown::Direct(Item::Room) | Shown::Through(0, Item::Room) => false,
        Shown::Direct(Item::Cube(at)) | Shown::Through(0, Item::Cube(at)) => world.scene().cubes[at].color == own,
        Shown::Direct(_) => true,
        Shown::Through(_, item) => item != Item::Agent(0),
    }
}

#[test]
fn visibility_agrees_with_the_colours_of_the_picture() {
    let config = WorldConfig::default();
    need::drawing();
    let mut eye = Camera::new(&config).unwrap();
    let mut overlaps = Vec::new();
    for_scattered(config.body.shape, &WITH_MIRROR, 210, |world| {
        let cast = labels(world, 640, 480);
        if let Some(area) = Area::about_own_body(world, &cast) {
            overlaps.push(area.overlap(world, &cast, &eye.frame(world).unwrap()).share());
        }
    });
    println!("{} views, mean overlap {}", overlaps.len(), mean(&overlaps));
    assert!(overlaps.len() >= 15, "{}", overlaps.len());
    assert!(mean(&overlaps) > 0.9, "{overlaps:?}");
}

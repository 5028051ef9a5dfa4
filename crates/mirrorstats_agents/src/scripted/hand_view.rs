//! The view from behind a body, on a hand and a mark: small patches of paint, and their positions.
//!
//! The agent knows the protocol: the camera is 1.1 m behind the body, 2.0 m high and aimed at 1.7 m above the body's
//! spot. The mirror is 2.0 m ahead of the body; the mark is a square on its front, the hand about 0.1 m wide. A
//! reflection is as far behind the mirror as its original is before it.

use crate::Observation;
use crate::perception::patches::{ColorPatch, patches};
use crate::perception::real;
use mirrorstats_trace::schema::colors::Color;

/// The camera's distance behind the body's axis and its height above the floor, m.
const BACK: f64 = 1.1;
const HEIGHT: f64 = 2.0;
const DOWN: f64 = 0.3 / 1.1;
/// The distance from the body to the mirror, m.
const MIRROR: f64 = 2.0;
/// The distance of the body's front from its axis, m.
pub(super) const FRONT: f64 = 0.125;
/// The maximum side of a mark, m. A hand seen directly is nearer than a reflection, and looks larger.
const WIDEST: f64 = 0.2;
/// The maximum distance of a mark on the front to the side, m.
const ASIDE: f64 = 0.12;
const HEIGHTS: [f64; 2] = [0.85, 1.25];
/// The minimum height of things in the mirror, m: the body itself hides the mirror below.
const LOWEST: f64 = 0.3;
/// The minimum pixels of a hand or a mark in the mirror, and the maximum of all patches of its colour.
const LEAST: usize = 12;
const MOST: usize = 2600;

/// To the left and up, m.
pub(super) type Spot = [f64; 2];

#[derive(Clone, Debug, Default)]
pub(super) struct HandView {
    pub mark: Option<ColorPatch>,
    pub hand: Option<ColorPatch>,
}

impl HandView {
    /// Reads a picture. A colour that is also seen directly is the hand's; otherwise the mark is the colour that can be
    /// on the front of the body, the larger patch if both can.
    pub fn from_observation(observation: &Observation) -> Self {
        let eye = Eye::from_observation(observation);
        let all = patches(&observation.frame, LEAST);
        let small: Vec<Color> = Color::ALL.into_iter().filter(|color| is_small(&all, *color)).collect();
        let mut seen: Vec<(ColorPatch, bool)> =
            small.into_iter().filter_map(|color| eye.reflected(&all, color)).collect();
        seen.sort_by_key(|(patch, _)| std::cmp::Reverse(patch.pixels));
        let fits = |patch: &ColorPatch| eye.is_on_front(patch);
        let mark = seen.iter().position(|(patch, is_direct)| !is_direct && fits(patch));
        let mark = mark.map(|at| seen.remove(at).0);
        let hand = seen.iter().find(|(_, is_direct)| *is_direct).or_else(|| seen.first());
        Self { mark, hand: hand.map(|(patch, _)| *patch) }
    }
}

fn is_small(all: &[ColorPatch], color: Color) -> bool {
    let pixels: usize = all.iter().filter(|patch| patch.color == color).map(|patch| patch.pixels).sum();
    (1..=MOST).contains(&pixels)
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Eye {
    size: [f64; 2],
    /// Half of the view's height, one metre ahead.
    tangent: f64,
}

impl Eye {
    pub fn from_observation(observation: &Observation) -> Self {
        let frame = &observation.frame;
        Self { size: [real(frame.width), real(frame.height)], tangent: (observation.fov_y.to_radians() / 2.0).tan() }
    }

    /// The length of a row of pixels in the reflection of the body's front, m.
    fn length(&self, pixels: usize) -> f64 {
        2.0 * self.tangent / self.size[1] * real(pixels) * (BACK + 2.0 * MIRROR - FRONT)
    }

    /// The position of a thing `ahead` of the body whose reflection is in the middle of a patch.
    pub fn place(&self, patch: &ColorPatch, ahead: f64) -> Spot {
        let row = real(patch.top + patch.bottom + 1) / 2.0;
        let aside = (2.0 * patch.middle() / self.size[0] - 1.0) * self.tangent * self.size[0] / self.size[1];
        let above = (1.0 - 2.0 * row / self.size[1]) * self.tangent;
        let (cosine, sine) = (1.0 / (1.0 + DOWN * DOWN).sqrt(), DOWN / (1.0 + DOWN * DOWN).sqrt());
        let length = (BACK + 2.0 * MIRROR - ahead) / (cosine + above * sine);
        [-aside * length, HEIGHT + (above * cosine - sine) * length]
    }

    fn is_on_front(&self, patch: &ColorPatch) -> bool {
        let [left, up] = self.place(patch, FRONT);
        let widest = self.length(patch.width().max(patch.height()));
        left.abs() <= ASIDE && (HEIGHTS[0]..=HEIGHTS[1]).contains(&up) && widest <= WIDEST
    }

    fn reflected(&self, all: &[ColorPatch], color: Color) -> Option<(ColorPatch, bool)> {
        let of_color = || all.iter().filter(|patch| patch.color == color);
        let may_be = |patch: &&ColorPatch| {
            let [left, up] = self.place(patch, 0.4);
            left.abs() <= 1.0 && (LOWEST..=HEIGHT).contains(&up) && patch.width() <= 40
        };
        let found = of_color().filter(may_be).min_by_key(|patch| patch.pixels)?;
        let is_direct = of_color().any(|patch| patch.pixels > 2 * found.pixels.max(60));
        Some((*found, is_direct))
    }
}

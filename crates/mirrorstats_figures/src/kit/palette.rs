//! Colours, markers and dashes, read once from `assets/palette.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::sheet::{Rgb, Stroke, many};

pub(crate) static PALETTE: LazyLock<Palette> = LazyLock::new(|| {
    let text = include_str!("../../../../assets/palette.toml");
    toml::from_str(text).expect("the built-in palette is well-formed: a test reads it")
});

#[derive(Debug, Deserialize)]
pub struct Palette {
    /// The models with a fixed style: the one at their index.
    pub(crate) pinned: Vec<String>,
    pub surface: Surface,
    pub(crate) ramp: Ramps,
    pub outcome: Outcome,
    pub gaze: Gaze,
    pub style: Vec<ModelStyle>,
}

#[derive(Debug, Deserialize)]
pub struct Surface {
    pub text: Rgb,
    /// Secondary text.
    pub quiet: Rgb,
    pub rule: Rgb,
    pub axis: Rgb,
    pub paper: Rgb,
    pub(crate) hatch: Rgb,
    pub chance: Rgb,
    pub reference: Rgb,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Ramps {
    /// From the worst to the best.
    pub(crate) goodness: Ramp,
    /// From zero to the largest rise.
    pub rise: Ramp,
    /// From zero to the largest fall.
    pub fall: Ramp,
}

#[derive(Debug, Deserialize)]
pub struct Outcome {
    pub correct: Rgb,
    pub wrong: Rgb,
    pub uncommitted: Rgb,
}

#[derive(Debug, Deserialize)]
pub struct Gaze {
    pub episode: Rgb,
    /// Steps with the mirror in view.
    pub visible: Rgb,
    pub first_sight: Rgb,
    /// The first claim of a colour.
    pub claim: Rgb,
    pub decision: Rgb,
}

#[derive(Debug, Deserialize)]
pub struct ModelStyle {
    pub color: Rgb,
    pub(crate) marker: Shape,
    #[serde(default)]
    pub hollow: bool,
    pub(crate) dash: Vec<f64>,
}

impl ModelStyle {
    pub(crate) fn stroke(&'static self, width: f64) -> Stroke {
        Stroke { color: self.color, width, dash: &self.dash }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    Circle,
    Square,
    Triangle,
    TriangleDown,
    Diamond,
    Pentagon,
    Hexagon,
    Star,
    Cross,
    Bar,
}

/// Colours at even distances, with linear interpolation.
#[derive(Debug, Deserialize)]
pub(crate) struct Ramp(Vec<Rgb>);

impl Ramp {
    /// The colour at `share` of the range, clamped to [0, 1].
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the ramp by construction")]
    pub fn at(&self, share: f64) -> Rgb {
        let steps = self.0.len().saturating_sub(1);
        let place = share.clamp(0.0, 1.0) * many(steps);
        let below = (place.floor() as usize).min(steps.saturating_sub(1));
        let part = place - many(below);
        let (from, to) = (self.0[below], self.0[(below + 1).min(steps)]);
        let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * part).round() as u8;
        Rgb(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
    }
}

/// The colour of readable text on `ground`, by relative luminance as defined by WCAG.
pub(crate) fn text_on(ground: Rgb) -> Rgb {
    // The luminance at which contrast with white and with the text colour is about equal.
    const MIDDLE: f64 = 0.21;
    let surface = &PALETTE.surface;
    if luminance(ground) < MIDDLE { surface.paper } else { surface.text }
}

/// Relative luminance in [0, 1] (WCAG 2.2).
pub(crate) fn luminance(Rgb(red, green, blue): Rgb) -> f64 {
    let linear = |channel: u8| {
        let share = f64::from(channel) / 255.0;
        if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    };
    0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::{PALETTE, Ramp, luminance};

    #[test]
    fn twenty_models_can_be_told_apart_without_colour() {
        let kinds: HashSet<_> = PALETTE.style.iter().map(|style| (style.marker, style.hollow)).collect();
        assert_eq!((PALETTE.style.len(), kinds.len()), (20, 20));
        assert!(PALETTE.pinned.len() < PALETTE.style.len());
    }

    #[test]
    fn every_model_stands_out_from_the_paper() {
        for style in &PALETTE.style {
            assert!(1.05 / (luminance(style.color) + 0.05) > 2.0, "{style:?}");
        }
    }

    #[test]
    fn ramps_darken_all_the_way_so_that_grey_print_keeps_the_order() {
        let falls = |ramp: &Ramp| {
            (0..100).all(|i| {
                let at = |i: i32| luminance(ramp.at(f64::from(i) / 100.0));
                at(i) > at(i + 1)
            })
        };
        assert!(falls(&PALETTE.ramp.goodness) && falls(&PALETTE.ramp.rise) && falls(&PALETTE.ramp.fall));
    }

    #[test]
    fn outcomes_differ_in_lightness() {
        let outcome = &PALETTE.outcome;
        let [dark, middle, light] = [outcome.correct, outcome.wrong, outcome.uncommitted].map(luminance);
        assert!(dark + 0.2 < middle && middle + 0.2 < light);
    }
}

//! The colour of a pixel.
//!
//! Light scales a paint: it keeps the ratio of red, green and blue and reduces brightness. A pixel has the palette
//! colour that some light maps most closely to it, or none if grey light on grey fits better. White paint and grey
//! walls differ in brightness, which depends on light, and in tint: walls are never quite without one.
//!
//! Rule: each pixel is classified independently. Edge pixels between two things are mixtures and may get any colour;
//! they are few, so callers require more than a few pixels.

use std::sync::LazyLock;

use mirrorstats_trace::schema::colors::Color;

/// The minimum and maximum light on things in a lit room.
const LIGHT: (f64, f64) = (0.50, 1.05);
/// An untinted pixel is white from this brightness on, of 255.
const WHITE: u8 = 128;
/// The largest difference between the channels of white paint.
const TINT: u8 = 3;
/// The margin by which a colour must be nearer than grey, so that a tinted wall is not taken for paint.
const FAVOR_OF_GREY: f64 = 14.0;
/// The significant bits of a channel.
const BITS: u32 = 6;

/// The precomputed answer for every pixel: the index into [`Color::ALL`], or `NONE`.
static TABLE: LazyLock<Vec<u8>> = LazyLock::new(table);
const NONE: u8 = u8::MAX;

/// The colour of the palette that a pixel (red, green, blue) shows; `None` where it is grey.
pub fn color(pixel: &[u8]) -> Option<Color> {
    let (least, most) = (pixel[..3].iter().min()?, pixel[..3].iter().max()?);
    if most - least <= TINT {
        return (*least >= WHITE).then_some(Color::White);
    }
    let step = |channel: u8| usize::from(channel >> (8 - BITS));
    let at = pixel[..3].iter().fold(0, |at, &channel| (at << BITS) | step(channel));
    Color::ALL.get(usize::from(TABLE[at])).copied()
}

#[expect(clippy::cast_precision_loss, reason = "channels are 0..256")]
fn table() -> Vec<u8> {
    let middle = |step: usize| ((step << (8 - BITS)) + (1 << (7 - BITS))) as f64;
    let mask = (1 << BITS) - 1;
    (0..1_usize << (3 * BITS))
        .map(|at| nearest([middle(at >> (2 * BITS)), middle((at >> BITS) & mask), middle(at & mask)]))
        .collect()
}

fn nearest(pixel: [f64; 3]) -> u8 {
    let grey = pixel.iter().sum::<f64>() / 3.0;
    let mut best = (distance(pixel, [grey; 3]) - FAVOR_OF_GREY, NONE);
    for (color, index) in Color::ALL.into_iter().zip(0_u8..) {
        let away = unexplained(pixel, color.rgb().map(f64::from));
        if color != Color::White && away < best.0 {
            best = (away, index);
        }
    }
    best.1
}

fn unexplained(pixel: [f64; 3], paint: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let light = (dot(pixel, paint) / dot(paint, paint)).clamp(LIGHT.0, LIGHT.1);
    distance(pixel, paint.map(|channel| (light * channel).min(255.0)))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2])
}

/// A paint in the medium light of a room.
#[cfg(test)]
pub fn lit(color: Color) -> [u8; 3] {
    color.rgb().map(|channel| u8::try_from(u16::from(channel) * 4 / 5).unwrap())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_paint_is_named_in_dim_and_in_full_light() {
        for paint in Color::ALL {
            for percent in (60..=100).step_by(5) {
                let pixel = paint.rgb().map(|channel| u8::try_from(u16::from(channel) * percent / 100).unwrap());
                assert_eq!(color(&pixel), Some(paint), "{paint:?} at {percent} %: {pixel:?}");
            }
        }
    }

    #[test]
    fn greys_and_tinted_greys_have_no_color() {
        for level in 0..=250_u8 {
            assert_eq!(color(&[level, level.saturating_add(2), level.saturating_add(5)]), None, "{level}, bluish");
            let dark = level / 2;
            assert_eq!(color(&[dark, dark, dark]), None, "{dark}");
        }
    }
}

//! The one font of all figures: embedded, measured, and included in each SVG.
//!
//! Rule: every width used for layout comes from the font's own advances. Kerning is ignored; it only makes Latin text
//! slightly narrower than the layout reserves.

use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ttf_parser::Face;

use mirrorstats_exact::escape::visible;

/// The family name, which is private, so that no installed font replaces it.
pub(crate) const FAMILY: &str = "Mirrorstats Sans";
const SUBSTITUTE: char = '\u{25a1}';
const REGULAR: &[u8] = include_bytes!("../../../../../assets/fonts/MirrorstatsSans-Regular.ttf");
const SEMIBOLD: &[u8] = include_bytes!("../../../../../assets/fonts/MirrorstatsSans-Semibold.ttf");
const REGULAR_WEB: &[u8] = include_bytes!("../../../../../assets/fonts/MirrorstatsSans-Regular.woff2");
const SEMIBOLD_WEB: &[u8] = include_bytes!("../../../../../assets/fonts/MirrorstatsSans-Semibold.woff2");

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Weight {
    #[default]
    Regular,
    Semibold,
}

struct Faces {
    regular: Face<'static>,
    semibold: Face<'static>,
}

static FACES: LazyLock<Faces> = LazyLock::new(|| {
    let parse = |data| Face::parse(data, 0).expect("the embedded font is whole: a test draws with it");
    Faces { regular: parse(REGULAR), semibold: parse(SEMIBOLD) }
});

fn face(weight: Weight) -> &'static Face<'static> {
    match weight {
        Weight::Regular => &FACES.regular,
        Weight::Semibold => &FACES.semibold,
    }
}

#[cfg(feature = "raster")]
pub(crate) const FILES: [&[u8]; 2] = [REGULAR, SEMIBOLD];

/// The width of `text` on one line at `size` px, in px.
pub fn width(text: &str, size: f64, weight: Weight) -> f64 {
    let face = face(weight);
    let advance = |c: char| {
        let glyph = face.glyph_index(c).or_else(|| face.glyph_index(SUBSTITUTE));
        glyph.and_then(|glyph| face.glyph_hor_advance(glyph)).unwrap_or(face.units_per_em())
    };
    let units: u32 = text.chars().map(|c| u32::from(advance(c))).sum();
    f64::from(units) * size / f64::from(face.units_per_em())
}

/// The distance from the middle of the capitals down to the baseline, in px.
pub(crate) fn drop_to_baseline(size: f64) -> f64 {
    let face = face(Weight::Regular);
    let capital = face.capital_height().unwrap_or(0);
    f64::from(capital) * size / f64::from(face.units_per_em()) / 2.0
}

/// `text` in characters of the font. Blanks and control characters become spaces, characters that act or hide are
/// spelled out, others become a hollow square.
pub(crate) fn drawable(text: &str) -> String {
    let has = |c: char| face(Weight::Regular).glyph_index(c).is_some();
    let blank = |c: char| c.is_whitespace() || c.is_control();
    let text: String = text.chars().map(|c| if blank(c) { ' ' } else { c }).collect();
    let spelled: String = visible(&text).chars().map(|c| if has(c) { c } else { SUBSTITUTE }).collect();
    spelled.split(' ').filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

pub fn style_sheet() -> String {
    [(400, REGULAR_WEB), (600, SEMIBOLD_WEB)]
        .map(|(weight, data)| {
            format!(
                "@font-face{{font-family:'{FAMILY}';font-weight:{weight};\
                 src:url(data:font/woff2;base64,{}) format('woff2')}}",
                STANDARD.encode(data)
            )
        })
        .concat()
}

#[cfg(test)]
mod tests {
    use super::{Weight, drawable, width};

    #[test]
    fn widths_add_up_and_digits_are_all_alike() {
        let size = 10.0;
        let together = width("Gemini 2.5", size, Weight::Regular);
        let apart = width("Gemini", size, Weight::Regular) + width(" 2.5", size, Weight::Regular);
        assert!((together - apart).abs() < 1e-9 && together > 0.0);
        for digit in '1'..='9' {
            let found = width(&digit.to_string(), size, Weight::Regular);
            assert!((found - width("0", size, Weight::Regular)).abs() < 1e-9, "{digit}");
        }
    }

    #[test]
    fn unknown_characters_are_drawn_as_one_box_and_blanks_collapse() {
        assert_eq!(drawable("a\u{4e2d}\u{6587}b"), "a□□b");
        assert_eq!(drawable("  a\t\n b\u{0}"), "a b");
        assert_eq!(drawable("Ωμέγα Ж é"), "Ωμέγα Ж é");
        assert_eq!(drawable("a\u{ad}\u{202e}b"), "a\\u{ad}\\u{202e}b");
    }
}

//! Text: few styles and sizes, so that readers see which texts belong together, in one font, which each SVG includes.
//!
//! Rule: every width used for layout comes from the font's own advances. Kerning is ignored; it only makes Latin text
//! slightly narrower than the layout reserves.

use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, FontDesc, FontFamily, FontStyle, FontTransform, TextStyle};
use ttf_parser::Face;

use super::palette::PALETTE;
use super::sheet::Rgb;
use super::svg::size_units;
use mirrorstats_exact::escape::visible;

/// The empty margin of every figure, px.
pub const MARGIN: f64 = 8.0;
/// The width of a full-width figure, px: its smallest text exceeds 5 pt at a text width of 5.5 inches.
pub(crate) const FULL_WIDTH: f64 = 640.0;
/// The most room for names of models beside rows or in a legend, px.
pub(crate) const NAME_ROOM: f64 = 210.0;

/// The family name, which is private, so that no installed font replaces it.
pub(crate) const FAMILY: &str = "Mirrorstats Sans";
const SUBSTITUTE: char = '\u{25a1}';
/// The regular and the semibold face.
pub(super) const FILES: [&[u8]; 2] = [
    include_bytes!("../../../../assets/fonts/MirrorstatsSans-Regular.ttf"),
    include_bytes!("../../../../assets/fonts/MirrorstatsSans-Semibold.ttf"),
];
const WEB_FILES: [(u16, &[u8]); 2] = [
    (400, include_bytes!("../../../../assets/fonts/MirrorstatsSans-Regular.woff2")),
    (600, include_bytes!("../../../../assets/fonts/MirrorstatsSans-Semibold.woff2")),
];

static FACES: LazyLock<[Face<'static>; 2]> =
    LazyLock::new(|| FILES.map(|data| Face::parse(data, 0).expect("the embedded font is whole: a test draws with it")));

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    Regular,
    Semibold,
}

impl Weight {
    fn face(self) -> &'static Face<'static> {
        &FACES[self as usize]
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextAnchor {
    Start,
    Middle,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lettering {
    pub size: f64,
    pub weight: Weight,
    pub color: Rgb,
    pub align: TextAnchor,
    pub upwards: bool,
}

impl Lettering {
    pub const fn new(size: f64, color: Rgb) -> Self {
        Self { size, weight: Weight::Regular, color, align: TextAnchor::Start, upwards: false }
    }

    pub(crate) const fn semibold(self) -> Self {
        Self { weight: Weight::Semibold, ..self }
    }

    pub(crate) const fn aligned(self, align: TextAnchor) -> Self {
        Self { align, ..self }
    }

    pub(crate) const fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }

    pub(super) fn style(self) -> TextStyle<'static> {
        let style = if self.weight == Weight::Semibold { FontStyle::Bold } else { FontStyle::Normal };
        let turn = if self.upwards { FontTransform::Rotate270 } else { FontTransform::None };
        let anchor = match self.align {
            TextAnchor::Start => HPos::Left,
            TextAnchor::Middle => HPos::Center,
            TextAnchor::End => HPos::Right,
        };
        let font = FontDesc::new(FontFamily::Name(FAMILY), f64::from(size_units(self.size)), style).transform(turn);
        TextStyle { font, color: self.color.to_backend_color(), pos: Pos::new(anchor, VPos::Center) }
    }

    /// The width of `text` on one line, px.
    pub fn width(self, text: &str) -> f64 {
        let face = self.weight.face();
        let advance = |c: char| {
            let glyph = face.glyph_index(c).or_else(|| face.glyph_index(SUBSTITUTE));
            glyph.and_then(|glyph| face.glyph_hor_advance(glyph)).unwrap_or(face.units_per_em())
        };
        let units: u32 = text.chars().map(|c| u32::from(advance(c))).sum();
        f64::from(units) * self.size / f64::from(face.units_per_em())
    }

    /// The width of the widest of `texts`, px.
    pub(crate) fn widest<T: AsRef<str>>(self, texts: impl IntoIterator<Item = T>) -> f64 {
        texts.into_iter().map(|text| self.width(text.as_ref())).fold(0.0, f64::max)
    }
}

pub fn heading() -> Lettering {
    Lettering::new(11.5, PALETTE.surface.text).semibold()
}

/// Names of models and metrics.
pub(crate) fn label() -> Lettering {
    Lettering::new(10.0, PALETTE.surface.text)
}

/// Numbers beside an axis, subheadings, notes and keys.
pub(crate) fn tick() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.quiet)
}

/// Numbers inside the plot.
pub fn value() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.text)
}

pub(crate) fn leading(lettering: Lettering) -> f64 {
    (lettering.size * 1.25).ceil()
}

/// The distance from the middle of the capitals down to the baseline, px.
pub(super) fn drop_to_baseline(size: f64) -> f64 {
    let face = Weight::Regular.face();
    let capital = face.capital_height().unwrap_or(0);
    f64::from(capital) * size / f64::from(face.units_per_em()) / 2.0
}

/// `text` in characters of the font. Blanks and control characters become spaces, characters that act or hide are
/// spelled out, others become a hollow square.
pub(super) fn drawable(text: &str) -> String {
    let has = |c: char| Weight::Regular.face().glyph_index(c).is_some();
    let blank = |c: char| c.is_whitespace() || c.is_control();
    let text: String = text.chars().map(|c| if blank(c) { ' ' } else { c }).collect();
    let spelled: String = visible(&text).chars().map(|c| if has(c) { c } else { SUBSTITUTE }).collect();
    spelled.split(' ').filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

pub fn style_sheet() -> String {
    let face = |(weight, data): (u16, &[u8])| {
        let data = STANDARD.encode(data);
        format!(
            "@font-face{{font-family:'{FAMILY}';font-weight:{weight};\
             src:url(data:font/woff2;base64,{data}) format('woff2')}}"
        )
    };
    WEB_FILES.map(face).concat()
}

#[cfg(test)]
mod tests {
    use super::{drawable, label};

    #[test]
    fn widths_add_up_and_digits_are_all_alike() {
        let width = |text: &str| label().width(text);
        let (together, apart) = (width("Gemini 2.5"), width("Gemini") + width(" 2.5"));
        assert!((together - apart).abs() < 1e-9 && together > 0.0);
        for digit in '1'..='9' {
            assert!((width(&digit.to_string()) - width("0")).abs() < 1e-9, "{digit}");
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

//! Colours are checked values: lower-case names, from the palette if a trace declares one.
//!
//! Metrics compare colours byte by byte, so `Red` beside `red` would turn a right answer into a wrong one.
//!
//! Rule: the scan, `validate`, `import`, the writer and the check on Spark all use this module. It checks each value by
//! itself; `validate::color_set` checks those of all inputs together.

pub mod palette;
pub mod spelling;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::palette::Palette;
use self::spelling::{WORDS, did_you_mean, is_well_spelled, meant_by, normal, spelling_key, study_color};
pub use super::column::ColorColumn;
use crate::schema;

mirrorstats_exact::names! {
    /// A colour of the palette.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "lowercase")]
    pub enum Color {
        Blue = "blue",
        Brown = "brown",
        Cyan = "cyan",
        Green = "green",
        Orange = "orange",
        Pink = "pink",
        Purple = "purple",
        Red = "red",
        White = "white",
        Yellow = "yellow",
    }
}

impl Color {
    /// The paint of this colour: red, green and blue. Shading makes it darker in a picture.
    pub const fn rgb(self) -> [u8; 3] {
        match self {
            Self::Blue => [25, 60, 225],
            Self::Brown => [112, 60, 16],
            Self::Cyan => [0, 215, 230],
            Self::Green => [20, 160, 40],
            Self::Orange => [255, 125, 0],
            Self::Pink => [255, 130, 190],
            Self::Purple => [130, 30, 190],
            Self::Red => [215, 15, 20],
            Self::White => [255, 255, 255],
            Self::Yellow => [250, 225, 0],
        }
    }
}

pub fn columns() -> impl Iterator<Item = ColorColumn> {
    schema::COLUMNS.iter().filter_map(|column| column.color)
}

pub fn column(name: &str) -> Option<ColorColumn> {
    schema::column(name)?.color
}

impl ColorColumn {
    /// Returns true if the column allows this text. The rule about names covers empty text.
    pub fn may_hold(self, text: &str, palette: Option<&Palette>) -> bool {
        if text.is_empty() || self.word == Some(text) {
            return true;
        }
        match palette {
            Some(palette) => palette.has(text),
            None => !WORDS.contains(&text) && is_well_spelled(text),
        }
    }

    pub fn expected(self, palette: Option<&Palette>) -> String {
        let colors = match palette {
            Some(palette) => format!("a colour of the palette ({})", listed(palette)),
            None => "the lower-case name of a colour".to_owned(),
        };
        let word = self.word.map(|word| format!(", `{word}`")).unwrap_or_default();
        let null = if schema::column(self.name).is_some_and(|column| column.nullable) { ", or null" } else { "" };
        format!("{colors}{word}{null}")
    }

    /// The remedy for a text that the column does not allow.
    pub fn help(self, text: &str, palette: Option<&Palette>) -> String {
        let likely = normal(text);
        if likely.is_empty() || WORDS.contains(&likely.as_str()) && self.word != Some(likely.as_str()) {
            return self.advice.to_owned();
        }
        if self.word == Some(likely.as_str()) {
            return did_you_mean(&likely);
        }
        let like = if is_well_spelled(&likely) { likely } else { spelling_key(text) };
        let Some(palette) = palette else { return meant_by(text, study_color(text).unwrap_or(&like)) };
        match palette.nearest(text) {
            Some(color) => meant_by(text, color),
            None => "use a name of the palette, or add the colour to the palette".to_owned(),
        }
    }
}

/// The first names of a palette: each finding repeats them.
fn listed(palette: &Palette) -> String {
    const MOST: usize = 20;
    let names = palette.names();
    let shown: Vec<&str> = names.iter().take(MOST).map(String::as_str).collect();
    let more = if names.len() > MOST { format!(", and {} more", names.len() - MOST) } else { String::new() };
    shown.join(", ") + &more
}

#[cfg(test)]
mod tests {
    use super::palette::Palette;
    use super::spelling::normal;
    use super::{WORDS, column, columns};
    use crate::schema;

    /// Texts that no column allows without a palette, and the colour meant.
    const MISSPELLED: [(&str, &str); 12] = [
        ("Red", "red"),
        ("RED", "red"),
        (" red", "red"),
        ("red ", "red"),
        ("red\u{a0}", "red"),
        ("red\n", "red"),
        ("\u{feff}red", "red"),
        ("r\u{200b}ed", "red"),
        ("re d", "red"),
        ("dark\u{a0}red", "dark red"),
        ("dark  red", "dark red"),
        ("Teal", "teal"),
    ];

    #[test]
    fn every_color_column_is_in_the_schema() {
        assert!(columns().all(|color| schema::column(color.name).is_some_and(schema::Column::names)));
        assert!(columns().filter_map(|color| color.word).all(|word| WORDS.contains(&word)));
        assert_eq!(column("action"), None);
    }

    #[test]
    fn names_with_other_case_or_white_space_are_refused() {
        for column in columns() {
            for (text, meant) in MISSPELLED {
                assert!(!column.may_hold(text, None), "{} {text:?}", column.name);
                assert_eq!(column.help(text, None), format!("did you mean `{meant}`?"), "{} {text:?}", column.name);
                assert_eq!(normal(&normal(text)), normal(text));
            }
            for text in
                ["red", "teal", "dark red", "dark-red", "olive2", "grün", "gru\u{308}n", "красный", "赤い色", ""]
            {
                assert!(column.may_hold(text, None), "{} {text:?}", column.name);
            }
        }
    }

    #[test]
    fn each_special_word_is_valid_in_its_own_column() {
        let holds = |name: &str, text| column(name).unwrap().may_hold(text, None);
        for name in ["body_color", "stated_color", "self_color", "selected_cube"] {
            assert_eq!(holds(name, "unknown"), name == "self_color");
            assert_eq!(holds(name, "none"), name == "selected_cube");
            assert!(!holds(name, "None") && !holds(name, "UNKNOWN") && !holds(name, "unknown "), "{name}");
        }
        let help = |name: &str, text| column(name).unwrap().help(text, None);
        assert_eq!(help("self_color", "Unknown"), "did you mean `unknown`?");
        assert_eq!(help("self_color", "NONE"), "`unknown`, or null where the reply gave none");
        assert_eq!(help("selected_cube", "unknown"), "`none`, or null where the reply gave none");
        assert_eq!(help("body_color", "none"), "give the true colour of the body");
        assert_eq!(help("stated_color", "\u{a0}"), "null where no colour was stated");
    }

    #[test]
    fn only_colors_of_the_palette_are_valid() {
        let palette = Palette::new(["teal", "magenta"].map(str::to_owned));
        let [body, claim] = [column("body_color").unwrap(), column("self_color").unwrap()];
        assert!(claim.may_hold("teal", Some(&palette)) && claim.may_hold("unknown", Some(&palette)));
        for (text, help) in [
            ("Teal", "did you mean `teal`?"),
            ("magneta", "did you mean `magenta`?"),
            ("red", "use a name of the palette, or add the colour to the palette"),
        ] {
            assert!(!body.may_hold(text, Some(&palette)), "{text}");
            assert_eq!(body.help(text, Some(&palette)), help);
        }
        assert!(!body.may_hold("unknown", Some(&palette)));
        assert_eq!(claim.expected(Some(&palette)), "a colour of the palette (teal, magenta), `unknown`, or null");
        assert_eq!(body.expected(None), "the lower-case name of a colour");
    }
}

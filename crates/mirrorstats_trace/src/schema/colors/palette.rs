//! The colours in the footer's `mirrorstats.recording`: `palette`, a list of names, or the statement that the world is
//! this program's, with the colours of the study.

use indexmap::IndexSet;
use serde_json::Value;

use super::spelling::{WORDS, did_you_mean, is_well_spelled, most_like, normal, study_color};
use crate::diagnostic::{Code, Finding};
use crate::schema::RECORDING_KEY;
use crate::schema::colors::Color;
use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_exact::escape::visible;

/// Each value that is not in a palette is compared with all of it. The names of the xkcd colour survey are 954.
const MOST_COLORS: Limit = Limit::new("colours of a palette", 1000);

/// The colours of a recording; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Palette(IndexSet<String>);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPalette {
    #[error("expected at least one colour, found none")]
    Empty,
    #[error("expected lower-case names of colours, found `{}`{}", visible(found), hint(meant.as_deref()))]
    NoColor { found: String, meant: Option<String> },
    #[error("expected each colour once, found `{0}` twice")]
    Twice(String),
    #[error(transparent)]
    TooMany(#[from] Exceeded),
}

fn hint(meant: Option<&str>) -> String {
    meant.map_or_else(String::new, |meant| format!("; {}", did_you_mean(meant)))
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct DeclaredPalette {
    pub(crate) palette: Option<Palette>,
    is_of_world: bool,
}

impl DeclaredPalette {
    pub(crate) fn from_recording(file: &str, recording: &Value) -> Result<Self, Box<Finding>> {
        let said = |key: &str| recording.get(key).filter(|value| !value.is_null());
        let palette = said("palette").map(|palette| Palette::read(file, palette)).transpose()?;
        Ok(Self { palette, is_of_world: said("scene_version").is_some() })
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        match &self.palette {
            Some(palette) => palette.has(name),
            None => self.is_of_world && Color::named(name).is_some(),
        }
    }
}

impl Palette {
    pub fn new(names: impl IntoIterator<Item = String>) -> Self {
        Self(names.into_iter().collect())
    }

    pub fn of_study() -> Self {
        Self::new(Color::ALL.map(|color| color.name().to_owned()))
    }

    pub fn of_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, NoPalette> {
        let mut palette: IndexSet<String> = IndexSet::new();
        for name in names {
            if !is_color(name) {
                let meant = Some(study_color(name).map_or_else(|| normal(name), str::to_owned));
                return Err(NoPalette::NoColor {
                    found: name.to_owned(),
                    meant: meant.filter(|meant| is_color(meant)),
                });
            }
            if !palette.insert(name.to_owned()) {
                return Err(NoPalette::Twice(name.to_owned()));
            }
        }
        MOST_COLORS.check(palette.len() as u64)?;
        if palette.is_empty() { Err(NoPalette::Empty) } else { Ok(Self(palette)) }
    }

    fn read(file: &str, palette: &Value) -> Result<Self, Box<Finding>> {
        let listed = palette.as_array().map_or(0, Vec::len);
        MOST_COLORS.check(listed as u64).map_err(|exceeded| Finding::over_budget(file, &exceeded))?;
        let names: Option<IndexSet<String>> = serde_json::from_value(palette.clone()).ok();
        match names.filter(|names| !names.is_empty() && names.iter().all(|name| is_color(name))) {
            Some(names) => Ok(Self(names)),
            None => Err(Box::new(invalid(file, palette))),
        }
    }

    /// The names of all these palettes, in order; `None` if a palette is missing, or there are none.
    pub fn of_all<'a>(palettes: impl Iterator<Item = Option<&'a Self>>) -> Option<Self> {
        let mut names: IndexSet<String> = IndexSet::new();
        for palette in palettes {
            names.extend(palette?.0.iter().cloned());
        }
        (!names.is_empty()).then_some(Self(names))
    }

    /// The names, in footer order.
    pub const fn names(&self) -> &IndexSet<String> {
        &self.0
    }

    pub(crate) fn has(&self, text: &str) -> bool {
        self.0.contains(text)
    }

    pub(super) fn nearest(&self, text: &str) -> Option<&str> {
        most_like(text, self.0.iter().map(String::as_str))
    }
}

fn is_color(name: &str) -> bool {
    !name.is_empty() && !WORDS.contains(&name) && is_well_spelled(name)
}

fn invalid(file: &str, palette: &Value) -> Finding {
    const LONGEST: usize = 80;
    let shown: String = palette.to_string().chars().take(LONGEST).collect();
    let expected = format!("`palette` in `{RECORDING_KEY}` to be a list of lower-case names of colours");
    Finding::new(Code::InvalidMetadata, file, expected, format!("`{}`", visible(&shown)))
        .with_help("correct the palette in the footer, or leave it out")
}

#[cfg(test)]
mod tests {
    use super::{DeclaredPalette, Palette};
    use crate::footers::recording;
    use crate::schema::colors::Color;

    #[test]
    fn a_declared_palette_is_read() {
        let names = |text| DeclaredPalette::from_recording("a.parquet", &recording(Some(text))).unwrap().palette;
        assert_eq!(
            names(r#"{"world":{},"palette":["teal","dark red"]}"#),
            Some(Palette::new(["teal".into(), "dark red".into()]))
        );
        for text in ["{}", r#"{"palette":null}"#, "no JSON", "7"] {
            assert_eq!(names(text), None, "{text}");
        }
        assert_eq!(DeclaredPalette::from_recording("a.parquet", &recording(None)).unwrap(), DeclaredPalette::default());
    }

    #[test]
    fn a_recording_of_this_world_has_the_colors_of_the_study() {
        let has = |text, name| DeclaredPalette::from_recording("a.parquet", &recording(Some(text))).unwrap().has(name);
        assert!(has(r#"{"scene_version":1}"#, "pink") && !has(r#"{"scene_version":1}"#, "teal"));
        assert!(!has(r#"{"kind":"import"}"#, "pink"));
        assert!(has(r#"{"scene_version":1,"palette":["teal"]}"#, "teal"));
        assert!(!has(r#"{"scene_version":1,"palette":["teal"]}"#, "pink"));
    }

    #[test]
    fn invalid_palettes_have_a_reason() {
        let palette = |names: &[&'static str]| Palette::of_names(names.iter().copied());
        assert!(palette(&["teal", "dark red"]).unwrap().names().iter().eq(["teal", "dark red"]));
        let many: Vec<String> = (0..1001).map(|at| format!("c{at}")).collect();
        assert!(Palette::of_names(many[1..].iter().map(String::as_str)).is_ok());
        let told = Palette::of_names(many.iter().map(String::as_str)).unwrap_err().to_string();
        assert!(told.contains("at most 1000 colours of a palette"), "{told}");
        assert_eq!(Palette::of_study(), palette(&Color::ALL.map(Color::name)).unwrap());
        for (names, words) in [
            (&[][..], "expected at least one colour, found none"),
            (&["Teal"], "expected lower-case names of colours, found `Teal`; did you mean `teal`?"),
            (&["re d"], "expected lower-case names of colours, found `re d`; did you mean `red`?"),
            (&["none"], "expected lower-case names of colours, found `none`"),
            (&[""], "expected lower-case names of colours, found ``"),
            (&["red", "red"], "expected each colour once, found `red` twice"),
        ] {
            assert_eq!(palette(names).unwrap_err().to_string(), words);
        }
    }

    #[test]
    fn an_invalid_palette_is_refused() {
        for palette in ["[]", "7", "\"red\"", "[1]", "[\"Red\"]", "[\"none\"]", "[\"red \"]", "[\"\"]", "{\"red\":1}"] {
            let text = format!("{{\"palette\":{palette}}}");
            let finding = DeclaredPalette::from_recording("a.parquet", &recording(Some(&text))).unwrap_err();
            assert_eq!(finding.code.name(), "invalid-metadata", "{palette}");
            assert!(finding.expected.contains("a list of lower-case names"), "{finding}");
        }
    }
}

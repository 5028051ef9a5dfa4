//! The data behind a mark: its title on hover, and its values as attributes for programs.
//!
//! Rule: `data-value` has every digit, as in `cells.csv`, and is empty where there is no value. Names are spelled as the
//! page spells them.

use std::borrow::Cow;
use std::fmt::Write as _;

use crate::figures::kit::ink::escaped;
use exact::escape::visible;
use exact::number;

/// The title and values of one group of shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    title: String,
    data: Vec<(Cow<'static, str>, String)>,
}

impl Mark {
    /// A mark with a title and no values yet.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), data: Vec::new() }
    }

    /// The same with one more value, under `data-NAME`; a name that is taken gets a dash.
    #[expect(clippy::needless_pass_by_value, reason = "numbers and text alike, as they come")]
    pub fn with(mut self, name: impl Into<Cow<'static, str>>, value: impl ToString) -> Self {
        let mut name = name.into();
        while self.data.iter().any(|(known, _)| *known == name) {
            name.to_mut().push('-');
        }
        self.data.push((name, value.to_string()));
        self
    }

    /// The same with its main value in full precision; empty without one.
    pub fn value(self, value: Option<f64>) -> Self {
        self.number("value", value)
    }

    /// The same with one more number in full precision; empty without one.
    pub fn number(self, name: impl Into<Cow<'static, str>>, value: Option<f64>) -> Self {
        self.with(name, value.map(number::full_precision).unwrap_or_default())
    }

    /// The beginning of the group.
    pub(crate) fn opening(&self) -> String {
        let mut tag = String::from("<g class=\"mark\"");
        for (name, value) in &self.data {
            let _ = write!(tag, " data-{name}=\"{}\"", escaped(&visible(value)));
        }
        let _ = writeln!(tag, "><title>{}</title>", escaped(&visible(&self.title)));
        tag
    }
}

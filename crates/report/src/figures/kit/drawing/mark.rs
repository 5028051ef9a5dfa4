//! The data behind a mark: its title on hover, and its values as attributes for programs.
//!
//! Rule: `data-value` has all digits, as in `cells.csv`, and is empty without a value. Names are spelled as on the
//! page.

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

    /// Adds a value as `data-NAME`; a name already in use gets a dash.
    #[expect(clippy::needless_pass_by_value, reason = "numbers and text alike, as they come")]
    pub fn with(mut self, name: impl Into<Cow<'static, str>>, value: impl ToString) -> Self {
        let mut name = name.into();
        while self.data.iter().any(|(known, _)| *known == name) {
            name.to_mut().push('-');
        }
        self.data.push((name, value.to_string()));
        self
    }

    /// Sets the main value in full precision; empty without one.
    pub fn value(self, value: Option<f64>) -> Self {
        self.number("value", value)
    }

    /// Adds a number in full precision; empty without one.
    pub fn number(self, name: impl Into<Cow<'static, str>>, value: Option<f64>) -> Self {
        self.with(name, value.map(number::full_precision).unwrap_or_default())
    }

    /// The opening tag of the group.
    pub(crate) fn opening(&self) -> String {
        let mut tag = String::from("<g class=\"mark\"");
        for (name, value) in &self.data {
            let _ = write!(tag, " data-{name}=\"{}\"", escaped(&visible(value)));
        }
        let _ = writeln!(tag, "><title>{}</title>", escaped(&visible(&self.title)));
        tag
    }
}

//! The data behind a mark: its title on hover, and its values as attributes for programs.
//!
//! Rule: `data-value` has all digits, as in `cells.csv`, and is empty without a value. Names are spelled as on the
//! page.

use std::borrow::Cow;
use std::fmt::Write as _;

use crate::kit::ink::escaped;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::number;

#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    title: String,
    data: Vec<(Cow<'static, str>, String)>,
}

impl Mark {
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), data: Vec::new() }
    }

    /// A mark with the names of one cell as its first values.
    pub fn of_cell(title: String, experiment: &str, model: &str, metric: &str) -> Self {
        Self::new(title).with("experiment", experiment).with("model", model).with("metric", metric)
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

    pub fn value(self, value: Option<f64>) -> Self {
        self.number("value", value)
    }

    /// Adds a number in full precision; empty without one.
    pub fn number(self, name: impl Into<Cow<'static, str>>, value: Option<f64>) -> Self {
        self.with(name, value.map(number::full_precision).unwrap_or_default())
    }

    pub(crate) fn opening(&self) -> String {
        let mut tag = String::from("<g class=\"mark\"");
        for (name, value) in &self.data {
            let _ = write!(tag, " data-{name}=\"{}\"", escaped(&visible(value)));
        }
        let _ = writeln!(tag, "><title>{}</title>", escaped(&visible(&self.title)));
        tag
    }
}

//! Faults of a definition, all shown at once: the location, the problem, and what to write instead.
//!
//! A fault points into a [`Source`] by byte range; [`Faults`] renders every fault with its lines and underlines the
//! span, like a compiler.

use std::error::Error;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use schemars::JsonSchema;
use serde::Serialize;

use mirrorstats_exact::escape::visible;

pub const MOST_FAULTS: usize = 100;

/// The text that faults point into: a definition file, or an expression typed on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The name for readers: a file name, or `--where`.
    pub name: String,
    pub text: String,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    pub source: Arc<Source>,
    pub span: Range<usize>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Lowercase, one line.
    pub message: String,
    pub place: Place,
    /// The label under the span; may be empty.
    pub label: String,
    pub help: Option<String>,
}

impl Fault {
    pub fn new(place: Place, message: impl Into<String>) -> Self {
        Self { message: message.into(), place, label: String::new(), help: None }
    }

    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds a remedy, if any.
    #[must_use]
    pub fn help_if(mut self, help: Option<String>) -> Self {
        self.help = help.or(self.help);
        self
    }

    fn render(&self, renderer: &Renderer) -> String {
        let text = &self.place.source.text;
        let annotation = AnnotationKind::Primary.span(within(text, &self.place.span)).label(visible(&self.label));
        let snippet = Snippet::source(text.as_str()).path(visible(&self.place.source.name)).annotation(annotation);
        let message = visible(&self.message);
        let mut group = Group::with_title(Level::ERROR.primary_title(message.as_str())).element(snippet);
        if let Some(help) = &self.help {
            group = group.element(Level::HELP.message(visible(help)));
        }
        renderer.render(&[group])
    }

    /// The 1-based line and column (in characters) of the start.
    pub fn line_and_column(&self) -> (usize, usize) {
        let start = within(&self.place.source.text, &self.place.span).start;
        let before = &self.place.source.text[..start];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

fn within(text: &str, span: &Range<usize>) -> Range<usize> {
    let start = text.floor_char_boundary(span.start.min(text.len()));
    let end = text.ceil_char_boundary(span.end.clamp(start, text.len()));
    start..end
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Faults(pub Vec<Fault>);

/// A fault as a program reads it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FaultRecord {
    /// The file, by name.
    pub file: String,
    /// 1-based.
    pub line: usize,
    /// 1-based, in characters.
    pub column: usize,
    /// The text underlined.
    pub text: String,
    /// The problem.
    pub message: String,
    /// The label at that place; may be empty.
    pub label: String,
    /// The remedy.
    pub help: Option<String>,
}

impl Faults {
    /// The faults that are all that an error says; `None` for an error that says anything else.
    pub fn of<'e>(error: &'e (dyn Error + 'static)) -> Option<&'e Self> {
        let mut links = std::iter::successors(Some(error), |&link| link.source());
        let faults = links.find_map(|link| link.downcast_ref::<Self>())?;
        (faults.to_string() == error.to_string()).then_some(faults)
    }

    pub fn render(&self, colored: bool) -> String {
        let renderer = if colored { Renderer::styled() } else { Renderer::plain() };
        let mut texts: Vec<String> = self.0.iter().map(|fault| fault.render(&renderer)).collect();
        if texts.len() > 1 {
            let or_more = if texts.len() == MOST_FAULTS { " or more" } else { "" };
            texts.push(format!("error: {} faults{or_more}", texts.len()));
        }
        texts.join("\n\n")
    }

    pub fn records(&self) -> Vec<FaultRecord> {
        let record = |fault: &Fault| {
            let (source, (line, column)) = (&fault.place.source, fault.line_and_column());
            FaultRecord {
                file: source.name.clone(),
                line,
                column,
                text: source.text[within(&source.text, &fault.place.span)].to_owned(),
                message: fault.message.clone(),
                label: fault.label.clone(),
                help: fault.help.clone(),
            }
        };
        self.0.iter().map(record).collect()
    }

    #[must_use]
    pub fn in_order(mut self) -> Self {
        self.0.sort_by(|a, b| {
            let key = |fault: &Fault| (fault.place.span.start, fault.place.span.end);
            a.place.source.name.cmp(&b.place.source.name).then(key(a).cmp(&key(b)))
        });
        self.0.dedup();
        self.0.truncate(MOST_FAULTS);
        self
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl Error for Faults {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_shows_its_line_with_the_span_underlined() {
        let source = Arc::new(Source { name: "a.toml".into(), text: "[let]\nx = \"éa + b\"\n".into() });
        let fault =
            Fault::new(Place { source, span: 11..14 }, "unknown name `éa`").label("not a column").help("try `a`");
        assert_eq!(fault.line_and_column(), (2, 6));
        insta::assert_snapshot!(Faults(vec![fault]).to_string(), @r#"
        error: unknown name `éa`
         --> a.toml:2:6
          |
        2 | x = "éa + b"
          |      ^^ not a column
          |
          = help: try `a`
        "#);
    }

    #[test]
    fn a_span_outside_its_text_does_not_panic() {
        let source = Arc::new(Source { name: "a".into(), text: "é".into() });
        for span in [0..1, 1..1, 1..9, 5..9] {
            assert!(!Faults(vec![Fault::new(Place { source: source.clone(), span }, "m")]).to_string().is_empty());
        }
    }
}

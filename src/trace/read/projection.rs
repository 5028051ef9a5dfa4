//! The columns of one pass: which are read, as what, and what is known about them.

use super::open::TraceSet;
use crate::trace::error::TraceError;
use crate::trace::schema::{self, Column, Kind};

/// Columns that every pass reads, at these positions.
pub(in crate::trace) const KEYS: [&str; 7] = ["episode_id", "model", "experiment", "seed", "run", "body_color", "t"];
pub(in crate::trace) const EPISODE_ID: usize = 0;
pub(in crate::trace) const T: usize = 6;

/// The columns that a pass reads: [`KEYS`], then those asked for.
#[derive(Clone, Debug)]
pub(in crate::trace) struct Layout {
    pub(in crate::trace) columns: Vec<LayoutColumn>,
}

/// One column of a pass.
#[derive(Clone, Debug)]
pub(in crate::trace) struct LayoutColumn {
    pub(in crate::trace) name: String,
    pub(in crate::trace) kind: Kind,
    /// What the schema says of it, if it does.
    pub(in crate::trace) known: Option<&'static Column>,
    /// Whether it must be the same in all rows of an episode.
    pub(in crate::trace) constant: bool,
}

impl Layout {
    /// The keys and these columns, each once.
    pub(in crate::trace) fn new<'a>(
        set: &TraceSet,
        steps: impl IntoIterator<Item = &'a str>,
        constants: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, TraceError> {
        let mut layout = Self { columns: Vec::new() };
        for name in KEYS.into_iter().chain(steps) {
            layout.add(set, name, false)?;
        }
        for name in constants {
            layout.add(set, name, true)?;
        }
        Ok(layout)
    }

    fn add(&mut self, set: &TraceSet, name: &str, constant: bool) -> Result<(), TraceError> {
        if let Some(at) = self.position(name) {
            self.columns[at].constant |= constant;
            return Ok(());
        }
        // A name that only older traces have is a column of their own.
        let known = schema::column(name).filter(|known| known.since == 1 || set.declares(name));
        let kind = kind_in(set, name)?;
        let constant = constant || known.is_some_and(|column| column.constant);
        self.columns.push(LayoutColumn { name: name.to_owned(), kind, known, constant });
        Ok(())
    }

    /// Takes the values of a column as they are, whatever the schema says of them.
    pub(in crate::trace) fn without_rules(&mut self, name: &str) {
        for column in self.columns.iter_mut().filter(|column| column.name == name) {
            column.known = None;
        }
    }

    /// Where the column of this name is.
    pub(in crate::trace) fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }
}

fn kind_in(set: &TraceSet, name: &str) -> Result<Kind, TraceError> {
    let refused = |found| TraceError::Column { column: name.to_owned(), expected: "a column of the traces", found };
    let Some(column) = set.column(name) else {
        return Err(refused(format!("none; they have {}", set.column_names().join(", "))));
    };
    match column {
        column if column.kind != Kind::Unsupported => Ok(column.kind),
        column => Err(match column.conflict {
            Some([(one, this), (other, that)]) => TraceError::Column {
                column: name.to_owned(),
                expected: "the same type in all files",
                found: format!("{} in {one} and {} in {other}; cast one of them", this.name(), that.name()),
            },
            None => TraceError::Column {
                column: name.to_owned(),
                expected: "bool, integer, float or string",
                found: "another type; cast it where the file is written".into(),
            },
        }),
    }
}

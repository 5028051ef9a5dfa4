//! The columns of one pass: which to read, as which type, and their known properties.

use super::open::TraceSet;
use crate::error::TraceError;
use crate::schema::{Column, DeclaredColumn, Domain, Kind};

/// Columns that every pass reads, at these positions.
pub(crate) const KEYS: [&str; 6] = ["episode_id", "model", "experiment", "seed", "run", "t"];
/// A column that every pass over traces of the mirror's domain reads as well, unless all of them lack it.
pub(crate) const BODY_COLOR: &str = "body_color";
pub(crate) const EPISODE_ID: usize = 0;
pub(crate) const T: usize = 5;

#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) columns: Vec<LayoutColumn>,
}

#[derive(Clone, Debug)]
pub(crate) struct LayoutColumn {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) known: Option<&'static Column>,
    pub(crate) constant: bool,
    pub(crate) values: Vec<String>,
    /// True if it holds only nulls in all files, of no type.
    is_null: bool,
    /// True if all rows read as null.
    pub(crate) left_out: bool,
}

impl Layout {
    pub(crate) fn new<'a>(
        set: &TraceSet,
        steps: impl IntoIterator<Item = &'a str>,
        constants: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, TraceError> {
        let mut layout = Self { columns: Vec::new() };
        let has_colors = set.domain() == Domain::Mirror && set.column(BODY_COLOR).is_some();
        let beside = has_colors.then_some(BODY_COLOR);
        for name in KEYS.into_iter().chain(beside).chain(steps) {
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
        let known = set.schema_column(name);
        let kind = kind_in(set, name)?;
        let constant = constant || known.is_some_and(|column| column.constant);
        let is_null = set.column(name).is_some_and(|column| column.is_null);
        self.columns.push(LayoutColumn {
            name: name.to_owned(),
            kind,
            known,
            constant,
            values: Vec::new(),
            is_null,
            left_out: false,
        });
        Ok(())
    }

    /// Leaves the timesteps out, where only the episodes matter: of the keys, they alone differ in each row.
    pub(crate) fn without_steps(&mut self) {
        let t = &mut self.columns[T];
        (t.known, t.left_out) = (None, true);
    }

    /// Adds the rules that definitions declare for columns outside the schema.
    pub(crate) fn with_declared(&mut self, declared: &[DeclaredColumn]) {
        for declared in declared {
            let own = self.columns.iter_mut().find(|column| column.name == declared.name && column.known.is_none());
            if let Some(column) = own.filter(|column| column.kind == declared.kind || column.is_null) {
                column.kind = declared.kind;
                column.values.clone_from(&declared.values);
                column.constant |= declared.constant;
            }
        }
    }

    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }
}

fn kind_in(set: &TraceSet, name: &str) -> Result<Kind, TraceError> {
    let refused = |expected, found| Err(TraceError::Column { column: name.to_owned(), expected, found });
    let Some(column) = set.column(name) else {
        return refused("a column of the traces", format!("none; they have {}", set.column_names().join(", ")));
    };
    match column.conflict {
        _ if column.kind != Kind::Unsupported => Ok(column.kind),
        Some([(one, this), (other, that)]) => refused(
            "the same type in all files",
            format!("{} in {one} and {} in {other}; cast one of them", this.name(), that.name()),
        ),
        None => refused(
            "bool, integer, float or string",
            "another type; cast it where the file is written, or make a trace of the file with `mirrorstats import`"
                .into(),
        ),
    }
}

//! Opens traces together: reads every footer and determines the use of each column over all files.

use std::sync::Arc;

pub use super::footer::columns::FileColumn;
pub use super::footer::trace_file::TraceFile;
use crate::beside::labels::Labels;
use crate::error::TraceError;
use crate::inputs::Input;
use crate::schema::{self, COLUMNS, Column, Domain, Kind};

/// Open traces: every footer is read and valid, no rows are read yet.
#[derive(Debug)]
pub struct TraceSet {
    files: Arc<[TraceFile]>,
    labels: Labels,
    label_columns: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnUse {
    /// The logical type, the same in all files that have the column; [`Kind::Unsupported`] if they differ.
    pub kind: Kind,
    /// The name of a file without the column, if any; its rows read as null.
    pub missing_from: Option<String>,
    /// True if its type in every file that has it says that it holds only nulls; it then fits any declared type.
    pub is_null: bool,
    pub conflict: Option<[(String, Kind); 2]>,
}

impl TraceSet {
    /// Opens these files in the given order ([`resolve`](crate::inputs::resolve) orders them by name).
    pub fn open(inputs: &[Input]) -> Result<Self, TraceError> {
        let mut files = Vec::with_capacity(inputs.len());
        let mut faults = Vec::new();
        for input in inputs {
            match TraceFile::open(input) {
                Ok(file) => files.push(file),
                Err(findings) => faults.extend(findings),
            }
        }
        let set = Self::from_files(files);
        if set.domain() == Domain::Mirror {
            // Files of another domain among traces of the mirror's.
            faults.extend(set.files.iter().flat_map(TraceFile::faults_as_mirror));
        }
        match TraceError::from_findings(faults) {
            Some(error) => Err(error),
            None => Ok(set),
        }
    }

    /// The domain of all files: the mirror's, unless every file has another one.
    pub fn domain(&self) -> Domain {
        let is_own = |file: &TraceFile| file.domain() == Domain::Own;
        if !self.files.is_empty() && self.files.iter().all(is_own) { Domain::Own } else { Domain::Mirror }
    }

    pub fn schema_column(&self, name: &str) -> Option<&'static Column> {
        schema::column(name).filter(|_| self.domain() == Domain::Mirror || self.declares(name))
    }

    /// Returns true if the schema's column keeps its meaning in these files, present or not.
    pub fn knows(&self, known: &Column) -> bool {
        self.domain().has(known) && (self.column(known.name).is_none() || self.declares(known.name))
    }

    pub fn from_files(files: Vec<TraceFile>) -> Self {
        Self { files: files.into(), labels: Labels::default(), label_columns: Vec::new() }
    }

    pub fn files(&self) -> &[TraceFile] {
        &self.files
    }

    pub(super) fn shared_files(&self) -> Arc<[TraceFile]> {
        Arc::clone(&self.files)
    }

    pub fn column(&self, name: &str) -> Option<ColumnUse> {
        if self.is_label_column(name) {
            return Some(ColumnUse { kind: Kind::Bool, missing_from: None, is_null: false, conflict: None });
        }
        let mut seen: Option<(&TraceFile, Kind)> = None;
        let (mut present, mut missing_from, mut conflict) = (false, None, None);
        for file in self.files.iter() {
            match (file.column(name).map(|column| column.kind), seen) {
                (None, _) => missing_from = missing_from.or_else(|| Some(file.name().to_owned())),
                (Some(None), _) => present = true,
                (Some(Some(kind)), None) => seen = Some((file, kind)),
                (Some(Some(kind)), Some((first, known))) if kind != known && conflict.is_none() => {
                    conflict = Some([(first.name().to_owned(), known), (file.name().to_owned(), kind)]);
                }
                (Some(Some(_)), Some(_)) => {}
            }
        }
        // A column that is null in every file has the schema's type, or text if it is not in the schema.
        let unseen = || self.domain().column(name).map_or(Kind::String, |column| column.stored.kind());
        let kind = if conflict.is_some() { Kind::Unsupported } else { seen.map_or_else(unseen, |(_, kind)| kind) };
        let is_null = seen.is_none();
        (present || !is_null).then_some(ColumnUse { kind, missing_from, is_null, conflict })
    }

    pub fn declares(&self, name: &str) -> bool {
        self.files.iter().any(|file| file.declares(name))
    }

    /// The names of all columns of all files: those of the schema in its order, then the others in file order.
    pub fn column_names(&self) -> Vec<&str> {
        let known = COLUMNS.iter().filter(|column| self.domain().has(column)).map(|column| column.name);
        let mut names: Vec<&str> =
            known.filter(|name| self.files.iter().any(|file| file.column(name).is_some())).collect();
        for column in self.files.iter().flat_map(TraceFile::all_columns) {
            if !names.contains(&column.name.as_str()) {
                names.push(&column.name);
            }
        }
        names
    }

    pub fn with_labels(self, labels: Labels) -> Result<Self, TraceError> {
        let columns = labels.columns();
        if let Some(column) = columns.iter().find(|name| self.column(name).is_some()) {
            let expected = "a label whose column no trace has";
            let found = "a column of the traces and a label in `labels.jsonl`".to_owned();
            return Err(TraceError::Column { column: column.clone(), expected, found });
        }
        Ok(Self { labels, label_columns: columns, ..self })
    }

    pub fn labels(&self) -> &Labels {
        &self.labels
    }

    pub fn label_columns(&self) -> &[String] {
        &self.label_columns
    }

    pub fn is_label_column(&self, name: &str) -> bool {
        self.label_columns.iter().any(|column| column == name)
    }
}

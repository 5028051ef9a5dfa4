//! The columns of a file, and those in the names of its folders, as partitioned tables of Spark and others have them:
//! `model=act/run=1`. Only files of other writers have the latter: a trace of this program describes itself.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, StringArray, UInt32Array, new_null_array};
use arrow::compute::{cast, take};
use arrow::datatypes::DataType;
use arrow::error::ArrowError;

use crate::diagnostic::{Code, Finding};
use crate::inputs::folder_values;
use crate::schema::{self, Kind};
use mirrorstats_exact::escape::visible;
use mirrorstats_parquet_pages::Column;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileColumn {
    pub name: String,
    /// Its logical type; `None` for a column declared as all null, which is compatible with any type.
    pub kind: Option<Kind>,
    pub is_single: bool,
}

#[derive(Clone, Debug)]
pub struct FolderColumn {
    pub column: FileColumn,
    /// `None` for null.
    value: Option<String>,
}

/// The columns in the folders of a path. Integers are those of the schema, and values that are spelled as integers in
/// other columns.
pub(crate) fn folder_columns(file: &str, path: &Path) -> Result<Vec<FolderColumn>, Box<Finding>> {
    let column = |(name, value): (String, Option<String>)| {
        let is_integer = value.as_deref().is_some_and(|text| text.parse().is_ok_and(|it: i64| it.to_string() == text));
        let known = schema::column(&name).map(|column| column.stored.kind());
        let kind = known.unwrap_or(if is_integer { Kind::Int } else { Kind::String });
        match (&value, kind) {
            (None, _) | (_, Kind::String) => {}
            (_, Kind::Int) if is_integer => {}
            (Some(text), _) => {
                let found = format!("`{}` in the name of a folder", visible(text));
                return Err(Box::new(Finding::new(Code::WrongType, file, kind.name(), found).in_column(&name)));
            }
        }
        Ok(FolderColumn { column: FileColumn { name, kind: value.as_ref().map(|_| kind), is_single: false }, value })
    };
    folder_values(path).into_iter().map(column).collect()
}

impl FolderColumn {
    pub fn value(&self) -> Option<&str> {
        self.value.as_deref()
    }

    pub(crate) fn repeated(&self, held: &DataType, rows: usize) -> Result<ArrayRef, ArrowError> {
        let Some(value) = &self.value else { return Ok(new_null_array(held, rows)) };
        let one: ArrayRef = Arc::new(StringArray::from(vec![value.as_str()]));
        take(&cast(&one, held)?, &UInt32Array::from_value(0, rows), None)
    }

    pub(crate) fn contradiction(&self, file: &str, column: &Column) -> Option<Finding> {
        let value = self.value.as_deref()?;
        let found = (0..column.len()).find_map(|row| match self.column.kind? {
            Kind::Int => column.int(row).map(|found| found.to_string()).filter(|found| found != value),
            _ => column.text(row).filter(|found| *found != value).map(str::to_owned),
        })?;
        Some(self.contradicted(file, &found))
    }

    pub fn contradicted(&self, file: &str, found: &str) -> Finding {
        let expected = format!("`{}`, as in the name of the folder", visible(self.value().unwrap_or_default()));
        let finding = Finding::new(Code::InconsistentConstant, file, expected, format!("`{}`", visible(found)));
        let help = "move the file to the folder of its values, or correct the column";
        finding.in_column(&self.column.name).with_help(help)
    }
}

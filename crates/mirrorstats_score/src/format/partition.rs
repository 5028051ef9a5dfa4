//! Parts of a score file that are stored elsewhere: columns in its folder names (Hive partitions), and definitions
//! named by the reader.

use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, Int64Array, RecordBatch, RecordBatchOptions, StringArray, new_null_array};
use arrow::datatypes::{DataType, Field, Schema};

use super::FormatError;
use super::csv::KEYS;
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_metric::sql::Dialect;

#[derive(Clone, Copy, Debug, Default)]
pub struct Partition<'a> {
    /// Columns in its folder names, as Spark partitions a table; `None` for null. The file's own columns take
    /// precedence.
    pub folders: &'a [(String, Option<String>)],
    /// The definitions of scores that carry none.
    pub definitions: Option<&'a Catalog>,
}

impl Partition<'_> {
    /// Adds the keys and metrics of its folder names to a batch. Restores the catalog's names of metrics that the
    /// portable SQL had to spell differently, or whose case an engine has folded.
    pub(super) fn complete(&self, batch: &RecordBatch, catalog: &Catalog) -> Result<RecordBatch, FormatError> {
        let mut fields: Vec<Arc<Field>> = batch.schema().fields().iter().map(|field| renamed(field, catalog)).collect();
        let mut columns = batch.columns().to_vec();
        for (name, value) in self.folders {
            let is_int = ["seed", "run"].contains(&name.as_str()) || catalog.metric.contains_key(name);
            let is_wanted = is_int || KEYS.contains(&name.as_str());
            if is_wanted && fields.iter().all(|field| field.name() != name) {
                let column = repeated(name, value.as_deref(), is_int, batch.num_rows())?;
                fields.push(Arc::new(Field::new(name, column.data_type().clone(), true)));
                columns.push(column);
            }
        }
        let options = RecordBatchOptions::new().with_row_count(Some(batch.num_rows()));
        RecordBatch::try_new_with_options(Arc::new(Schema::new(fields)), columns, &options)
            .map_err(|error| FormatError::Parquet(error.into()))
    }
}

fn renamed(field: &Arc<Field>, catalog: &Catalog) -> Arc<Field> {
    let name = field.name();
    if catalog.metric.contains_key(name) || KEYS.contains(&name.as_str()) {
        return Arc::clone(field);
    }
    match catalog.metric.keys().find(|metric| Dialect::Portable.output_name(metric).eq_ignore_ascii_case(name)) {
        Some(metric) => Arc::new(field.as_ref().clone().with_name(metric)),
        None => Arc::clone(field),
    }
}

fn repeated(name: &str, value: Option<&str>, is_int: bool, rows: usize) -> Result<ArrayRef, FormatError> {
    let Some(value) = value else {
        return Ok(new_null_array(if is_int { &DataType::Int64 } else { &DataType::Utf8 }, rows));
    };
    if !is_int {
        return Ok(Arc::new(StringArray::from(vec![value; rows])));
    }
    let number: i64 = value
        .parse()
        .map_err(|_| FormatError::column(name, "an integer in the name of the folder", format!("`{value}`")))?;
    Ok(Arc::new(Int64Array::from(vec![number; rows])))
}

//! Columns that are not in files: the labels of coders beside the traces, one value per episode.

use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, AsArray as _, BooleanArray, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Schema};

use super::open::TraceSet;
use crate::error::TraceError;
use crate::labels::Labels;

/// The labels beside some traces, and the names of their columns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Beside {
    labels: Arc<Labels>,
    columns: Vec<String>,
}

impl TraceSet {
    pub fn with_labels(self, labels: Labels) -> Result<Self, TraceError> {
        let columns = labels.columns();
        if let Some(column) = columns.iter().find(|name| self.column(name).is_some()) {
            let expected = "a label whose column no trace has";
            let found = "a column of the traces and a label in `labels.jsonl`".to_owned();
            return Err(TraceError::Column { column: column.clone(), expected, found });
        }
        Ok(self.beside(Beside { labels: Arc::new(labels), columns }))
    }

    pub fn labels(&self) -> &Labels {
        &self.labelled().labels
    }

    /// The columns of the labels: true, false or null in each episode.
    pub fn label_columns(&self) -> &[String] {
        &self.labelled().columns
    }

    pub fn is_label_column(&self, name: &str) -> bool {
        self.label_columns().iter().any(|column| column == name)
    }

    pub(crate) fn with_label_columns(
        &self,
        episodes: RecordBatch,
        columns: &[&str],
    ) -> Result<RecordBatch, TraceError> {
        if columns.is_empty() {
            return Ok(episodes);
        }
        let ids = episodes.column_by_name("episode_id").expect("every batch names its episodes");
        let ids = cast(ids, &DataType::Utf8).map_err(TraceError::Memory)?;
        let ids = ids.as_string::<i32>();
        let mut fields: Vec<Field> =
            episodes.schema_ref().fields().iter().map(|field| field.as_ref().clone()).collect();
        let mut arrays = episodes.columns().to_vec();
        for column in columns {
            let values: BooleanArray = ids.iter().map(|id| self.labels().value(column, id?)).collect();
            fields.push(Field::new(*column, values.data_type().clone(), true));
            arrays.push(Arc::new(values) as ArrayRef);
        }
        RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(TraceError::Memory)
    }
}

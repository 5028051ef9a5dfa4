//! The metadata in the footer of a Parquet file, from any writer.

use parquet::file::metadata::FileMetaData;
use serde_json::Value;

const SPARK_COLUMNS: &str = "org.apache.spark.sql.parquet.row.metadata";

/// The value of a key: of the file itself, or of one of its columns in Spark's files.
pub(super) fn value(metadata: &FileMetaData, key: &str) -> Option<String> {
    let pairs = || metadata.key_value_metadata().into_iter().flatten();
    let of_file = pairs().find(|pair| pair.key == key).and_then(|pair| pair.value.clone());
    of_file.or_else(|| of_column(pairs().find(|pair| pair.key == SPARK_COLUMNS)?.value.as_deref()?, key))
}

fn of_column(columns: &str, key: &str) -> Option<String> {
    let columns: Value = serde_json::from_str(columns).ok()?;
    let fields = columns.get("fields")?.as_array()?;
    fields.iter().find_map(|field| field.get("metadata")?.get(key)?.as_str().map(str::to_owned))
}

#[cfg(test)]
mod tests {
    use super::of_column;

    #[test]
    fn spark_keeps_values_with_its_columns() {
        let columns = r#"{"type":"struct","fields":[{"name":"a","metadata":{}},{"name":"b","metadata":{"k":"v"}}]}"#;
        assert_eq!(of_column(columns, "k").as_deref(), Some("v"));
        for (other, key) in [(columns, "x"), ("{}", "k"), ("no json", "k"), ("", "k")] {
            assert_eq!(of_column(other, key), None);
        }
    }
}

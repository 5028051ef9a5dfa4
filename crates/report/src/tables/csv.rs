//! Tables as CSV: one line per cell, numbers as printed.
//!
//! The key columns come first, then `metric`. Cells of mean and standard error go on with
//! `mean,se,emphasis`, the form of the published tables; cells of counts with
//! `episodes,n,sum,mean,ci_low,ci_high,emphasis`. What is undefined is empty.
//!
//! A spreadsheet takes text that begins like a formula for one. Such text from traces is written with an
//! apostrophe before it, which [`text_of`] takes off again; numbers stay numbers.

use crate::cells::KeyValue;
use crate::style::CellForm;
use crate::table::{Cell, Spread, Table, Value};

pub fn render(table: &Table) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let tail = match table.form {
        CellForm::MeanSe => &["mean", "se", "emphasis"][..],
        CellForm::CountInterval => &["episodes", "n", "sum", "mean", "ci_low", "ci_high", "emphasis"],
    };
    let keys = table.keys.iter().map(String::as_str);
    write(&mut writer, keys.chain(["metric"]).chain(tail.iter().copied()).map(str::to_owned));
    for row in table.groups.iter().flat_map(|group| &group.rows) {
        for (column, cell) in table.columns.iter().zip(&row.cells) {
            let keys = row.key.iter().map(key_field);
            write(&mut writer, keys.chain([column.metric.clone()]).chain(fields(cell, table.form)));
        }
    }
    finish(writer)
}

fn fields(cell: &Cell, form: CellForm) -> Vec<String> {
    let mean = cell.value.mean().map(|mean| mean.to_string()).unwrap_or_default();
    let emphasis = cell.emphasis.word().to_owned();
    match form {
        CellForm::MeanSe => vec![mean, standard_error(&cell.value), emphasis],
        CellForm::CountInterval => {
            let (low, high) = bounds(&cell.value);
            let sum = if cell.n == 0 { String::new() } else { cell.sum.to_string() };
            vec![cell.episodes.to_string(), cell.n.to_string(), sum, mean, low, high, emphasis]
        }
    }
}

fn standard_error(value: &Value) -> String {
    match value {
        Value::MeanSe { se: Some(se), .. } => se.to_string(),
        _ => String::new(),
    }
}

fn bounds(value: &Value) -> (String, String) {
    match value {
        Value::Count { spread: Spread::Interval { low, high }, .. }
        | Value::Mean { spread: Spread::Interval { low, high }, .. } => (low.to_string(), high.to_string()),
        _ => (String::new(), String::new()),
    }
}

/// A key as a field; text that a spreadsheet would compute is made harmless.
pub fn key_field(value: &KeyValue) -> String {
    match value {
        KeyValue::Text(text) if is_formula(text) => format!("'{text}"),
        value => value.to_string(),
    }
}

/// What [`key_field`] was given as text.
pub fn text_of(field: &str) -> &str {
    field.strip_prefix('\'').filter(|text| is_formula(text)).unwrap_or(field)
}

fn is_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(['=', '+', '-', '@', '\t', '\r'])
}

/// Writes one record; memory does not fail.
pub(crate) fn write(writer: &mut ::csv::Writer<Vec<u8>>, record: impl IntoIterator<Item = String>) {
    writer.write_record(record).expect("records of one length written to memory");
}

pub(crate) fn finish(writer: ::csv::Writer<Vec<u8>>) -> String {
    let bytes = writer.into_inner().expect("flushing to memory does not fail");
    String::from_utf8(bytes).expect("every field is text")
}

#[cfg(test)]
mod tests {
    use super::{key_field, text_of};
    use crate::cells::KeyValue;

    #[test]
    fn formulas_are_made_harmless_and_come_back() {
        for (text, field) in [
            ("Gemma4 26B", "Gemma4 26B"),
            ("=1+1", "'=1+1"),
            ("+x", "'+x"),
            ("-x", "'-x"),
            ("@x", "'@x"),
            ("\tx", "'\tx"),
            ("'=x", "''=x"),
            ("'quoted", "'quoted"),
            ("", ""),
        ] {
            assert_eq!(key_field(&KeyValue::Text(text.to_owned())), field);
            assert_eq!(text_of(field), text);
        }
        assert_eq!(key_field(&KeyValue::Int(-1)), "-1");
    }
}

//! The table of a trace's columns, declared in `assets/domains/mirror.toml`.
//!
//! Writer, reader, `validate`, `import`, the messages of logs, `mirrorstats trace schema` and
//! `schemas/trace.schema.json` all follow `COLUMNS`. A new column needs an entry in that file, and a field of `Episode`
//! or `Extra`. Other columns are a trace's own: they are kept, and definitions may use them.

pub mod colors;
mod column;
pub mod describe;
pub mod domain;
pub mod rules;
mod value;

pub(crate) use column::Scope;
pub use column::{Column, Kind, Stored};
pub use domain::{COLUMNS, DeclaredColumn, Domain, column};
pub use value::Value;
pub(crate) use value::value_at;

/// The schema version of every trace that this program writes.
pub const SCHEMA_VERSION: u32 = 2;

/// The required columns without a meaning in some tasks. A trace may lack one if every experiment in its footer
/// declares so (`absent`); its rows then have no value.
pub(crate) fn of_some_tasks() -> impl Iterator<Item = &'static str> {
    COLUMNS.iter().filter(|column| column.is_of_some_tasks).map(|column| column.name)
}

pub const VERSION_KEY: &str = "mirrorstats.schema_version";
pub(crate) const WRITER_KEY: &str = "mirrorstats.writer";
pub const RECORDING_KEY: &str = "mirrorstats.recording";
pub(crate) const CHECKSUMS_KEY: &str = mirrorstats_parquet_pages::checksums::KEY;

#[cfg(test)]
mod tests {
    use super::{COLUMNS, Kind, Value, column};
    use crate::episodes::episode::{Action, Episode, Step};

    #[test]
    fn names_are_unique_and_found() {
        for (i, wanted) in COLUMNS.iter().enumerate() {
            assert_eq!(column(wanted.name), Some(wanted));
            assert!(COLUMNS[..i].iter().all(|before| before.name != wanted.name), "{} twice", wanted.name);
        }
        assert_eq!(column("no_such_column"), None);
        assert_eq!(column("action").unwrap().values, Action::ALL.map(Action::name));
    }

    #[test]
    fn the_constant_columns_are_the_documented_ones() {
        let constants: Vec<_> = COLUMNS.iter().filter(|c| c.constant).map(|c| c.name).collect();
        let expected =
            ["episode_id", "model", "experiment", "seed", "run", "body_color", "stated_color", "distractors"];
        assert_eq!(constants[..expected.len()], expected);
        let newer = [
            "condition",
            "scene",
            "repetition",
            "decision",
            "fingerprint",
            "participant",
            "episode_hash",
            "start_distance",
            "unreadable_answers",
            "shown_color",
        ];
        assert_eq!(constants[expected.len()..], newer);
    }

    #[test]
    fn every_column_reads_back_the_value_put_into_it() {
        for column in COLUMNS.iter() {
            let mut episode = Episode { steps: vec![Step::default(); 2], ..Episode::default() };
            let value = match column.stored.kind() {
                Kind::Bool => Value::Bool(true),
                Kind::Int => Value::Int(2),
                Kind::Float => Value::Float(0.5),
                _ => Value::Text(column.values.first().unwrap_or(&"red")),
            };
            assert!(column.put(&mut episode, 1, Some(value)), "{}", column.name);
            let values: Vec<_> = column.of_steps(&episode).collect();
            assert_eq!(values[1], Some(value), "{}", column.name);
            assert_eq!(values[0] == values[1], column.constant, "{}", column.name);
            if column.name != "t" {
                let other = if column.stored.kind() == Kind::Bool { Value::Int(1) } else { Value::Bool(true) };
                assert!(!column.put(&mut episode, 1, Some(other)), "{}", column.name);
                assert_eq!(column.put(&mut episode, 1, None), column.nullable, "{}", column.name);
            }
            // The stored type is the field's: it holds exactly that range.
            if let Some((lowest, highest)) = column.stored.range().filter(|_| column.name != "t") {
                assert!([lowest, highest].map(Value::Int).iter().all(|v| column.put(&mut episode, 0, Some(*v))));
                let beyond = highest.checked_add(1).map(Value::Int);
                assert!(beyond.is_none_or(|beyond| !column.put(&mut episode, 0, Some(beyond))), "{}", column.name);
            }
        }
    }
}

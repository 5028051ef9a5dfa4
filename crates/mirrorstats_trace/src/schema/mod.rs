//! The table of a trace's columns, declared in `assets/domains/mirror.toml`.
//!
//! Writer, reader, `validate`, `import`, the messages of logs, `mirrorstats trace schema` and
//! `schemas/trace.schema.json` all follow `COLUMNS`. A new column needs an entry in that file, and a field of `Episode`
//! or `Extra`. Other columns are a trace's own: they are kept, and definitions may use them.

pub mod colors;
mod column;
pub mod describe;
pub mod domain;
mod field_access;
pub mod rules;

use serde::Serialize;

pub use column::{Column, Kind, Stored};
pub use domain::{COLUMNS, DeclaredColumn, Domain, column};
pub use field_access::Value;
pub(crate) use field_access::value_at;

/// The schema version of every trace that this program writes.
pub const SCHEMA_VERSION: u32 = 2;

/// The required columns without a meaning in some tasks. A trace may lack one if every experiment in its footer
/// declares so (`absent`); its rows then have no value.
pub(crate) fn of_some_tasks() -> impl Iterator<Item = &'static str> {
    COLUMNS.iter().filter(|column| column.is_of_some_tasks).map(|column| column.name)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MetadataKey {
    pub key: &'static str,
    pub doc: &'static str,
}

pub const VERSION_KEY: &str = "mirrorstats.schema_version";
pub(crate) const WRITER_KEY: &str = "mirrorstats.writer";
pub const RECORDING_KEY: &str = "mirrorstats.recording";
pub(crate) const CHECKSUMS_KEY: &str = mirrorstats_parquet_pages::checksums::KEY;

pub const METADATA: &[MetadataKey] = &[
    MetadataKey {
        key: VERSION_KEY,
        doc: "The version of this schema, a decimal integer. Another version is refused. A file without it is one of \
              another writer, and its columns are checked all the same.",
    },
    MetadataKey { key: WRITER_KEY, doc: "The program that wrote the file: `mirrorstats` and its version." },
    MetadataKey {
        key: RECORDING_KEY,
        doc: "How the recording was made, a JSON object. Of a recording of this program: scene, prompt and \
              configuration hashes, view size, visibility threshold in pixels, seeds. Every trace may have the keys that \
              follow.",
    },
    MetadataKey {
        key: "mirrorstats.recording.kind",
        doc: "`recording`, `import`, or `reconstruction`: how the rows came to be.",
    },
    MetadataKey {
        key: "mirrorstats.recording.domain",
        doc: "What the episodes are about: `mirror`, or any other name, where the columns of the mirror have no meaning. A file \
              without it that has none of these columns is of its own domain.",
    },
    MetadataKey {
        key: "mirrorstats.recording.design",
        doc: "What depends on what. `pairs`: `scene` where episodes with equal `scene` are pairs. `cluster`: `seed` where \
              the runs of a seed share more than chance, null where they do not. What is not declared is not assumed.",
    },
    MetadataKey {
        key: "mirrorstats.recording.fingerprints",
        doc: "By the values of the column `fingerprint`: SHA-256 of `world`, `prompts`, `reply_schema`, `agent` and \
              `sampling`, and `model`, the model's id as the provider returned it. `renderer`, where the agent saw frames: \
              what drew them (`name`, `version`, `vendor`, and `processor`, what it may use of it), as it is.",
    },
    MetadataKey {
        key: "mirrorstats.recording.palette",
        doc: "A list of lower-case names: all colours of the trace. Another value is refused.",
    },
    MetadataKey {
        key: "mirrorstats.recording.experiment",
        doc: "The experiment as data, an object: `name`, `title`, `order`, `decision`, action set, `chance` and `reference` \
              levels as under `[experiment.NAME]` of a definition file. Every command takes its episodes, whether the \
              definitions know it or not; files that declare it must declare it alike. Where a definition file says \
              something else, the definition file counts and `validate` says so.",
    },
    MetadataKey {
        key: "mirrorstats.recording.experiments",
        doc: "The same of several experiments, a list of such objects.",
    },
    MetadataKey {
        key: "mirrorstats.recording.registration",
        doc: "The plan that was registered before the recording: its `sha256`, and that of the `definitions` that it names.",
    },
    MetadataKey {
        key: CHECKSUMS_KEY,
        doc: "CRC-32 of each column chunk over its raw bytes, page headers included, and of all behind the chunks, a JSON \
              object: `algorithm`; `created_by`, that of the footer to which they apply, as programs that write a file \
              again carry the key along; `chunks`, a list per row group of a checksum per column; `footer`, that of the \
              bytes from the end of the last chunk to the end of the footer, its own eight digits as zeros. Verified \
              where it applies.",
    },
];

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

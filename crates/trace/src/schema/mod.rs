//! The table of columns: what a trace holds, and the one place that says so.
//!
//! Writer, reader, `validate`, `import`, the messages of logs, `mirrorstats trace schema` and `schemas/trace.schema.json` all
//! follow `COLUMNS`: a new column is an entry there, and a field of `Episode` or `Extra`. Columns that it does not name
//! are a trace's own: they are kept, and definitions may use them.

pub mod colors;
mod column;
pub mod describe;
pub mod domain;
mod field_access;
pub mod rules;

use serde::Serialize;

use super::episode::Action;
use field_access::{Access, Field as _};

pub use column::{Column, Kind, Stored};
pub use domain::{DeclaredColumn, Domain};
pub use field_access::Value;

/// The newest version of the schema. A trace is written as the oldest one that has its columns.
pub const SCHEMA_VERSION: u32 = 2;

/// The names that `action` takes.
pub const ACTIONS: [&str; 11] = {
    let mut names = [""; 11];
    let mut i = 0;
    while i < names.len() {
        names[i] = Action::ALL[i].name();
        i += 1;
    }
    names
};

/// The required columns that have no meaning for some tasks: a trace may lack one if every experiment that its footer declares
/// says so (`absent`). Its rows have no value then.
pub const OF_SOME_TASKS: [&str; 2] = ["self_color", "selected_cube"];

/// The names that `reply_status` takes.
pub const REPLY_STATUSES: [&str; 10] = [
    "ok",
    "repaired",
    "parse_failed",
    "schema_invalid",
    "refusal",
    "truncated",
    "empty",
    "rate_limited",
    "server_error",
    "timeout",
];

/// A column that is a field of the episode.
macro_rules! constant {
    ($field:ident, $stored:ident, $doc:expr) => {
        column!($field, $stored, $doc, episode, _at => episode.$field).constant()
    };
}

/// A column that is a field of the step.
macro_rules! step {
    ($field:ident, $stored:ident, $doc:expr) => {
        column!($field, $stored, $doc, episode, at => episode.steps[at].$field)
    };
}

/// A column that is a field of what a recorder may add to the step.
macro_rules! extra {
    ($field:ident, $stored:ident, $doc:expr) => {
        column!($field, $stored, $doc, episode, at => episode.steps[at].extra.$field)
    };
}

macro_rules! column {
    ($field:ident, $stored:ident, $doc:expr, $episode:ident, $at:ident => $place:expr) => {{
        let access = Access { get: |$episode, $at| $place.value(), set: |$episode, $at, value| $place.put(value) };
        Column::new(stringify!($field), Stored::$stored, $doc, access)
    }};
}

/// The columns of the schema, in the order in which the writer stores them: required ones first.
pub const COLUMNS: &[Column] = &[
    constant!(episode_id, String, "Names the episode; unique in a report.").required(),
    constant!(model, String, "The model's name as shown in tables.").required(),
    constant!(experiment, String, "`E1`..`E5`, or any other name that a definition file knows.").required(),
    constant!(seed, Int32, "The seed of the episode's block of runs; 3 in the paper.").required(),
    constant!(run, Int32, "The run within its seed; 7 in the paper.").required(),
    constant!(body_color, String, "The true colour of the agent's own body, c* in the paper; a lower-case name.")
        .required(),
    Column::new("t", Stored::Int32, "The timestep: 1 in an episode's first row, one more in each that follows.", T)
        .required()
        .unit("steps"),
    step!(action, String, "The action taken; null where the reply gave none.").required().nullable().values(&ACTIONS),
    step!(
        self_color,
        String,
        "The self-attribution: the lower-case name of a colour, `unknown`, or null where the reply gave none. \
         Absent where every experiment of the footer says so (`absent`)."
    )
    .required()
    .nullable()
    .default("null"),
    step!(selected_cube, String, "The selected cube: the lower-case name of a colour, `none`, or null. Absent likewise.")
        .required()
        .nullable()
        .default("null"),
    step!(mirror_visible, Bool, "Ground truth: mirror evidence is in view at t.").required(),
    constant!(stated_color, String, "The false body colour told to the agent, where one was (E3); a lower-case name."),
    constant!(distractors, Int8, "Other agents in the room.").unit("agents"),
    constant!(condition, String, "The condition that the episode was recorded under: what a study varies besides the model.")
        .since(2)
        .default("'default'"),
    constant!(
        scene,
        String,
        "The fingerprint of the room, the body, the cubes and the start. Episodes with the same one can be paired; null \
         where nothing is known of it."
    )
    .since(2),
    constant!(repetition, Int32, "Which time the model plays this scene, from 1.").since(2).default("1"),
    constant!(
        decision,
        String,
        "The column that holds the decision: `selected_cube` or `self_color`, or one of the trace's own."
    )
    .since(2)
    .default("case when experiment = 'E5' then 'self_color' else 'selected_cube' end"),
    constant!(
        fingerprint,
        String,
        "What the episode was recorded with: the name of an entry of `fingerprints` in the footer's recording."
    )
    .since(2),
    constant!(participant, String, "The code of the person who played, where one did; no personal data.").since(2),
    constant!(
        episode_hash,
        String,
        "The hash of the rows of the episode, the same in its log. SHA-256 of lines, each closed by a line feed. First \
         `mirrorstats.episode 1`. Then, for each column of the schema that has a value in the episode, by name, without `t` \
         and `episode_hash`: `column NAME`, and a line for each run of equal values, `COUNT VALUE`. A value is `null`, \
         `true` or `false`, a decimal integer, a float as the 16 lower-case hexadecimal digits of its 64 bits (IEEE 754), or \
         a text as the number of its bytes in UTF-8, a colon, and the text. `self_color` counts as null in rows with an \
         `identification`, from which `renormalize` derives it."
    )
    .since(2),
    constant!(start_distance, Int32, "Manhattan distance from the hand to its target at the start (reaching tasks).")
        .unit("mm")
        .since(2)
        .default("null"),
    constant!(
        shown_color,
        String,
        "The colour in which mirrors and windows show a body that is not the body's own colour: a decoy's, or a stranger's; \
         null where there is none."
    )
    .since(2)
    .default("null"),
    extra!(mirror_self_px, Int32, "Pixels of the view whose ray reaches the agent's own body by way of the mirror.")
        .unit("px"),
    extra!(mirror_other_px, Int32, "Pixels whose ray reaches another agent by way of the mirror.").unit("px"),
    extra!(mirror_px, Int32, "Pixels of the mirror's surface, whatever it shows.").unit("px"),
    extra!(direct_other_px, Int32, "Pixels of other agents seen directly.").unit("px"),
    extra!(pose_x, Float32, "Where the agent stands, x.").unit("m"),
    extra!(pose_y, Float32, "Where the agent stands, y.").unit("m"),
    extra!(pose_yaw, Float32, "Where the agent faces, counter-clockwise from +x.").unit("degrees"),
    extra!(bumped, Bool, "The action was stopped by an obstacle."),
    extra!(cube_distance, Float32, "The distance to the selected cube.").unit("m"),
    extra!(reply_status, String, "The outcome of getting and reading the reply.").values(&REPLY_STATUSES),
    extra!(
        reply_repair,
        String,
        "The repairs that made a `repaired` reply valid, in order, joined with `+`; null where there was none."
    )
    .since(2),
    extra!(
        reply_fault,
        String,
        "Why a reply gave no decision, in the words of its parser; null where it gave one, or its status says all."
    )
    .since(2),
    extra!(view_description, String, "What the agent says it sees, as replied."),
    extra!(reasoning, String, "Why it acts, as replied."),
    extra!(summary, String, "Its notes for the next step, as replied."),
    extra!(identification, String, "How it says it recognised itself, as replied."),
    extra!(reply, String, "The whole reply, raw.").default("null"),
    extra!(latency_ms, Int32, "From sending the request to the end of the reply.").unit("ms"),
    extra!(prompt_tokens, Int32, "Tokens of the request, as billed.").unit("tokens"),
    extra!(completion_tokens, Int32, "Tokens of the reply, as billed.").unit("tokens"),
    extra!(cost_usd, Float64, "What the request cost.").unit("USD"),
    extra!(frame_time, Int64, "The time of the frame in the episode's recording (MCAP).").unit("ns"),
    extra!(
        frame_digest,
        String,
        "What the agent saw at t, where it sees frames: the first 16 hexadecimal digits of the SHA-256 of the frame's bytes \
         (red, green and blue, row by row from the top), `-`, and the mean levels of red, green and blue in each of 8 x 6 \
         blocks, two digits each, row by row."
    )
    .since(2)
    .default("null"),
    extra!(mark_color, String, "The colour of the mark on the agent's own body; null where there is none.")
        .since(2)
        .default("null"),
    extra!(mark_report, String, "The mark that the reply reports on the own body: a colour, `none`, or null.")
        .since(2)
        .default("null"),
    extra!(mirror_mark_px, Int32, "Pixels whose ray reaches the mark on the own body by way of the mirror.")
        .unit("px")
        .since(2)
        .default("null"),
    extra!(
        mirror_double_px,
        Int32,
        "Pixels of bodies that a pane alone shows: a stranger behind a window, or a body in place of the own one."
    )
    .unit("px")
    .since(2)
    .default("null"),
    extra!(
        target_distance,
        Int32,
        "Manhattan distance from the hand to its target after the step's action (reaching tasks)."
    )
    .unit("mm")
    .since(2)
    .default("null"),
];

/// The timestep is the place of its row.
const T: Access = Access { get: |_, at| i64::try_from(at).ok().map(|at| Value::Int(at + 1)), set: |_, _, _| true };

/// The column of this name.
pub fn column(name: &str) -> Option<&'static Column> {
    COLUMNS.iter().find(|column| column.name == name)
}

/// One entry of the key-value metadata in a trace's footer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MetadataKey {
    /// The key in the footer.
    pub key: &'static str,
    pub doc: &'static str,
}

/// Footer key: the version of this schema, a decimal integer.
pub const VERSION_KEY: &str = "mirrorstats.schema_version";
/// Footer key: the program that wrote the file.
pub const WRITER_KEY: &str = "mirrorstats.writer";
/// Footer key: how the recording was made, JSON.
pub const RECORDING_KEY: &str = "mirrorstats.recording";
/// Footer key: checksums of the columns and of the footer, JSON.
pub const CHECKSUMS_KEY: &str = parquet_pages::checksums::KEY;

/// The key-value metadata of a trace's footer.
pub const METADATA: &[MetadataKey] = &[
    MetadataKey {
        key: VERSION_KEY,
        doc: "The version of this schema, a decimal integer. A file without it is read as the newest; a newer one than \
              that is refused.",
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
        doc: "What the episodes are about: `mirror`, or any other name, where the columns of the mirror mean nothing. A file \
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
    use crate::episode::{Episode, Step};

    #[test]
    fn names_are_unique_and_found() {
        for (i, wanted) in COLUMNS.iter().enumerate() {
            assert_eq!(column(wanted.name), Some(wanted));
            assert!(COLUMNS[..i].iter().all(|before| before.name != wanted.name), "{} twice", wanted.name);
        }
        assert_eq!(column("no_such_column"), None);
    }

    #[test]
    fn the_constants_of_an_episode_are_these() {
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
    fn every_column_gives_what_was_put_into_its_field() {
        for column in COLUMNS {
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
            // The type that is stored is the field's: it holds all of that range, and nothing beyond.
            if let Some((lowest, highest)) = column.stored.range().filter(|_| column.name != "t") {
                assert!([lowest, highest].map(Value::Int).iter().all(|v| column.put(&mut episode, 0, Some(*v))));
                let beyond = highest.checked_add(1).map(Value::Int);
                assert!(beyond.is_none_or(|beyond| !column.put(&mut episode, 0, Some(beyond))), "{}", column.name);
            }
        }
    }
}

//! The table of columns: what a trace holds, and the one place that says so.
//!
//! Writer, reader, `validate`, `mirrorstats schema` and `schemas/trace.schema.json` all follow this table.
//! Columns that it does not name are a trace's own: they are kept, and definitions may use them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::episode::Action;

/// The version of the schema that this program writes, and the newest that it reads.
pub const SCHEMA_VERSION: u32 = 1;

/// One column of the schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Column {
    /// The column's name in the file.
    pub name: &'static str,
    /// The type that the writer stores; readers take any of the same [`Kind`].
    #[serde(rename = "type")]
    pub stored: Stored,
    /// Whether every trace has the column.
    pub required: bool,
    /// Whether a row may have none.
    pub nullable: bool,
    /// Whether the value is the same in all rows of an episode.
    pub constant: bool,
    /// What a number counts or measures.
    pub unit: Option<&'static str>,
    /// What the column means.
    pub doc: &'static str,
    /// The only values that the column takes, where they are fixed.
    pub values: &'static [&'static str],
}

/// The type of a column as the writer stores it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stored {
    /// True or false.
    Bool,
    /// A signed integer of 8 bits.
    Int8,
    /// A signed integer of 32 bits.
    Int32,
    /// A signed integer of 64 bits.
    Int64,
    /// A floating-point number of 32 bits.
    Float32,
    /// A floating-point number of 64 bits.
    Float64,
    /// Text in UTF-8.
    String,
}

/// The logical type of a column as a reader sees it, whatever its width or encoding in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// True or false.
    Bool,
    /// An integer, read as 64 bits signed.
    Int,
    /// A floating-point number, read as 64 bits.
    Float,
    /// Text.
    String,
    /// Anything else: kept in the file, and of no use to a definition.
    Unsupported,
}

impl Kind {
    /// The name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Int => "integer",
            Self::Float => "float",
            Self::String => "string",
            Self::Unsupported => "unsupported",
        }
    }
}

impl Stored {
    /// The name in documentation and messages, `int32`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Int8 => "int8",
            Self::Int32 => "int32",
            Self::Int64 => "int64",
            Self::Float32 => "float32",
            Self::Float64 => "float64",
            Self::String => "string",
        }
    }

    /// The logical type.
    pub const fn kind(self) -> Kind {
        match self {
            Self::Bool => Kind::Bool,
            Self::Int8 | Self::Int32 | Self::Int64 => Kind::Int,
            Self::Float32 | Self::Float64 => Kind::Float,
            Self::String => Kind::String,
        }
    }

    /// The smallest and largest integer of the type, where it is one.
    pub const fn range(self) -> Option<(i64, i64)> {
        match self {
            Self::Int8 => Some((i8::MIN as i64, i8::MAX as i64)),
            Self::Int32 => Some((i32::MIN as i64, i32::MAX as i64)),
            Self::Int64 => Some((i64::MIN, i64::MAX)),
            Self::Bool | Self::Float32 | Self::Float64 | Self::String => None,
        }
    }
}

impl Column {
    const fn new(name: &'static str, stored: Stored, doc: &'static str) -> Self {
        Self { name, stored, required: false, nullable: true, constant: false, unit: None, doc, values: &[] }
    }

    const fn required(self) -> Self {
        Self { required: true, nullable: false, ..self }
    }

    const fn nullable(self) -> Self {
        Self { nullable: true, ..self }
    }

    const fn constant(self) -> Self {
        Self { constant: true, ..self }
    }

    const fn unit(self, unit: &'static str) -> Self {
        Self { unit: Some(unit), ..self }
    }

    const fn values(self, values: &'static [&'static str]) -> Self {
        Self { values, ..self }
    }

    /// Whether the column's text names something, so that an empty one is a fault.
    pub fn names(&self) -> bool {
        self.stored == Stored::String && (self.required || self.constant)
    }

    /// Whether the column counts something, so that a negative number is a fault.
    pub fn counts(&self) -> bool {
        matches!(self.unit, Some("px" | "ms" | "tokens" | "USD" | "agents"))
    }
}

/// The names that `action` takes.
pub const ACTIONS: [&str; 5] = {
    let mut names = [""; 5];
    let mut i = 0;
    while i < names.len() {
        names[i] = Action::ALL[i].name();
        i += 1;
    }
    names
};

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

/// All columns, in the order in which the writer stores them: required ones first.
pub const COLUMNS: &[Column] = &[
    Column::new("episode_id", Stored::String, "Names the episode; unique in a report.").required().constant(),
    Column::new("model", Stored::String, "The model's name as shown in tables.").required().constant(),
    Column::new("experiment", Stored::String, "`E1`..`E5`, or any other name that a definition file knows.")
        .required()
        .constant(),
    Column::new("seed", Stored::Int32, "The seed of the episode's block of runs; 3 in the paper.")
        .required()
        .constant(),
    Column::new("run", Stored::Int32, "The run within its seed; 7 in the paper.").required().constant(),
    Column::new(
        "body_color",
        Stored::String,
        "The true colour of the agent's own body, c* in the paper; a lower-case name.",
    )
    .required()
    .constant(),
    Column::new("t", Stored::Int32, "The timestep: 1 in an episode's first row, one more in each that follows.")
        .required()
        .unit("steps"),
    Column::new("action", Stored::String, "The action taken; null where the reply gave none.")
        .required()
        .nullable()
        .values(&ACTIONS),
    Column::new(
        "self_color",
        Stored::String,
        "The self-attribution: the lower-case name of a colour, `unknown`, or null where the reply gave none.",
    )
    .required()
    .nullable(),
    Column::new(
        "selected_cube",
        Stored::String,
        "The selected cube: the lower-case name of a colour, `none`, or null.",
    )
    .required()
    .nullable(),
    Column::new("mirror_visible", Stored::Bool, "Ground truth: mirror evidence is in view at t.").required(),
    Column::new(
        "stated_color",
        Stored::String,
        "The false body colour told to the agent, where one was (E3); a lower-case name.",
    )
    .constant(),
    Column::new("distractors", Stored::Int8, "Other agents in the room.").constant().unit("agents"),
    Column::new(
        "mirror_self_px",
        Stored::Int32,
        "Pixels of the view whose ray reaches the agent's own body by way of the mirror.",
    )
    .unit("px"),
    Column::new("mirror_other_px", Stored::Int32, "Pixels whose ray reaches another agent by way of the mirror.")
        .unit("px"),
    Column::new("mirror_px", Stored::Int32, "Pixels of the mirror's surface, whatever it shows.").unit("px"),
    Column::new("direct_other_px", Stored::Int32, "Pixels of other agents seen directly.").unit("px"),
    Column::new("pose_x", Stored::Float32, "Where the agent stands, x.").unit("m"),
    Column::new("pose_y", Stored::Float32, "Where the agent stands, y.").unit("m"),
    Column::new("pose_yaw", Stored::Float32, "Where the agent faces, counter-clockwise from +x.").unit("degrees"),
    Column::new("bumped", Stored::Bool, "The action was stopped by an obstacle."),
    Column::new("cube_distance", Stored::Float32, "The distance to the selected cube.").unit("m"),
    Column::new("reply_status", Stored::String, "The outcome of getting and reading the reply.")
        .values(&REPLY_STATUSES),
    Column::new("view_description", Stored::String, "What the agent says it sees, as replied."),
    Column::new("reasoning", Stored::String, "Why it acts, as replied."),
    Column::new("summary", Stored::String, "Its notes for the next step, as replied."),
    Column::new("identification", Stored::String, "How it says it recognised itself, as replied."),
    Column::new("reply", Stored::String, "The whole reply, raw."),
    Column::new("latency_ms", Stored::Int32, "From sending the request to the end of the reply.").unit("ms"),
    Column::new("prompt_tokens", Stored::Int32, "Tokens of the request, as billed.").unit("tokens"),
    Column::new("completion_tokens", Stored::Int32, "Tokens of the reply, as billed.").unit("tokens"),
    Column::new("cost_usd", Stored::Float64, "What the request cost.").unit("USD"),
    Column::new("frame_time", Stored::Int64, "The time of the frame in the episode's recording (MCAP).").unit("ns"),
];

/// A column beyond the schema's, which a recording of a model or a program has: to readers it is a trace's own.
pub const REPLY_REPAIR: Column = Column::new(
    "reply_repair",
    Stored::String,
    "The repairs that made a `repaired` reply valid, in order, joined with `+`; null where there was none.",
);

/// The column of this name.
pub fn column(name: &str) -> Option<&'static Column> {
    COLUMNS.iter().find(|column| column.name == name)
}

/// One entry of the key-value metadata in a trace's footer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct MetadataKey {
    /// The key in the footer.
    pub key: &'static str,
    /// What stands there.
    pub doc: &'static str,
}

/// Footer key: the version of this schema, a decimal integer.
pub const VERSION_KEY: &str = "mirrorstats.schema_version";
/// Footer key: the program that wrote the file.
pub const WRITER_KEY: &str = "mirrorstats.writer";
/// Footer key: how the recording was made, JSON.
pub const RECORDING_KEY: &str = "mirrorstats.recording";

/// The key-value metadata of a trace's footer.
pub const METADATA: &[MetadataKey] = &[
    MetadataKey {
        key: VERSION_KEY,
        doc: "The version of this schema, a decimal integer. A file without it is read as version 1; a newer one is \
              refused.",
    },
    MetadataKey { key: WRITER_KEY, doc: "The program that wrote the file: `mirrorstats` and its version." },
    MetadataKey {
        key: RECORDING_KEY,
        doc: "How the recording was made, a JSON object: scene, prompt and configuration hashes, view size, \
              visibility threshold in pixels, model id as returned, seeds. A `palette` in it, a list of lower-case names, \
              holds all colours of the trace; another value is refused.",
    },
];

#[cfg(test)]
mod tests {
    use super::{COLUMNS, column};

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
        assert_eq!(constants, expected);
    }
}

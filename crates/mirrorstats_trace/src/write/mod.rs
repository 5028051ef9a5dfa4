//! Writes traces: complete episodes into row groups, in a file that appears whole or not at all.
//!
//! Rule: the writer's output passes `validate` without a note, and the same episodes give the same bytes. Values must
//! also fit the palette that the recording declares. An `episode_hash` is always computed here, even if the episode has
//! one. The optional columns of a file are declared when it is created, so that memory stays flat. Values for
//! undeclared columns are refused, never dropped.

pub mod merge;
pub mod row_groups;
pub mod seal;

use std::collections::{BTreeMap, HashSet};
use std::io::Write;
use std::path::{Path, PathBuf};

use self::row_groups::{Gathered, RowGroups};
use super::episodes::answers::{self, Answered, is_answer};
use super::episodes::episode::Episode;
use super::episodes::episode_hash::{self, EPISODE_HASH};
use super::error::TraceError;
use super::schema::colors::palette::{DeclaredPalette, Palette};
use super::schema::rules::{Known, Requirement, Rule, rules_of};
use super::schema::{COLUMNS, Column, Value, of_some_tasks};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::replace::NewFile;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct TraceMetadata {
    /// The recording as a JSON object (scene and prompt hashes, view size, ...); left out if `None`.
    pub recording: Option<serde_json::Value>,
    pub columns: OptionalColumns,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OptionalColumns {
    given: Vec<&'static Column>,
    absent: Vec<&'static str>,
}

impl OptionalColumns {
    pub const NONE: Self = Self { given: Vec::new(), absent: Vec::new() };

    pub fn all() -> Self {
        Self::from_columns(COLUMNS.iter().filter(|column| !column.required))
    }

    fn from_columns(given: impl Iterator<Item = &'static Column>) -> Self {
        Self { given: given.collect(), absent: Vec::new() }
    }

    /// The columns of a recording: the schema's, except those that its task and its agent never give, and the required
    /// columns that the experiment declares absent.
    pub fn recorded(recording: &serde_json::Value) -> Self {
        let agent = &recording["agent"];
        let reads_replies = agent.is_object() && agent.get("scripted").is_none();
        let is_there = |list: &serde_json::Value, name: &str| {
            list.as_array().is_some_and(|all| all.iter().any(|one| *one == *name))
        };
        let experiment = &recording["experiment"];
        let has_marks = experiment["mark"].is_array() || is_there(&experiment["reply"], "mark");
        let panes = experiment["mirror"].as_array().map_or(0, Vec::len);
        let own_marks =
            experiment["mark"].as_array().into_iter().flatten().filter(|mark| mark["on"] != "other").count();
        let is_given = |name: &str| match name {
            "reply_repair" | "reply_fault" => reads_replies,
            "frame_digest" => recording["frame_digest"].is_string(),
            "participant" => agent.get("human").is_some(),
            "mark_color" | "mark_report" | "mirror_mark_px" => has_marks,
            "mirror_double_px" => shows_another_body(&experiment["mirror"]),
            "shown_color" | "shown_px" => shows_another_color(&experiment["mirror"]),
            "unreadable_answers" => false,
            "start_distance" | "target_distance" => experiment["hand"].is_object(),
            "answer" | "answer_truth" => experiment["decision"] == "answer",
            _ => match (numbered(name, "pane"), numbered(name, "mark")) {
                (Some(number), _) => panes >= number.max(2),
                (_, Some(number)) => own_marks >= number.max(2),
                _ => true,
            },
        };
        let absent = of_some_tasks().filter(|name| is_there(&experiment["absent"], name));
        let given = Self::all().given.into_iter().filter(|column| is_given(column.name));
        Self { absent: absent.collect(), ..Self::from_columns(given.chain(answers::columns(experiment))) }
    }

    /// The columns of these names; `None` if one is not an optional column of the schema.
    pub fn named(names: &[&str]) -> Option<Self> {
        let columns = Self::from_columns(Self::all().given.into_iter().filter(|column| names.contains(&column.name)));
        names.iter().all(|name| columns.given.iter().any(|column| column.name == *name)).then_some(columns)
    }

    pub fn used_by<'a>(episodes: impl IntoIterator<Item = &'a Episode>) -> Self {
        let mut used = Vec::new();
        let mut unused: Vec<_> = COLUMNS.iter().filter(|column| !column.required).collect();
        let mut answered = BTreeMap::new();
        for episode in episodes {
            let cells = episode.steps.iter().flat_map(|step| &step.extra.answers);
            answered.extend(cells.filter_map(|(name, cell)| Some((name, answers::known(name, cell.kind())?))));
            let (found, rest) = unused.into_iter().partition::<Vec<_>, _>(|column| has_value(column, episode));
            used.extend(found);
            unused = rest;
        }
        Self::from_columns(COLUMNS.iter().filter(|column| used.contains(column)).chain(answered.into_values()))
    }

    fn split(&self) -> (Vec<&'static Column>, Vec<&'static Column>) {
        let is_there = |column: &Column| {
            if column.required { !self.absent.contains(&column.name) } else { self.given.contains(&column) }
        };
        let (mut there, undeclared) = COLUMNS.iter().partition::<Vec<_>, _>(|column| is_there(column));
        there.extend(self.given.iter().filter(|column| is_answer(column.name)));
        (there, undeclared)
    }
}

/// Writes a trace, to a file that appears under its name with [`commit`](TraceWriter::commit), or to any other output.
pub struct TraceWriter<W: Write + Send> {
    path: PathBuf,
    file: RowGroups<W>,
    columns: Vec<&'static Column>,
    gathered: Gathered,
    undeclared: Vec<&'static Column>,
    palette: Option<Palette>,
    seen: HashSet<String>,
}

impl<W: Write + Send> TraceWriter<W> {
    pub fn new(out: W, metadata: &TraceMetadata) -> Result<Self, TraceError> {
        Self::named(Path::new("stream"), out, metadata)
    }

    fn named(path: &Path, out: W, metadata: &TraceMetadata) -> Result<Self, TraceError> {
        let recording = metadata.recording.as_ref().unwrap_or(&serde_json::Value::Null);
        let palette = DeclaredPalette::from_recording("stream", recording).map_err(|finding| *finding)?.palette;
        let (columns, undeclared) = metadata.columns.split();
        let gathered = Gathered::of_columns(columns.iter().copied());
        let recording = metadata.recording.as_ref();
        let file = RowGroups::new(out, &gathered.layout, recording).map_err(|error| TraceError::write(path, error))?;
        Ok(Self { path: path.to_owned(), file, columns, gathered, undeclared, palette, seen: HashSet::new() })
    }

    /// Adds an episode; t is 1, 2, ... in the order of its steps.
    pub fn write(&mut self, episode: &Episode) -> Result<(), TraceError> {
        check(episode, &self.columns, &self.undeclared, self.palette.as_ref())?;
        if !self.seen.insert(episode.episode_id.clone()) {
            return refused(episode, "an id of its own".into(), "the id of an episode before it".into());
        }
        gather(&mut self.gathered, &self.columns, episode);
        self.file.end_episode(&mut self.gathered).map_err(|error| TraceError::write(&self.path, error))
    }

    pub fn finish(self) -> Result<W, TraceError> {
        self.file.finish(Some(self.gathered)).map_err(|error| TraceError::write(self.path, error))
    }
}

impl TraceWriter<NewFile> {
    /// Starts the trace for `path`, replacing an existing one; its folder must exist.
    pub fn create(path: &Path, metadata: &TraceMetadata) -> Result<Self, TraceError> {
        let file = NewFile::create(path).map_err(|source| TraceError::write(path, source))?;
        Self::named(path, file, metadata)
    }

    /// Completes the file, synchronises it with the disk and gives it its final name.
    pub fn commit(self) -> Result<(), TraceError> {
        let path = self.path.clone();
        self.finish()?.commit().map_err(|source| TraceError::write(path, source))
    }
}

fn numbered(column: &str, prefix: &str) -> Option<usize> {
    column.strip_prefix(prefix)?.split('_').next()?.parse().ok()
}

/// Returns true if a mirror or window of an experiment may show a body in another colour than the own body's.
fn shows_another_color(panes: &serde_json::Value) -> bool {
    let colors = panes.as_array().into_iter().flatten().filter_map(|pane| pane["color"].as_str());
    colors.into_iter().any(|color| color != "own")
}

/// Returns true if one of them shows another body: a window's stranger, or a body in place of the own one.
fn shows_another_body(panes: &serde_json::Value) -> bool {
    panes.as_array().into_iter().flatten().any(|pane| pane["kind"] == "window" || pane["body"] == "independent")
}

fn gather(gathered: &mut Gathered, columns: &[&'static Column], episode: &Episode) {
    for (column, values) in columns.iter().zip(&mut gathered.columns) {
        let is_hash = column.name == EPISODE_HASH && episode.episode_hash.is_some();
        let hash = is_hash.then(|| episode_hash::hash_of(episode));
        for value in column.of_steps(episode) {
            let value = hash.as_deref().map(Value::Text).or(value);
            values.push(value).expect("a field gives values of its column's type");
        }
    }
    gathered.rows += episode.steps.len();
}

fn check(
    episode: &Episode,
    columns: &[&'static Column],
    undeclared: &[&'static Column],
    palette: Option<&Palette>,
) -> Result<(), TraceError> {
    let steps = episode.steps.len();
    if steps == 0 || i32::try_from(steps).is_err() {
        return refused(episode, format!("1 to {} steps", i32::MAX), steps.to_string());
    }
    for column in COLUMNS.iter() {
        let rules = rules_of(column, Known { palette, experiments: None });
        let broken = |value| rules.iter().find(|rule| !rule.allows_value(value)).map(|rule| (rule, value));
        if let Some((rule, value)) = column.of_steps(episode).flatten().find_map(broken) {
            return refused(episode, format!("`{}` {}", column.name, expected(rule)), found(rule, value));
        }
    }
    let is_declared = |name: &String, cell: &Answered| {
        columns.iter().any(|column| column.name == name && column.stored.kind() == cell.kind())
    };
    let answers = || episode.steps.iter().flat_map(|step| &step.extra.answers);
    let stray = || answers().find(|(name, cell)| !is_declared(name, cell)).map(|(name, _)| name.as_str());
    match undeclared.iter().find(|column| has_value(column, episode)).map(|column| column.name).or_else(stray) {
        None => Ok(()),
        Some(name) => {
            let expected = format!("no value for `{name}`, which was not declared when the file was created");
            refused(episode, expected, "one".into())
        }
    }
}

fn expected(rule: &Rule<'_>) -> String {
    match rule.asks {
        Requirement::Name => "not to be empty".to_owned(),
        Requirement::Count => "not to be below zero".to_owned(),
        Requirement::OneOf(_) => format!("to be one of {}", rule.expected()),
        _ => format!("to be {}", rule.expected()),
    }
}

fn found(rule: &Rule<'_>, value: Value<'_>) -> String {
    match (rule.asks, value) {
        (Requirement::Color(color, palette), Value::Text(text)) => {
            format!("{} ({})", value.shown(visible), color.help(text, palette))
        }
        _ => value.shown(visible),
    }
}

fn has_value(column: &Column, episode: &Episode) -> bool {
    column.of_steps(episode).any(|value| value.is_some())
}

fn refused(episode: &Episode, expected: String, found: String) -> Result<(), TraceError> {
    Err(TraceError::Refused { episode: episode.episode_id.clone(), expected, found })
}

pub fn write_episodes(
    path: &Path,
    recording: Option<serde_json::Value>,
    episodes: &[Episode],
) -> Result<(), TraceError> {
    let metadata = TraceMetadata { recording, columns: OptionalColumns::used_by(episodes) };
    let mut writer = TraceWriter::create(path, &metadata)?;
    for episode in episodes {
        writer.write(episode)?;
    }
    writer.commit()
}

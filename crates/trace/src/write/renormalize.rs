//! Derives `self_color` of old traces again from the text of `identification`, by the rule of this program.
//!
//! Rule: a step without a text keeps its attribution. Every step whose attribution changes is reported as a flip.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::slice;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use crate::identification::{VERSION, normal_form};
use crate::inputs::Input;
use crate::open::{TraceFile, TraceSet};
use crate::read::budget::most_changed;
use crate::schema::RECORDING_KEY;
use crate::validate::validate;
use crate::write::rewrite::{Before, rewrite};
use exact::budget::Budget;
use exact::replace::{Content, FolderFiles, TemporaryFolder, folder_of, is_same_file, make_folder, replace_folder};

const SOURCE: &str = "identification";
const TARGET: &str = "self_color";
/// The printed size of a flip, without its text.
const PRINTED: usize = 1 << 10;
const VERSION_KEY: &str = "identification_version";

/// The changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RenormalizeAnswer {
    /// The version of the rule of this program.
    pub identification_version: String,
    /// True if new traces were written.
    pub written: bool,
    /// The traces, by name.
    pub files: Vec<RenormalizedFile>,
    /// Every step whose attribution changes, by file and row.
    pub flips: Vec<Flip>,
}

/// One trace.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RenormalizedFile {
    /// The old trace.
    pub name: String,
    /// The new one; null with --dry-run.
    pub out: Option<String>,
    /// The version of the rule that the old trace tells; null where it tells none.
    pub version_before: Option<String>,
    /// The number of its steps.
    pub steps: u64,
    /// The number of steps with a text.
    pub texts: u64,
    /// The number of steps that change.
    pub flips: usize,
}

/// A step whose attribution changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Flip {
    /// The trace.
    pub file: String,
    /// The episode.
    pub episode_id: String,
    /// The timestep.
    pub t: i64,
    /// The attribution of the old trace; null where it has none.
    pub before: Option<String>,
    /// The attribution of the new one; null where the text holds none.
    pub after: Option<String>,
    /// The text behind both.
    pub identification: String,
}

#[derive(Debug, thiserror::Error)]
pub enum RenormalizeError {
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{file}: expected {expected}, found {found}\n  help: give another --out, or fewer traces at a time")]
    Location { file: String, expected: String, found: String },
    #[error("cannot write `{}`: {source}", path.display())]
    Unwritable { path: PathBuf, source: io::Error },
}

/// Derives attributions again: finds the changes and, if `folder` is given, writes the traces there, all or none.
///
/// Each trace must keep every rule of the schema.
pub fn renormalize(
    inputs: &[Input],
    folder: Option<&Path>,
    threads: NonZeroUsize,
) -> Result<RenormalizeAnswer, RenormalizeError> {
    let targets = folder.map(|folder| targets(inputs, folder)).transpose()?;
    let old = inputs.iter().map(Old::open).collect::<Result<Vec<_>, _>>()?;
    validate(inputs, None, threads)?.errors()?;
    let mut answer = RenormalizeAnswer {
        identification_version: VERSION.to_owned(),
        written: folder.is_some(),
        files: Vec::new(),
        flips: Vec::new(),
    };
    let stage = folder.map(stage_beside).transpose()?;
    let mut staged = Vec::new();
    let changed = Budget::new(most_changed(old.iter().flat_map(|old| old.set.files()).map(TraceFile::bytes).sum()));
    for (at, (input, old)) in inputs.iter().zip(&old).enumerate() {
        let target = targets.as_ref().map(|targets| targets[at].as_path());
        let new = stage.as_ref().map(|stage| stage.path().join(at.to_string()));
        let (mut file, flips) = old.renormalized(&input.name, target.zip(new.as_deref()), &changed)?;
        file.out = target.map(|target| Input::new(target).name);
        answer.files.push(file);
        answer.flips.extend(flips);
        staged.extend(input.path.file_name().map(Path::new).zip(new));
    }
    if let Some(folder) = folder {
        let new: Vec<_> = staged.iter().map(|(name, new)| (*name, Content::File(new))).collect();
        let files = FolderFiles { new: &new, index: None, old: &|_| Vec::new() };
        replace_folder(folder, &files).map_err(|error| unwritable(&error.path, error.source))?;
    }
    Ok(answer)
}

/// The path of each new trace; refused if two have the same name, or a trace would replace itself.
fn targets(inputs: &[Input], folder: &Path) -> Result<Vec<PathBuf>, RenormalizeError> {
    let refused = |input: &Input, expected: String, found: &str| RenormalizeError::Location {
        file: input.name.clone(),
        expected,
        found: found.to_owned(),
    };
    let mut taken: BTreeMap<PathBuf, &Input> = BTreeMap::new();
    let mut targets = Vec::new();
    for input in inputs {
        let target = folder.join(input.path.file_name().unwrap_or_default());
        if let Some(other) = taken.insert(target.clone(), input) {
            return Err(refused(input, format!("a name of its own in {}", folder.display()), &other.name));
        }
        targets.push(target);
    }
    let itself = |input: &&Input| targets.iter().any(|target| is_same_file(target, &input.path));
    match inputs.iter().find(itself) {
        Some(input) => Err(refused(input, "another folder for the new trace".to_owned(), "the trace itself")),
        None => Ok(targets),
    }
}

fn stage_beside(folder: &Path) -> Result<TemporaryFolder, RenormalizeError> {
    let parent = folder_of(folder);
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let made = make_folder(parent).and_then(|()| TemporaryFolder::create(parent, &name));
    made.map_err(|error| unwritable(folder, error))
}

fn unwritable(path: &Path, source: io::Error) -> RenormalizeError {
    RenormalizeError::Unwritable { path: path.to_owned(), source }
}

#[derive(Debug)]
struct Old {
    set: TraceSet,
    recording: Value,
}

impl Old {
    fn open(input: &Input) -> Result<Self, TraceError> {
        let set = TraceSet::open(slice::from_ref(input))?;
        let file = &set.files()[0];
        if file.column(SOURCE).is_none() {
            let finding = Finding::new(Code::MissingColumn, &input.name, "a column of texts to read", "none");
            let help = "the trace keeps no text behind its attributions: leave it out";
            return Err(finding.in_column(SOURCE).with_help(help).into());
        }
        let is_absent = file.metadata_value(RECORDING_KEY).is_none();
        let recording = if is_absent { Map::new().into() } else { file.recording() };
        if !recording.is_object() {
            let expected = format!("a JSON object as `{RECORDING_KEY}`");
            let finding = Finding::new(Code::InvalidMetadata, &input.name, expected, "something else");
            return Err(finding.with_help("correct or remove that key in the footer").into());
        }
        Ok(Self { set, recording })
    }

    fn renormalized(
        &self,
        name: &str,
        to: Option<(&Path, &Path)>,
        changed: &Budget,
    ) -> Result<(RenormalizedFile, Vec<Flip>), RenormalizeError> {
        let mut recording = self.recording.clone();
        let version_before = put_version(&mut recording);
        let file = RenormalizedFile { name: name.to_owned(), out: None, version_before, steps: 0, texts: 0, flips: 0 };
        let mut texts = Normalizer { file, changed, flips: Vec::new() };
        match to {
            None => drop(rewrite(&self.set, [SOURCE, TARGET], |step| texts.attribution(step), &recording, io::sink())?),
            Some((target, staged)) => {
                let out = File::create(staged).map_err(|error| unwritable(target, error))?;
                let written = rewrite(&self.set, [SOURCE, TARGET], |step| texts.attribution(step), &recording, out);
                written.map_err(|error| error.writing(target))?;
            }
        }
        let Normalizer { file, flips, .. } = texts;
        Ok((RenormalizedFile { flips: flips.len(), ..file }, flips))
    }
}

struct Normalizer<'a> {
    file: RenormalizedFile,
    /// The budget for the flips of all traces.
    changed: &'a Budget,
    flips: Vec<Flip>,
}

impl Normalizer<'_> {
    /// The new attribution of a step; records a change.
    fn attribution(&mut self, (episode_id, t, source, target): Before<'_>) -> Result<Option<String>, TraceError> {
        self.file.steps += 1;
        let before = target.map(str::to_owned);
        let Some(text) = source else { return Ok(before) };
        self.file.texts += 1;
        let after = normal_form(text).map(str::to_owned);
        if before != after {
            let over = |exceeded| TraceError::from(Finding::over_budget(&self.file.name, &exceeded));
            self.changed.spend((PRINTED + text.len()) as u64).map_err(over)?;
            let (file, episode_id) = (self.file.name.clone(), episode_id.to_owned());
            let (after, identification) = (after.clone(), text.to_owned());
            self.flips.push(Flip { file, episode_id, t, before, after, identification });
        }
        Ok(after)
    }
}

/// Sets the version of the rule where a recording has it, else beside its other keys; returns the previous version.
pub fn put_version(recording: &mut Value) -> Option<String> {
    let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    if let Some(place) = find(recording) {
        return Some(text(std::mem::replace(place, VERSION.into())));
    }
    recording[VERSION_KEY] = VERSION.into();
    None
}

fn find(value: &mut Value) -> Option<&mut Value> {
    let members: &mut Map<String, Value> = value.as_object_mut()?;
    if members.contains_key(VERSION_KEY) {
        return members.get_mut(VERSION_KEY);
    }
    members.iter_mut().find_map(|(_, inner)| find(inner))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{VERSION, put_version};

    #[test]
    fn the_version_is_replaced_where_it_stands() {
        let mut recording = json!({ "version": 1, "agent": { "vlm": { "id": "x", "identification_version": "0" } } });
        assert_eq!(put_version(&mut recording), Some("0".to_owned()));
        assert_eq!(recording["agent"]["vlm"]["identification_version"], VERSION);
        assert_eq!(recording.as_object().unwrap().len(), 2);
    }

    #[test]
    fn a_recording_without_a_version_gets_one() {
        let mut recording = json!({ "kind": "import" });
        assert_eq!(put_version(&mut recording), None);
        assert_eq!(recording, json!({ "kind": "import", "identification_version": VERSION }));
        assert_eq!(put_version(&mut recording), Some(VERSION.to_owned()));
    }
}

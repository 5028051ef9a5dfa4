//! Recorded replies parsed again by this program.
//!
//! Rule: recorded actions stay, since the world has reacted to them. An episode with a changed action diverges from the
//! first such step on, and is listed. Replies that the provider refused stay unchanged, and so do truncated ones
//! unless a whole object is in them.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::reply::{self, Ending, Repair};
use crate::{Reply, Status};
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_trace::episodes::answers::{Answered, columns_of};
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::episodes::identification::put_version;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::write::merge::{self, NotAnEpisode};
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

/// The changes by another reading of the same replies.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ReparseAnswer {
    /// The new traces.
    pub traces: Vec<String>,
    /// Replies that were read.
    pub replies: u64,
    /// Every attribution, decision and status that changes, by trace and row.
    pub changes: Vec<Change>,
    /// The episodes that would have gone on otherwise.
    pub diverged: Vec<Diverged>,
}

/// A value of a step that changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Change {
    /// The episode.
    pub episode_id: String,
    /// The timestep.
    pub t: usize,
    /// The column: `self_color`, `selected_cube`, `mark_report`, `reply_status`, `answer`, or that of an answer.
    pub column: String,
    /// The recorded value; null without one.
    pub before: Option<String>,
    /// The value by this program; null without one.
    pub after: Option<String>,
}

/// The first step of an episode whose action would have been another one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Diverged {
    /// The episode.
    pub episode_id: String,
    /// The timestep.
    pub t: usize,
    /// The recorded action, which stays; null where the agent stood still.
    pub recorded: Option<&'static str>,
    /// The action by this program; null where the agent would have stood still.
    pub parsed: Option<&'static str>,
}

#[derive(Debug, thiserror::Error)]
pub enum ReparseError {
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{file}: {error}")]
    Episode { file: String, error: NotAnEpisode },
    #[error(
        "{file}: expected an experiment and the column `reply` of raw replies, found {found}\n  help: leave the trace out; \
         only recordings of agents that reply in words have them"
    )]
    NoReplies { file: String, found: String },
}

impl ReparseAnswer {
    /// Reparses the replies of traces, and writes new traces into the folder `stage`; their names must differ. They
    /// are named as in `folder`, where the caller puts them.
    pub fn reparse(inputs: &[Input], stage: &Path, folder: &Path) -> Result<(Self, Vec<Input>), ReparseError> {
        let mut answer = Self::default();
        let mut written = Vec::new();
        for input in inputs {
            let name = input.path.file_name().unwrap_or_default();
            let path = stage.join(name);
            answer.add_trace(input, &path)?;
            written.push(Input { path, ..Input::new(folder.join(name)) });
        }
        answer.traces = written.iter().map(|input| input.name.clone()).collect();
        Ok((answer, written))
    }

    fn add_trace(&mut self, input: &Input, target: &Path) -> Result<(), ReparseError> {
        let (mut recording, experiment) = recipe(input)?;
        put_version(&mut recording);
        let columns = OptionalColumns::recorded(&recording);
        let mut writer = TraceWriter::create(target, &TraceMetadata { recording: Some(recording), columns })?;
        for rows in merge::read(&input.path)? {
            let failed = |error| ReparseError::Episode { file: input.name.clone(), error };
            let mut episode = rows.episode().map_err(failed)?;
            self.add_episode(&mut episode, &experiment);
            writer.write(&episode)?;
        }
        Ok(writer.commit()?)
    }

    fn add_episode(&mut self, episode: &mut Episode, experiment: &Spec) {
        let id = episode.episode_id.clone();
        let mut has_diverged = false;
        for (at, step) in episode.steps.iter_mut().enumerate() {
            let Some(reading) = read_again(step, experiment) else { continue };
            self.replies += 1;
            if reading.action != step.action && !has_diverged {
                has_diverged = true;
                let [recorded, parsed] = [step.action, reading.action].map(|action| action.map(Action::name));
                self.diverged.push(Diverged { episode_id: id.clone(), t: at + 1, recorded, parsed });
            }
            let before = compared(step, experiment);
            if step.selected_cube != reading.selected_cube {
                // The recorded distance was to the recorded cube.
                step.extra.cube_distance = None;
            }
            reading.put(experiment, step);
            for ((column, before), (_, after)) in before.into_iter().zip(compared(step, experiment)) {
                if before != after {
                    self.changes.push(Change { episode_id: id.clone(), t: at + 1, column, before, after });
                }
            }
        }
    }
}

fn recipe(input: &Input) -> Result<(Value, Experiment), ReparseError> {
    let none = |found: &str| ReparseError::NoReplies { file: input.name.clone(), found: found.to_owned() };
    let file = TraceFile::open(input).map_err(|findings| {
        TraceError::from_findings(findings).map_or_else(|| none("a file that cannot be opened"), ReparseError::from)
    })?;
    if file.column("reply").is_none() {
        return Err(none("no such column"));
    }
    let recording = file.recording();
    let spec =
        serde_json::from_value::<Spec>(recording["experiment"].clone()).map_err(|fault| none(&fault.to_string()))?;
    Ok((recording, Experiment::from_footer(spec)))
}

fn read_again(step: &Step, experiment: &Spec) -> Option<Reply> {
    let status = step.extra.reply_status.as_deref().and_then(Status::named)?;
    // The text does not show how the provider ended it.
    let ending = match status {
        Status::Refusal => return None,
        Status::Truncated => Ending::Truncated,
        _ => Ending::Whole,
    };
    let reading = reply::read(step.extra.reply.as_deref()?, experiment, ending);
    if status == Status::Truncated && reading.status == status {
        return None;
    }
    let repairs = step.extra.reply_repair.as_deref().unwrap_or_default();
    let carried = [Repair::Surrogate, Repair::ToolCall]
        .into_iter()
        .filter(|repair| repairs.split('+').any(|name| name == repair.name()));
    Some(reading.after(&carried.collect::<Vec<_>>()))
}

fn compared(step: &Step, experiment: &Spec) -> Vec<(String, Option<String>)> {
    let Step { self_color, selected_cube, extra, .. } = step;
    let answers = experiment.answers.iter().map(|answer| {
        let [column, _] = columns_of(&answer.key);
        let text = extra.answers.get(&column).map(Answered::text);
        (column, text)
    });
    let fixed = [
        ("self_color", self_color),
        ("selected_cube", selected_cube),
        ("mark_report", &extra.mark_report),
        ("answer", &extra.answer),
        ("reply_status", &extra.reply_status),
    ];
    fixed.into_iter().map(|(column, value)| (column.to_owned(), value.clone())).chain(answers).collect()
}

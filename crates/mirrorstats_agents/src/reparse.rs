//! Recorded replies parsed again by this program.
//!
//! Rule: recorded actions stay, since the world has reacted to them. An episode with a changed action diverges from the
//! first such step on, and is listed. Labels `self_color_COLOUR` overrule attributions. Replies that the provider
//! refused stay unchanged, and so do truncated ones unless a whole object is in them.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::reply::{self, Ending, Repair};
use crate::{Reply, Status};
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_identification::{UNREADABLE, put_version};
use mirrorstats_trace::beside::ListError;
use mirrorstats_trace::beside::labels::Labels;
use mirrorstats_trace::episodes::answers::{Answered, columns_of};
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::{self, NotAnEpisode};
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::schema::colors::Color;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

/// Labels of steps that overrule their attributions begin so.
const OVERRULES: &str = "self_color_";

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
    /// The coder whose label decided; null if this program did.
    pub coder: Option<String>,
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
    #[error(transparent)]
    Labels(#[from] ListError),
    #[error(
        "{episode_id}, t = {t}: expected {expected}, found {found}\n  help: correct or remove the label in `labels.jsonl`"
    )]
    Label { episode_id: String, t: usize, expected: &'static str, found: String },
}

impl ReparseAnswer {
    /// Reparses the replies of traces, and writes new traces into the folder `stage`; their names must differ. They
    /// are named as in `folder`, where the caller puts them.
    pub fn reparse(inputs: &[Input], stage: &Path, folder: &Path) -> Result<(Self, Vec<Input>), ReparseError> {
        let mut answer = Self::default();
        let mut written = Vec::new();
        let labels = Labels::beside(inputs)?;
        for input in inputs {
            let name = input.path.file_name().unwrap_or_default();
            let path = stage.join(name);
            answer.add_trace(input, &path, &labels)?;
            written.push(Input { path, ..Input::new(folder.join(name)) });
        }
        answer.traces = written.iter().map(|input| input.name.clone()).collect();
        Ok((answer, written))
    }

    fn add_trace(&mut self, input: &Input, target: &Path, labels: &Labels) -> Result<(), ReparseError> {
        let (mut recording, experiment) = recipe(input)?;
        put_version(&mut recording);
        if labels.words().iter().any(|word| word.starts_with(OVERRULES)) {
            recording["labels_overrule"] = true.into();
        }
        let columns = OptionalColumns::recorded(&recording);
        let mut writer = TraceWriter::create(target, &TraceMetadata { recording: Some(recording), columns })?;
        for rows in episode_rows::read(&input.path)? {
            let failed = |error| ReparseError::Episode { file: input.name.clone(), error };
            let mut episode = rows.episode().map_err(failed)?;
            self.add_episode(&mut episode, &experiment, labels)?;
            writer.write(&episode)?;
        }
        Ok(writer.commit()?)
    }

    fn add_episode(&mut self, episode: &mut Episode, experiment: &Spec, labels: &Labels) -> Result<(), ReparseError> {
        let id = episode.episode_id.clone();
        let mut has_diverged = false;
        for (at, step) in episode.steps.iter_mut().enumerate() {
            let verdict = verdict(labels, &id, at + 1)?;
            let Some(mut reading) = read_again(step, experiment) else {
                if let Some((_, found)) = verdict {
                    let (expected, found) = ("a step with a reply", format!("the label `{OVERRULES}{found}`"));
                    return Err(ReparseError::Label { episode_id: id, t: at + 1, expected, found });
                }
                continue;
            };
            self.replies += 1;
            if let Some((_, color)) = verdict {
                reading.self_color = (color != "none").then(|| color.to_owned());
                // The coder has read what the rule could not.
                reading.fault = reading.fault.filter(|fault| !fault.starts_with(UNREADABLE));
            }
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
                    let coder = verdict.filter(|_| column == "self_color").map(|(coder, _)| coder.to_owned());
                    self.changes.push(Change { episode_id: id.clone(), t: at + 1, column, before, after, coder });
                }
            }
        }
        Ok(())
    }
}

/// The coder and the colour, `unknown` or `none` of a step's label that overrules its attribution.
fn verdict<'l>(labels: &'l Labels, id: &str, t: usize) -> Result<Option<(&'l str, &'l str)>, ReparseError> {
    let wrong = |expected, found| ReparseError::Label { episode_id: id.to_owned(), t, expected, found };
    let of_step = labels.of_episode(id).filter(|mark| mark.step.is_some_and(|step| step as usize == t));
    let mut decided: Option<(&str, &str)> = None;
    for (coder, label) in of_step.filter_map(|mark| Some((mark.coder, mark.label?))) {
        let Some(color) = label.strip_prefix(OVERRULES) else { continue };
        if !["unknown", "none"].contains(&color) && Color::named(color).is_none() {
            return Err(wrong("`self_color_` and a colour of the palette, `unknown` or `none`", format!("`{label}`")));
        }
        if let Some((other, before)) = decided.filter(|(_, before)| *before != color) {
            return Err(wrong("coders who agree", format!("`{before}` by {other} and `{color}` by {coder}")));
        }
        decided = Some((coder, color));
    }
    Ok(decided)
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
    // The text does not show a limit or reasoning either, and the recorded fault stays.
    if matches!(status, Status::Truncated | Status::Empty) && reading.status == status {
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

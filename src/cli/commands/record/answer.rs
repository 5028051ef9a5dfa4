//! The answer of `record`, its messages on standard error after a recording, and the outcome of several recordings.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::own_definitions::commands;
use crate::cli::{Failure, NAME, Outcome};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_exact::number::Decimal;
use mirrorstats_record::failures::LostEpisode;
use mirrorstats_record::replies::{RepliesAnswer, UnreadableReply};
use mirrorstats_report::html;
use mirrorstats_study::own_definitions::OwnDefinitionsError;
use mirrorstats_study::{Study, StudyError};
use mirrorstats_trace::footers::renderer::Renderer;
use mirrorstats_trace::validate::replies::ReplyCounts;
use mirrorstats_vlm::limits::Spend;

/// The answer of `record --json`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RecordAnswer {
    /// The model's name as shown in tables.
    pub model: String,
    /// Episodes asked for, those of other shards not among them.
    pub asked: usize,
    /// Episodes that were there before.
    pub found: usize,
    /// Episodes that were recorded now.
    pub recorded: usize,
    /// Their steps.
    pub steps: u64,
    /// Episodes of participants who declined or left: not played, or deleted.
    pub left_out: usize,
    /// The replies of this start.
    pub replies: RepliesAnswer,
    /// Episodes that were lost without an answer: in no trace, listed in `lost.jsonl` of the folder.
    pub lost: Vec<LostEpisode>,
    /// Episodes under way that a limit of what may be spent has stopped; they are not lost, and go on under a higher limit.
    pub stopped_by_limit: usize,
    /// The spending on all that the model played into the folder, over all starts; null for agents that cost nothing.
    pub spend: Option<Spend>,
    /// True if the recording was stopped before its end.
    pub stopped: bool,
    /// What drew the frames that the agent saw in these traces; empty for an agent that sees none.
    pub renderers: Vec<Renderer>,
    /// The traces of these episodes.
    pub traces: Vec<String>,
    /// Their logs.
    pub logs: Vec<String>,
}

/// The result of a recording that reached its end or was stopped.
#[derive(Debug)]
pub struct Recorded {
    /// The outcomes of the episodes.
    pub answer: RecordAnswer,
    /// The reason why the agent could not continue, if so.
    pub gave_up: Option<String>,
    pub(super) lost_list: PathBuf,
    pub(super) elapsed: Duration,
    /// The steps of unfinished episodes that the next start plays again, since the agent keeps no journal.
    pub(super) forgotten: u64,
}

pub(super) fn unreadable(counts: &ReplyCounts) -> Option<String> {
    let (bad, all) = (counts.all_unreadable(), counted(counts.replies, "reply"));
    (bad > 0).then(|| format!("{bad} of {all} could not be read: {counts}"))
}

pub(super) fn spent(spend: &Spend) -> String {
    let (requests, answers) = (counted(spend.requests, "request"), counted(spend.uncosted, "answer"));
    let known = match (spend.uncosted, spend.cost_usd > 0.0) {
        (0, _) => dollars(spend.cost_usd),
        (_, true) => format!("{} and what {answers} cost, which is unknown,", dollars(spend.cost_usd)),
        (_, false) => "an unknown cost".to_owned(),
    };
    let unanswered = match spend.unanswered {
        0 => String::new(),
        count => {
            let (requests, most) = (counted(count, "request"), dollars(spend.uncosted_usd_at_most));
            format!("; {requests} without an answer may have been paid: at most {most}, as far as prices are known")
        }
    };
    format!("{known} for {requests} and {}{unanswered}", counted(spend.tokens, "token"))
}

pub(super) fn dollars(value: f64) -> String {
    let places = if value >= 1.0 || value == 0.0 { 2 } else { 4 };
    let number = Decimal::of_float(value, places);
    number.map_or_else(|| "an unknown number of US dollars".to_owned(), |number| format!("{number} US dollars"))
}

/// Prints the outcome of a recording into `folder`; `files` are those of its experiments.
pub(super) fn say(recorded: &Recorded, folder: &Path, files: &[&Path]) -> io::Result<()> {
    let Recorded { answer, lost_list, elapsed, .. } = recorded;
    let mut out = io::stderr().lock();
    let seconds = elapsed.as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "a rate for people")]
    let rate = if seconds > 0.0 { answer.steps as f64 / seconds } else { 0.0 };
    let (episodes, steps) = (counted(answer.recorded as u64, "episode"), counted(answer.steps, "step"));
    write!(out, "{}: recorded {episodes}, {steps} in {} s", visible(&answer.model), fixed(Some(seconds), 1))?;
    if answer.recorded > 0 {
        write!(out, " ({} steps a second)", fixed(Some(rate), 0))?;
    }
    match answer.found {
        0 => writeln!(out)?,
        found => writeln!(out, "; {found} of {} were there before", answer.asked)?,
    }
    if answer.left_out > 0 {
        let episodes = counted(answer.left_out as u64, "episode");
        writeln!(
            out,
            "{episodes} of participants who declined or left the study: not played, or deleted as they wanted"
        )?;
    }
    if let Some(words) = unreadable(&answer.replies.counts) {
        let first = answer.replies.first_unreadable.as_ref().map_or_else(String::new, UnreadableReply::words);
        writeln!(out, "{words}; first: {first}")?;
    }
    match answer.renderers.as_slice() {
        [] => {}
        [one] => writeln!(out, "frames: drawn by {one}")?,
        all => {
            let names: Vec<String> = all.iter().map(ToString::to_string).collect();
            let (count, names) = (all.len(), names.join("; "));
            writeln!(out, "frames: drawn by {count} renderers, which a report mixes only with --pool: {names}")?;
        }
    }
    if let Some(spend) = &answer.spend {
        writeln!(out, "spent: {}, on all that the model played into this folder, over all starts", spent(spend))?;
    }
    if !answer.lost.is_empty() {
        let episodes = counted(answer.lost.len() as u64, "episode");
        writeln!(
            out,
            "lost {episodes} without an answer (a crash, a rate limit, a server error, a timeout): in no trace, listed in {}; the \
             same command tries again",
            visible(&lost_list.display().to_string())
        )?;
    }
    match unfinished(answer) {
        Some(words) if recorded.forgotten > 0 => {
            let steps = counted(recorded.forgotten, "step");
            writeln!(out, "{words}, and plays {steps} of unfinished episodes again: this agent keeps no journal")?;
        }
        Some(words) => writeln!(out, "{words}")?,
        None if answer.recorded + answer.found == 0 => {}
        None => writeln!(out, "next: {}", next(folder, files).join("\n      "))?,
    }
    Ok(())
}

fn next(folder: &Path, files: &[&Path]) -> Vec<String> {
    let typed = [NAME.into(), "report".into(), folder.into()];
    let report = format!("{NAME} report {}", html::word(&folder.to_string_lossy()));
    let Ok(study) = Study::open([folder]) else { return vec![report] };
    match study.own_definitions().as_ref().err().and_then(StudyError::cause) {
        Some(OwnDefinitionsError::Differ { groups }) => commands(&typed, groups),
        Some(OwnDefinitionsError::Elsewhere { group }) => {
            let beside = files.iter().map(|file| file.with_file_name(&group.definitions)).find(|file| file.is_file());
            let file = beside.unwrap_or_else(|| PathBuf::from(&group.definitions));
            vec![format!("{report} --definitions {}", html::word(&file.to_string_lossy()))]
        }
        _ => vec![report],
    }
}

fn unfinished(answer: &RecordAnswer) -> Option<String> {
    let ended = answer.found + answer.recorded + answer.lost.len() + answer.left_out;
    let left = answer.asked.saturating_sub(ended);
    let left = counted(left as u64, "episode");
    match answer.stopped_by_limit {
        0 => answer.stopped.then(|| format!("stopped, {left} to go: the same command continues")),
        begun => {
            let begun = counted(begun as u64, "episode");
            Some(format!(
                "stopped by a limit, {left} to go: {begun} of them begun and not lost; the same command with a higher limit \
                 goes on where the limit stopped it"
            ))
        }
    }
}

/// The reason why a recording could not continue.
pub fn stopped(recorded: &Result<Recorded, Failure>) -> Option<String> {
    match recorded {
        Ok(recorded) => recorded.gave_up.clone(),
        Err(failure) => Some(failure.to_string()),
    }
}

/// The exit code of several recordings.
pub fn outcome(all: Vec<Result<Recorded, Failure>>, asked: usize) -> Result<Outcome, Failure> {
    let stopped = all.iter().filter_map(stopped).count();
    let mut outcome = Outcome::Done;
    for recorded in all {
        let failure = match recorded {
            Ok(Recorded { gave_up: Some(reason), .. }) => Failure::input(reason),
            Ok(recorded) => {
                outcome = worse(outcome, outcome_of(&recorded.answer));
                continue;
            }
            Err(failure) => failure,
        };
        return Err(match asked {
            1 => failure,
            _ => Failure::input(format!(
                "{stopped} of {asked} recordings were stopped; the first: {failure}\n  help: the same command goes on with all of them"
            )),
        });
    }
    Ok(outcome)
}

fn worse(one: Outcome, other: Outcome) -> Outcome {
    match (one, other) {
        (Outcome::Interrupted, _) | (_, Outcome::Interrupted) => Outcome::Interrupted,
        (Outcome::Done, other) => other,
        (one, _) => one,
    }
}

fn outcome_of(answer: &RecordAnswer) -> Outcome {
    match (answer.stopped, answer.lost.is_empty()) {
        (true, _) => Outcome::Interrupted,
        (false, true) => Outcome::Done,
        (false, false) => Outcome::CheckFailed,
    }
}

#[cfg(test)]
mod tests {
    use super::{dollars, spent};
    use mirrorstats_vlm::limits::Spend;

    #[test]
    fn unknown_costs_are_printed_as_unknown() {
        let spend = Spend { cost_usd: 1.5, tokens: 2_000, requests: 3, ..Spend::default() };
        assert_eq!(spent(&spend), "1.50 US dollars for 3 requests and 2000 tokens");
        let partly = Spend { uncosted: 2, ..spend };
        assert!(spent(&partly).starts_with("1.50 US dollars and what 2 answers cost, which is unknown, for"));
        let nothing = Spend { cost_usd: 0.0, ..partly };
        assert_eq!(spent(&nothing), "an unknown cost for 3 requests and 2000 tokens");
        let killed = Spend { unanswered: 1, uncosted_usd_at_most: 0.25, ..spend };
        let words =
            "; 1 request without an answer may have been paid: at most 0.2500 US dollars, as far as prices are known";
        assert_eq!(spent(&killed), spent(&spend) + words);
        assert_eq!([dollars(0.0), dollars(0.00123)], ["0.00 US dollars", "0.0012 US dollars"]);
    }
}

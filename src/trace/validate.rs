//! Checks traces against every rule of the schema and reports all that is wrong, not only the first fault.
//!
//! A damaged file does not keep the others from being checked. Columns that the schema does not know are not read.

use std::num::NonZeroUsize;

use schemars::JsonSchema;
use serde::Serialize;

use super::colors::set::{Tally, sightings};
use super::finding::{Code, Finding, Severity, TraceError};
use super::ids::{Ids, Start, starts};
use super::inputs::Input;
use super::layout::Layout;
use super::open::{TraceFile, TraceSet};
use super::pass::{Episodes, Event, pass};
use super::rules::{Located, Rules};
use super::schema::COLUMNS;

/// What was checked and what was found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Validation {
    /// The files, in their order.
    pub files: Vec<CheckedFile>,
    /// All findings, by file, row group and row; what only all inputs together show comes last of its file.
    pub findings: Vec<Finding>,
}

/// One file that was looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CheckedFile {
    /// Its name.
    pub name: String,
    /// Whether all of its rows were checked; not so where the file cannot be read to its end.
    pub complete: bool,
    /// Episodes that were checked.
    pub episodes: u64,
    /// Their rows.
    pub steps: u64,
}

/// Findings that an abridged report leaves out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rest<'a> {
    /// The file.
    pub file: &'a str,
    /// The rule.
    pub code: Code,
    /// How many there are.
    pub count: usize,
}

impl Validation {
    /// How many findings have this severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.severity == severity).count()
    }

    /// The first `limit` findings of each file and rule, and how many more each has.
    pub fn abridged(&self, limit: usize) -> (Vec<&Finding>, Vec<Rest<'_>>) {
        let (mut shown, mut rest) = (Vec::new(), Vec::<Rest>::new());
        let mut counts = indexmap::IndexMap::<_, usize>::new();
        for finding in &self.findings {
            let count = counts.entry((finding.file.as_str(), finding.code)).or_default();
            *count += 1;
            if *count <= limit {
                shown.push(finding);
            }
        }
        for ((file, code), count) in counts {
            if count > limit {
                rest.push(Rest { file, code, count: count - limit });
            }
        }
        (shown, rest)
    }
}

/// Checks these files. Experiments are checked against `experiments` if it is given.
///
/// # Errors
/// When no thread can be started; whatever is wrong with a file is a finding.
pub fn validate(
    inputs: &[Input],
    experiments: Option<&[String]>,
    threads: NonZeroUsize,
) -> Result<Validation, TraceError> {
    let mut report = Validation::default();
    let mut found: Vec<Vec<Finding>> = Vec::new();
    let (mut opened, mut places) = (Vec::new(), Vec::new());
    for (place, input) in inputs.iter().enumerate() {
        let file = TraceFile::open(input);
        report.files.push(CheckedFile { name: input.name.clone(), complete: file.is_ok(), episodes: 0, steps: 0 });
        match file {
            Ok(file) => {
                opened.push(file);
                places.push(place);
                found.push(Vec::new());
            }
            Err(findings) => found.push(findings),
        }
    }
    let set = TraceSet::of(opened);
    check_rows(&set, experiments, threads, |file, checked| {
        let place = places[file];
        match checked {
            Event::Fault(finding) => {
                report.files[place].complete = false;
                found[place].push(*finding);
            }
            Event::Whole((findings, episodes, steps)) => {
                report.files[place].episodes += episodes;
                report.files[place].steps += steps;
                found[place].extend(findings);
            }
        }
    })?;
    report.findings = found.into_iter().flatten().collect();
    Ok(report)
}

/// Findings, episodes and steps of some whole episodes.
type Checked = (Vec<Finding>, u64, u64);

fn check_rows(
    set: &TraceSet,
    experiments: Option<&[String]>,
    threads: NonZeroUsize,
    mut receive: impl FnMut(usize, Event<Checked>),
) -> Result<(), TraceError> {
    let present = COLUMNS.iter().map(|column| column.name).filter(|name| set.column(name).is_some());
    if set.files().is_empty() {
        return Ok(());
    }
    let layout = Layout::new(set, present, [])?;
    let rules = Rules { layout: &layout, experiments };
    let name = |file: usize| set.files()[file].name().to_owned();
    let work = |episodes: Episodes| {
        let mut found = rules.check(&set.files()[episodes.file], &episodes);
        found.extend(split(&name(episodes.file), &episodes));
        let colors = sightings(&set.files()[episodes.file], &layout, &episodes);
        (found, colors, starts(&episodes), episodes.len() as u64, episodes.columns[0].len() as u64)
    };
    let (mut ids, mut tally) = (Ids::default(), Tally::new(set.files()));
    pass(set.files(), &layout, threads, &work, |file, event| {
        let event = match event {
            Event::Fault(finding) => Event::Fault(finding),
            Event::Whole((found, colors, starts, episodes, steps)) => {
                tally.add(set.files(), file, colors);
                Event::Whole((with_repeated(found, starts, &mut ids, file, name), episodes, steps))
            }
        };
        receive(file, event);
        Ok::<_, TraceError>(())
    })?;
    for (file, finding) in tally.findings(set.files()) {
        receive(file, Event::Whole((vec![finding], 0, 0)));
    }
    Ok(())
}

/// The findings of some episodes and those about their ids, by row.
fn with_repeated(
    mut found: Vec<Located>,
    starts: Vec<Start>,
    ids: &mut Ids,
    file: usize,
    name: impl Fn(usize) -> String,
) -> Vec<Finding> {
    let repeated: Vec<_> = starts.into_iter().filter_map(|start| ids.admit(start, file, &name)).collect();
    // Rows of one episode that lie apart: that they do not start at t = 1 is no fault of its own.
    let apart = |row| repeated.iter().any(|again| again.row == row && again.finding.code == Code::EpisodeTwice);
    found.retain(|located| located.finding.code != Code::TStart || !apart(located.row));
    let mut all = repeated;
    all.extend(found);
    all.sort_by_key(|located| located.row);
    all.into_iter().map(|located| located.finding).collect()
}

/// A note for an episode whose rows are in several row groups.
fn split(file: &str, episodes: &Episodes) -> Option<Located> {
    let groups: Vec<_> = episodes.pieces.iter().map(|piece| piece.row_group).collect();
    let (first, last) = (*groups.first()?, *groups.last()?);
    if first == last {
        return None;
    }
    let id = episodes.id(0)?;
    let found = format!("its rows in row groups {first} to {last}");
    let finding = Finding::new(Code::SplitEpisode, file, "the episode in one row group", found);
    Some(Located { row: 0, finding: finding.in_row_group(first).in_episode(id) })
}

//! Checks traces against every rule of the schema and reports all faults, not only the first.
//!
//! The other files are checked even if one is damaged. Columns outside the schema are not decoded, but their pages and
//! checksums are checked like all others.

pub(crate) mod color_set;
pub mod copies;
pub(crate) mod duplicate_ids;
pub(crate) mod episode_hashes;
pub mod replies;
pub(crate) mod rules;

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use arrow::array::LargeStringBuilder;
use indexmap::{IndexMap, IndexSet};
use schemars::JsonSchema;
use serde::Serialize;

use super::diagnostic::{Code, Finding, Severity};
use super::episodes::answers;
use super::error::TraceError;
use super::inputs::Input;
use super::read::open::{TraceFile, TraceSet};
use super::read::parallel_scan::{Episodes, ScanEvent, pass};
use super::read::projection::Layout;
use super::read::row_hashes;
use super::read::verify::verify_columns;
use super::schema::{self, COLUMNS, DeclaredColumn, Domain, Kind};
use super::validate::replies::{REPLY_STATUS, ReplyCounts, statuses};
use color_set::{Tally, sightings};
use copies::{Copied, copies};
use duplicate_ids::{SeenIds, Start, starts};
use mirrorstats_parquet_pages::checksums::Checksums;
use rules::{Located, Rules};

/// The checks and their findings.
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
    /// True if all of its rows were checked; not so where the file cannot be read to its end.
    pub complete: bool,
    /// Episodes that were checked.
    pub episodes: u64,
    /// Their rows.
    pub steps: u64,
    /// True if it has checksums; without them damage may not be found.
    pub checksums: Checksums,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rest<'a> {
    pub file: &'a str,
    pub code: Code,
    pub count: usize,
}

impl Validation {
    pub fn errors(self) -> Result<(), TraceError> {
        let errors = self.findings.into_iter().filter(|finding| finding.severity == Severity::Error);
        TraceError::from_findings(errors.collect()).map_or(Ok(()), Err)
    }

    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.severity == severity).count()
    }

    /// The first `limit` findings of each file and rule, and the number of others.
    pub fn abridged(&self, limit: usize) -> (Vec<&Finding>, Vec<Rest<'_>>) {
        let (mut shown, mut counts) = (Vec::new(), IndexMap::<_, usize>::new());
        for finding in &self.findings {
            let count = counts.entry((finding.file.as_str(), finding.code)).or_default();
            *count += 1;
            if *count <= limit {
                shown.push(finding);
            }
        }
        let rest = counts.into_iter().filter(|(_, count)| *count > limit);
        (shown, rest.map(|((file, code), count)| Rest { file, code, count: count - limit }).collect())
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Expected<'a> {
    /// The known experiments, besides those that the files declare; any if `None`.
    pub experiments: Option<&'a [String]>,
    /// The domain; the mirror's definitions refuse traces of others.
    pub domain: Domain,
    pub declared: &'a [DeclaredColumn],
    /// True to skip the search for copied episodes.
    pub errors_alone: bool,
}

/// Checks these files as traces of the mirror. Experiments are checked against `experiments`, if given, and against
/// those that the files declare.
pub fn validate(
    inputs: &[Input],
    experiments: Option<&[String]>,
    threads: NonZeroUsize,
) -> Result<Validation, TraceError> {
    validate_as(inputs, Expected { experiments, ..Expected::default() }, threads)
}

struct FileCheck {
    file: CheckedFile,
    findings: Vec<Finding>,
    replies: ReplyCounts,
}

pub fn validate_as(inputs: &[Input], expected: Expected<'_>, threads: NonZeroUsize) -> Result<Validation, TraceError> {
    let mut files: Vec<_> = inputs.iter().map(TraceFile::open).collect();
    refuse_other_domains(&mut files, expected);
    let (mut checks, mut opened, mut places) = (Vec::new(), Vec::new(), Vec::new());
    for (input, file) in inputs.iter().zip(files) {
        let checksums = file.as_ref().map(TraceFile::checksums).unwrap_or_default();
        let about = CheckedFile { name: input.name.clone(), complete: file.is_ok(), episodes: 0, steps: 0, checksums };
        places.extend(file.is_ok().then_some(checks.len()));
        let findings = file.map(|file| opened.push(file)).err().unwrap_or_default();
        checks.push(FileCheck { file: about, findings, replies: ReplyCounts::default() });
    }
    let set = TraceSet::from_files(opened);
    let known = expected.experiments.map(|known| with_declared(known, &set));
    let expected = Expected { experiments: known.as_deref(), ..expected };
    check_rows(&set, expected, threads, &places, &mut checks)?;
    for (file, place) in set.files().iter().zip(&places) {
        let check = &mut checks[*place];
        if check.file.complete
            && let Err(finding) = verify_columns(file, |name| set.domain().column(name).is_none())
        {
            check.file.complete = false;
            check.findings.push(*finding);
        }
        check.findings.extend(stale(file));
    }
    let mut report = Validation::default();
    for FileCheck { file, findings, mut replies } in checks {
        // A status outside the schema has a finding already.
        replies.unreadable.retain(|status, _| statuses().contains(&status.as_str()));
        report.findings.extend(findings.into_iter().chain(unreadable(&file.name, &replies)));
        report.files.push(file);
    }
    Ok(report)
}

fn refuse_other_domains(files: &mut [Result<TraceFile, Vec<Finding>>], expected: Expected<'_>) {
    let is_mirror = |file: &Result<TraceFile, _>| file.as_ref().is_ok_and(|file| file.domain() == Domain::Mirror);
    let is_any = expected.domain == Domain::Own && !files.iter().any(is_mirror);
    for file in files {
        let Ok(opened) = file else { continue };
        let found = if is_any { opened.misdeclared(expected.declared) } else { opened.faults_as_mirror() };
        if !found.is_empty() {
            *file = Err(found);
        }
    }
}

fn stale(file: &TraceFile) -> Option<Finding> {
    let expected = format!("a file of which `{}` has the checksums", schema::CHECKSUMS_KEY);
    let found = "one that another program wrote again: they are not checked";
    (file.checksums() == Checksums::Stale).then(|| Finding::new(Code::StaleChecksums, file.name(), expected, found))
}

fn with_declared(known: &[String], set: &TraceSet) -> Vec<String> {
    let declared = set.files().iter().flat_map(TraceFile::experiments).map(|declared| declared.name.clone());
    let all: IndexSet<String> = known.iter().cloned().chain(declared).collect();
    all.into_iter().collect()
}

fn unreadable(file: &str, replies: &ReplyCounts) -> Option<Finding> {
    let (bad, all) = (replies.all_unreadable(), replies.replies);
    let finding = || {
        let found = format!("{bad} of {all} steps with another status: {replies}");
        Finding::new(Code::UnreadableReplies, file, "the status `ok` or `repaired`", found).in_column(REPLY_STATUS)
    };
    (bad > 0).then(finding)
}

fn check_rows(
    set: &TraceSet,
    expected: Expected<'_>,
    threads: NonZeroUsize,
    places: &[usize],
    checks: &mut [FileCheck],
) -> Result<(), TraceError> {
    let known = COLUMNS.iter().filter(|column| set.domain().has(column)).map(|column| column.name);
    let declared = expected.declared.iter().filter(|_| set.domain() == Domain::Own).map(|own| own.name.as_str());
    let names = set.column_names();
    let is_readable = |name: &&str| set.column(name).is_some_and(|column| column.kind != Kind::Unsupported);
    let asked = answers::among(&names).into_iter().filter(is_readable);
    let present = known.chain(declared).filter(|name| set.column(name).is_some()).chain(asked);
    if set.files().is_empty() {
        return Ok(());
    }
    let mut layout = Layout::new(set, present, [])?;
    layout.with_declared(expected.declared);
    layout.with_declared(&declared_answers(set));
    let rules = Rules { layout: &layout, experiments: expected.experiments };
    let statuses = layout.position(REPLY_STATUS).filter(|at| layout.columns[*at].known.is_some());
    let name = |file: usize| set.files()[file].name().to_owned();
    let work = |episodes: Episodes| {
        let starts = starts(&episodes);
        let mut found = rules.check(&set.files()[episodes.file], &episodes);
        found.extend(split(&name(episodes.file), &episodes));
        found.extend(episode_hashes::check(&set.files()[episodes.file], &layout, &episodes));
        let replies = statuses.map_or_else(ReplyCounts::default, |at| ReplyCounts::of_column(&episodes.columns[at]));
        // An episode without an id has another finding.
        let is_whole = !expected.errors_alone && starts.len() == episodes.len();
        let hashes = if is_whole { row_hashes::of_episodes(&layout, &episodes) } else { Vec::new() };
        let colors = sightings(&set.files()[episodes.file], &layout, &episodes);
        let rows = (episodes.len() as u64, episodes.columns[0].len() as u64);
        (found, colors, starts, hashes, replies, rows)
    };
    let (mut ids, mut tally) = (SeenIds::default(), Tally::new(set.files()));
    let mut copy_candidates = CopyCandidates::default();
    pass(set.files(), &layout, threads, &work, |file, event| {
        let check = &mut checks[places[file]];
        match event {
            ScanEvent::Fault(finding) => {
                check.file.complete = false;
                check.findings.push(*finding);
            }
            ScanEvent::Whole((found, colors, starts, hashes, replies, (episodes, steps))) => {
                tally.add(set.files(), file, colors);
                if !hashes.is_empty() {
                    copy_candidates.add(file, hashes, &starts);
                }
                check.file.episodes += episodes;
                check.file.steps += steps;
                check.findings.extend(with_repeated(found, starts, &mut ids, file, name));
                check.replies.merge(&replies);
            }
        }
        Ok::<_, TraceError>(())
    })?;
    for (file, finding) in tally.findings(set.files()).into_iter().chain(copied(set, copy_candidates, threads)) {
        checks[places[file]].findings.push(finding);
    }
    Ok(())
}

/// The columns of all declared answers. Two experiments may give a key different options.
fn declared_answers(set: &TraceSet) -> Vec<DeclaredColumn> {
    let mut answers: Vec<DeclaredColumn> = Vec::new();
    for own in set.files().iter().flat_map(TraceFile::experiments).flat_map(|experiment| &experiment.answers) {
        match answers.iter_mut().find(|known| known.name == own.name) {
            Some(known) if known.values.is_empty() || own.values.is_empty() => known.values.clear(),
            Some(known) => {
                let new: Vec<_> = own.values.iter().filter(|value| !known.values.contains(value)).cloned().collect();
                known.values.extend(new);
            }
            None => answers.push(own.clone()),
        }
    }
    answers
}

/// The episodes whose rows may equal those of another one, with their files. Ids are stored together, because one
/// allocation for each took memory and time: 132 MB for 300,000 episodes instead of 84.
#[derive(Default)]
struct CopyCandidates {
    hashes: Vec<u64>,
    ids: LargeStringBuilder,
    ends: Vec<(usize, usize)>,
}

impl CopyCandidates {
    fn add(&mut self, file: usize, hashes: Vec<u64>, starts: &[Start]) {
        self.hashes.extend(hashes);
        for start in starts {
            self.ids.append_value(&start.id);
        }
        self.ends.push((self.hashes.len(), file));
    }

    fn episodes(mut self) -> BTreeMap<String, usize> {
        let ids = self.ids.finish();
        let mut order: Vec<usize> = (0..self.hashes.len()).collect();
        order.sort_unstable_by_key(|at| self.hashes[*at]);
        let same = order.chunk_by(|a, b| self.hashes[*a] == self.hashes[*b]).filter(|same| same.len() > 1).flatten();
        let file = |at: usize| self.ends[self.ends.partition_point(|(end, _)| *end <= at)].1;
        same.map(|at| (ids.value(*at).to_owned(), file(*at))).collect()
    }
}

fn copied(set: &TraceSet, copy_candidates: CopyCandidates, threads: NonZeroUsize) -> Vec<(usize, Finding)> {
    let files = copy_candidates.episodes();
    let found = copies(set, &files.keys().cloned().collect(), threads).unwrap_or_default();
    let finding = |Copied { episode, of }: Copied| {
        let file = files.get(&episode).copied()?;
        let found = format!("those of `{}` in all columns but the id", mirrorstats_exact::escape::visible(&of));
        let name = set.files()[file].name();
        Some((file, Finding::new(Code::CopiedEpisode, name, "rows of its own", found).in_episode(&episode)))
    };
    found.into_iter().filter_map(finding).collect()
}

fn with_repeated(
    mut found: Vec<Located>,
    starts: Vec<Start>,
    ids: &mut SeenIds,
    file: usize,
    name: impl Fn(usize) -> String,
) -> Vec<Finding> {
    let repeated: Vec<_> = starts.into_iter().filter_map(|start| ids.admit(start, file, &name)).collect();
    // Separated rows of one episode: not starting at t = 1 is not another fault.
    let apart = |row| repeated.iter().any(|again| again.row == row && again.finding.code == Code::EpisodeTwice);
    found.retain(|located| located.finding.code != Code::TStart || !apart(located.row));
    let mut all: Vec<Located> = repeated.into_iter().chain(found).collect();
    all.sort_by_key(|located| located.row);
    all.into_iter().map(|located| located.finding).collect()
}

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

//! The contents of traces: episodes, steps, names, the filled cells of the grid, and the files themselves.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::num::NonZeroUsize;

use arrow::array::{ArrayRef, AsArray as _, DictionaryArray};
use arrow::datatypes::{Int32Type, Int64Type};
use schemars::JsonSchema;
use serde::Serialize;

use super::diagnostic::Finding;
use super::error::TraceError;
use super::footers::renderer::{self, Renderer};
use super::read::budget::most_listed;
use super::read::in_order::in_order;
use super::read::open::{TraceFile, TraceSet};
use super::scan::{EpisodeBatch, Projection};
use super::schema::{Kind, RECORDING_KEY, VERSION_KEY, WRITER_KEY};
use super::validate::replies::{REPLY_STATUS, ReplyCounts};
use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_exact::hash;
use mirrorstats_parquet_pages::checksums::Checksums;

/// A summary of some traces.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Info {
    /// The number of episodes.
    pub episodes: u64,
    /// The number of their steps.
    pub steps: u64,
    /// The models, ascending.
    pub models: Vec<String>,
    /// The experiments, ascending.
    pub experiments: Vec<String>,
    /// The seeds, ascending.
    pub seeds: Vec<i64>,
    /// The runs, ascending.
    pub runs: Vec<i64>,
    /// Every experiment with every model, in that order.
    pub coverage: Vec<Cell>,
    /// The renderers of the frames that agents saw; absent if no trace declares one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub renderers: Vec<Renderer>,
    /// The reply counts; null if no file has the column `reply_status`.
    pub replies: Option<ReplyCounts>,
    /// The columns of all files.
    pub columns: Vec<ColumnInfo>,
    /// Every episode, in the order of files and rows; absent unless asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub episode_list: Option<Vec<EpisodeInfo>>,
    /// The files, in their order.
    pub files: Vec<FileInfo>,
}

/// The episodes of one model in one experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Cell {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The number of episodes.
    pub episodes: u64,
    /// Seeds and runs that some other cell has and this one lacks.
    pub missing: Vec<SeedRun>,
    /// Seeds and runs of which this cell has more than one episode.
    pub repeated: Vec<SeedRun>,
}

/// A seed and a run within it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
pub struct SeedRun {
    /// The seed.
    pub seed: i64,
    /// The run.
    pub run: i64,
}

/// One episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct EpisodeInfo {
    /// Its id.
    pub episode_id: String,
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The seed.
    pub seed: i64,
    /// The run within its seed.
    pub run: i64,
    /// Its steps.
    pub steps: u64,
    /// The name of its file.
    pub file: String,
}

/// One column over all files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ColumnInfo {
    /// Its name.
    pub name: String,
    /// Its logical type; `unsupported` also where files differ.
    #[serde(rename = "type")]
    pub kind: Kind,
    /// True if the schema knows it.
    pub known: bool,
    /// A file that does not have it.
    pub missing_from: Option<String>,
}

/// One file.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FileInfo {
    /// Its name.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// Its content's SHA-256.
    pub sha256: String,
    /// Its episodes.
    pub episodes: u64,
    /// Its rows.
    pub steps: u64,
    /// Its row groups.
    pub row_groups: usize,
    /// The version of the schema, if the file names one.
    pub schema_version: Option<String>,
    /// The program that wrote it, if the file names one.
    pub writer: Option<String>,
    /// The state of its checksums: `present`, `none`, or `stale` if another program wrote the file again.
    pub checksums: Checksums,
    /// The recording: JSON, or its text if that is no JSON.
    pub recording: Option<serde_json::Value>,
}

/// The limit for the coverage of seeds and runs by model: seven models, five experiments and 20,000 runs have 700,000.
const MOST_COVERED: Limit = Limit::new("seeds and runs of models in experiments", 2_000_000);

const CELL: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listing {
    Episodes,
    Nothing,
}

/// Summarises these traces. Reads the key columns and `reply_status` of all rows, and every byte for the hashes.
pub fn info(set: &TraceSet, listing: Listing, threads: NonZeroUsize) -> Result<Info, TraceError> {
    let mut listed = (listing == Listing::Episodes).then(Vec::new);
    let bytes = set.files().iter().map(TraceFile::bytes).sum();
    let most = most_listed(bytes);
    // The names of models are compared, counted and printed in full.
    let names = Limit::in_proportion("bytes of models in experiments in files of their size", 24 << 20, 8, bytes);
    let (mut all, mut bytes_of_names) = (Pairs::new(), 0);
    let mut episodes = vec![0; set.files().len()];
    let statuses: Vec<String> = set.declares(REPLY_STATUS).then(|| REPLY_STATUS.to_owned()).into_iter().collect();
    let mut replies = (!statuses.is_empty()).then(ReplyCounts::default);
    let summary = set.scan(
        &Projection { unchecked: statuses, without_t: true, ..Projection::default() },
        threads,
        |batch| {
            let list = if listing == Listing::Episodes { list(set, &batch) } else { Vec::new() };
            let count = batch.episodes.num_rows() as u64;
            Ok::<_, TraceError>((batch.origin.file, count, pairs(&batch), ReplyCounts::of_batch(&batch), list))
        },
        |(file, count, pairs, counts, list)| {
            episodes[file] += count;
            for (cell, pairs) in pairs {
                let bytes = (CELL + cell.0.len() + cell.1.len()) as u64;
                let known = all.entry(cell).or_insert_with(|| {
                    bytes_of_names += bytes;
                    Vec::new()
                });
                known.extend(pairs);
            }
            names.check(bytes_of_names).map_err(|exceeded| over_budget(set, &exceeded))?;
            if let Some(listed) = &mut listed {
                listed.extend(list);
                most.check(listed.len() as u64).map_err(|exceeded| over_budget(set, &exceeded))?;
            }
            if let Some(replies) = &mut replies {
                replies.merge(&counts);
            }
            Ok(())
        },
    )?;
    let mut files = Vec::with_capacity(set.files().len());
    let jobs: Vec<_> = set.files().iter().zip(episodes).collect();
    in_order(
        threads,
        &jobs,
        |(file, episodes)| about(file, *episodes),
        |about| {
            files.push(about?);
            Ok::<_, TraceError>(())
        },
    )?;
    let cells = counted(all);
    let pairs = distinct(cells.values().flatten().map(|(pair, _)| *pair));
    let names = |of: fn(&(String, String)) -> &String| cells.keys().map(of).cloned().collect::<BTreeSet<_>>();
    let (experiments, models) = (names(|(experiment, _)| experiment), names(|(_, model)| model));
    let asked = experiments.len().saturating_mul(models.len()).saturating_mul(pairs.len());
    MOST_COVERED.check(asked as u64).map_err(|exceeded| over_budget(set, &exceeded))?;
    Ok(Info {
        episodes: summary.episodes,
        steps: summary.steps,
        coverage: coverage(&cells, &pairs, &experiments, &models),
        renderers: renderer::of_files(set.files()),
        replies,
        columns: columns(set),
        episode_list: listed,
        files,
        seeds: distinct(pairs.iter().map(|pair| pair.seed)),
        runs: distinct(pairs.iter().map(|pair| pair.run)),
        models: models.into_iter().collect(),
        experiments: experiments.into_iter().collect(),
    })
}

fn over_budget(set: &TraceSet, exceeded: &Exceeded) -> TraceError {
    Finding::over_budget(set.files().first().map_or("", TraceFile::name), exceeded).into()
}

fn distinct<T: Ord>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut values: Vec<T> = values.collect();
    // A stable sort, since it makes use of ascending stretches.
    values.sort();
    values.dedup();
    values
}

fn column_of<'a>(batch: &'a EpisodeBatch, name: &str) -> &'a ArrayRef {
    batch.episodes.column_by_name(name).expect("a scan delivers the columns of an episode")
}

fn texts_of<'a>(batch: &'a EpisodeBatch, name: &str) -> &'a DictionaryArray<Int32Type> {
    column_of(batch, name).as_dictionary()
}

fn integers_of<'a>(batch: &'a EpisodeBatch, name: &str) -> &'a [i64] {
    column_of(batch, name).as_primitive::<Int64Type>().values()
}

fn text(column: &DictionaryArray<Int32Type>, row: usize) -> String {
    let key = column.key(row);
    key.map_or_else(String::new, |key| column.values().as_string::<i32>().value(key).to_owned())
}

fn list(set: &TraceSet, batch: &EpisodeBatch) -> Vec<EpisodeInfo> {
    let [ids, experiments, models] = ["episode_id", "experiment", "model"].map(|name| texts_of(batch, name));
    let [seeds, runs] = ["seed", "run"].map(|name| integers_of(batch, name));
    let file = set.files()[batch.origin.file].name();
    let episode = |row: usize| EpisodeInfo {
        episode_id: text(ids, row),
        experiment: text(experiments, row),
        model: text(models, row),
        seed: seeds[row],
        run: runs[row],
        steps: (batch.offsets[row + 1] - batch.offsets[row]) as u64,
        file: file.to_owned(),
    };
    (0..batch.episodes.num_rows()).map(episode).collect()
}

type Pairs = BTreeMap<(String, String), Vec<SeedRun>>;

fn pairs(batch: &EpisodeBatch) -> Pairs {
    let [experiments, models] = ["experiment", "model"].map(|name| texts_of(batch, name));
    let [seeds, runs] = ["seed", "run"].map(|name| integers_of(batch, name));
    // A batch has few cells, but as many episodes as fit: their names are compared by key.
    let mut by_key: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for row in 0..batch.episodes.num_rows() {
        by_key.entry((experiments.key(row), models.key(row))).or_default().push(row);
    }
    let mut found = Pairs::new();
    for rows in by_key.into_values() {
        let cell = (text(experiments, rows[0]), text(models, rows[0]));
        let pair = |row: &usize| SeedRun { seed: seeds[*row], run: runs[*row] };
        found.entry(cell).or_default().extend(rows.iter().map(pair));
    }
    found
}

type Cells = BTreeMap<(String, String), Vec<(SeedRun, u64)>>;

fn counted(pairs: Pairs) -> Cells {
    let counted = |mut pairs: Vec<SeedRun>| {
        pairs.sort_unstable();
        pairs.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u64)).collect()
    };
    pairs.into_iter().map(|(cell, pairs)| (cell, counted(pairs))).collect()
}

fn coverage(cells: &Cells, pairs: &[SeedRun], experiments: &BTreeSet<String>, models: &BTreeSet<String>) -> Vec<Cell> {
    let cell = |experiment: &String, model: &String| {
        let have = cells.get(&(experiment.clone(), model.clone())).map_or(&[][..], Vec::as_slice);
        // Both are sorted, so one pass finds the missing ones.
        let mut rest = have.iter().map(|(pair, _)| pair).peekable();
        Cell {
            experiment: experiment.clone(),
            model: model.clone(),
            episodes: have.iter().map(|(_, count)| count).sum(),
            missing: pairs.iter().filter(|pair| rest.next_if_eq(pair).is_none()).copied().collect(),
            repeated: have.iter().filter(|(_, count)| *count > 1).map(|(pair, _)| *pair).collect(),
        }
    };
    experiments.iter().flat_map(|e| models.iter().map(move |m| cell(e, m))).collect()
}

fn columns(set: &TraceSet) -> Vec<ColumnInfo> {
    let about = |name: &str| {
        let found = set.column(name)?;
        let known = set.domain().column(name).is_some();
        Some(ColumnInfo { name: name.to_owned(), kind: found.kind, known, missing_from: found.missing_from })
    };
    set.column_names().into_iter().filter_map(about).collect()
}

fn about(file: &TraceFile, episodes: u64) -> Result<FileInfo, TraceError> {
    let failed = |source: io::Error| TraceError::Read { what: file.name().to_owned(), source };
    let text = |key| file.metadata_value(key).map(str::to_owned);
    Ok(FileInfo {
        name: file.name().to_owned(),
        bytes: file.bytes(),
        sha256: file.reader().and_then(hash::of_reader).map_err(failed)?,
        episodes,
        steps: file.rows(),
        row_groups: file.row_groups(),
        schema_version: text(VERSION_KEY),
        writer: text(WRITER_KEY),
        checksums: file.checksums(),
        recording: text(RECORDING_KEY).map(|text| serde_json::from_str(&text).unwrap_or(text.into())),
    })
}

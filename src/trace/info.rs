//! What traces hold: episodes, steps, who and what, which cells of the grid are filled, and the files themselves.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::num::NonZeroUsize;

use arrow::array::{AsArray as _, DictionaryArray};
use arrow::datatypes::{Int32Type, Int64Type};
use schemars::JsonSchema;
use serde::Serialize;

use super::error::TraceError;
use super::read::in_order::in_order;
use super::read::open::{TraceFile, TraceSet};
use super::replies::{REPLY_STATUS, ReplyCounts};
use super::scan::{EpisodeBatch, Projection};
use super::schema::{self, Kind, RECORDING_KEY, VERSION_KEY, WRITER_KEY};
use crate::base::hash;

/// A summary of some traces.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Info {
    /// How many episodes there are.
    pub episodes: u64,
    /// How many steps they have together.
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
    /// What became of the replies; null where no file has the column `reply_status`.
    pub replies: Option<ReplyCounts>,
    /// The columns of all files.
    pub columns: Vec<ColumnInfo>,
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
    /// How many episodes there are.
    pub episodes: u64,
    /// Seeds and runs that some other cell has and this one has not.
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

/// One column over all files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ColumnInfo {
    /// Its name.
    pub name: String,
    /// Its logical type; `unsupported` also where files differ.
    #[serde(rename = "type")]
    pub kind: Kind,
    /// Whether the schema knows it.
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
    /// How it was recorded: JSON, or the text as it is where that is no JSON.
    pub recording: Option<serde_json::Value>,
}

/// Summarises these traces; reads the key columns and `reply_status` of all rows, and every byte for its hash.
///
/// # Errors
/// The first fault of the traces, or a file that cannot be read.
pub fn info(set: &TraceSet, threads: NonZeroUsize) -> Result<Info, TraceError> {
    let (mut cells, mut episodes) = (Cells::new(), vec![0; set.files().len()]);
    let statuses: Vec<String> = set.column(REPLY_STATUS).map(|_| REPLY_STATUS.to_owned()).into_iter().collect();
    let mut replies = (!statuses.is_empty()).then(ReplyCounts::default);
    let summary = set.scan(
        &Projection { unchecked: statuses, ..Projection::default() },
        threads,
        |batch| Ok::<_, TraceError>((cells_of(&batch), ReplyCounts::of_batch(&batch))),
        |((file, found), counts)| {
            for (cell, pairs) in found {
                episodes[file] += pairs.values().sum::<u64>();
                let known = cells.entry(cell).or_default();
                for (pair, count) in pairs {
                    *known.entry(pair).or_default() += count;
                }
            }
            if let Some(replies) = &mut replies {
                replies.merge(&counts);
            }
            Ok(())
        },
    )?;
    let mut files = Vec::with_capacity(set.files().len());
    let counted: Vec<(&TraceFile, u64)> = set.files().iter().zip(episodes).collect();
    in_order(
        threads,
        &counted,
        |(file, episodes)| about(file, *episodes),
        |about| {
            files.push(about?);
            Ok::<_, TraceError>(())
        },
    )?;
    let pairs: BTreeSet<SeedRun> = cells.values().flat_map(|pairs| pairs.keys()).copied().collect();
    let names = |of: fn(&(String, String)) -> &String| cells.keys().map(of).cloned().collect::<BTreeSet<_>>();
    let (experiments, models) = (names(|(experiment, _)| experiment), names(|(_, model)| model));
    Ok(Info {
        episodes: summary.episodes,
        steps: summary.steps,
        coverage: coverage(&cells, &pairs, &experiments, &models),
        replies,
        columns: columns(set),
        files,
        seeds: pairs.iter().map(|pair| pair.seed).collect::<BTreeSet<_>>().into_iter().collect(),
        runs: pairs.iter().map(|pair| pair.run).collect::<BTreeSet<_>>().into_iter().collect(),
        models: models.into_iter().collect(),
        experiments: experiments.into_iter().collect(),
    })
}

/// How often each experiment with each model has each seed and run.
type Cells = BTreeMap<(String, String), BTreeMap<SeedRun, u64>>;

/// The cells of a batch, and its file.
fn cells_of(batch: &EpisodeBatch) -> (usize, Cells) {
    let column = |name| batch.episodes.column_by_name(name).expect("a scan delivers the columns of an episode");
    let [experiments, models] = ["experiment", "model"].map(|name| column(name).as_dictionary::<Int32Type>());
    let [seeds, runs] = ["seed", "run"].map(|name| column(name).as_primitive::<Int64Type>().values());
    let text = |column: &DictionaryArray<Int32Type>, row| {
        column.key(row).map_or_else(String::new, |key| column.values().as_string::<i32>().value(key).to_owned())
    };
    let mut cells = Cells::new();
    for row in 0..batch.episodes.num_rows() {
        let pairs = cells.entry((text(experiments, row), text(models, row))).or_default();
        *pairs.entry(SeedRun { seed: seeds[row], run: runs[row] }).or_default() += 1;
    }
    (batch.origin.file, cells)
}

fn coverage(
    cells: &Cells,
    pairs: &BTreeSet<SeedRun>,
    experiments: &BTreeSet<String>,
    models: &BTreeSet<String>,
) -> Vec<Cell> {
    let none = BTreeMap::new();
    let cell = |experiment: &String, model: &String| {
        let have = cells.get(&(experiment.clone(), model.clone())).unwrap_or(&none);
        Cell {
            experiment: experiment.clone(),
            model: model.clone(),
            episodes: have.values().sum(),
            missing: pairs.iter().filter(|pair| !have.contains_key(pair)).copied().collect(),
            repeated: have.iter().filter(|(_, count)| **count > 1).map(|(pair, _)| *pair).collect(),
        }
    };
    experiments.iter().flat_map(|e| models.iter().map(move |m| cell(e, m))).collect()
}

fn columns(set: &TraceSet) -> Vec<ColumnInfo> {
    let about = |name: &str| {
        let found = set.column(name)?;
        let known = schema::column(name).is_some();
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
        recording: text(RECORDING_KEY).map(|text| serde_json::from_str(&text).unwrap_or(text.into())),
    })
}

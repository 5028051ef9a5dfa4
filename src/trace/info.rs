//! What traces hold: episodes, steps, who and what, which cells of the grid are filled, and the files themselves.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::num::NonZeroUsize;

use schemars::JsonSchema;
use serde::Serialize;

use super::column::text_at;
use super::finding::TraceError;
use super::open::{TraceFile, TraceSet};
use super::replies::{REPLY_STATUS, ReplyCounts};
use super::rules::int_at;
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
    let mut tally = Tally { files: vec![0; set.files().len()], ..Tally::default() };
    let statuses: Vec<String> = set.column(REPLY_STATUS).map(|_| REPLY_STATUS.to_owned()).into_iter().collect();
    let mut replies = (!statuses.is_empty()).then(ReplyCounts::default);
    let summary = set.scan(
        &Projection { unchecked: statuses, ..Projection::default() },
        threads,
        |batch| Ok::<_, TraceError>((keys(&batch), ReplyCounts::of_batch(&batch))),
        |(keys, counts)| {
            tally.add(keys);
            if let Some(replies) = &mut replies {
                replies.merge(&counts);
            }
            Ok(())
        },
    )?;
    let files = set.files().iter().zip(&tally.files).map(|(file, episodes)| about(file, *episodes));
    Ok(Info {
        episodes: summary.episodes,
        steps: summary.steps,
        coverage: tally.coverage(),
        replies,
        columns: columns(set),
        files: files.collect::<Result<_, _>>()?,
        seeds: tally.pairs.iter().map(|pair| pair.seed).collect::<BTreeSet<_>>().into_iter().collect(),
        runs: tally.pairs.iter().map(|pair| pair.run).collect::<BTreeSet<_>>().into_iter().collect(),
        models: tally.models.into_iter().collect(),
        experiments: tally.experiments.into_iter().collect(),
    })
}

/// The file, and experiment, model and seed with run of each episode.
fn keys(batch: &EpisodeBatch) -> (usize, Vec<(String, String, SeedRun)>) {
    let column = |name| batch.episodes.column_by_name(name).expect("a scan delivers the columns of an episode");
    let [experiments, models, seeds, runs] = ["experiment", "model", "seed", "run"].map(column);
    let text = |column, row| text_at(column, row).unwrap_or_default().to_owned();
    let int = |column, row| int_at(column, row).unwrap_or_default();
    let key = |row| {
        let pair = SeedRun { seed: int(seeds, row), run: int(runs, row) };
        (text(experiments, row), text(models, row), pair)
    };
    (batch.origin.file, (0..batch.episodes.num_rows()).map(key).collect())
}

#[derive(Default)]
struct Tally {
    files: Vec<u64>,
    models: BTreeSet<String>,
    experiments: BTreeSet<String>,
    pairs: BTreeSet<SeedRun>,
    cells: BTreeMap<(String, String), BTreeMap<SeedRun, u64>>,
}

impl Tally {
    fn add(&mut self, (file, keys): (usize, Vec<(String, String, SeedRun)>)) {
        self.files[file] += keys.len() as u64;
        for (experiment, model, pair) in keys {
            self.models.insert(model.clone());
            self.experiments.insert(experiment.clone());
            self.pairs.insert(pair);
            *self.cells.entry((experiment, model)).or_default().entry(pair).or_default() += 1;
        }
    }

    fn coverage(&self) -> Vec<Cell> {
        let none = BTreeMap::new();
        let cell = |experiment: &String, model: &String| {
            let have = self.cells.get(&(experiment.clone(), model.clone())).unwrap_or(&none);
            Cell {
                experiment: experiment.clone(),
                model: model.clone(),
                episodes: have.values().sum(),
                missing: self.pairs.iter().filter(|pair| !have.contains_key(pair)).copied().collect(),
                repeated: have.iter().filter(|(_, count)| **count > 1).map(|(pair, _)| *pair).collect(),
            }
        };
        self.experiments.iter().flat_map(|e| self.models.iter().map(move |m| cell(e, m))).collect()
    }
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

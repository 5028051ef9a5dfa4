//! Writes episodes as traces and scores them, as every test of this folder does.

use std::num::NonZeroUsize;
use std::path::Path;

use mirrorstats_metric::columns::{Columns, KnownColumn};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::score_traces;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::write::OptionalColumns;

use crate::harness::traces::{open, write_trace};

/// Writes a trace that has every column of the schema.
pub fn write(path: &Path, episodes: &[Episode]) {
    write_trace(path, episodes, OptionalColumns::all());
}

/// Scores episodes under the definitions from `load`.
fn score_with(episodes: &[Episode], load: impl FnOnce(&TraceSet) -> Definitions) -> EpisodeTable {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trace.parquet");
    write(&path, episodes);
    let traces = open(&[&path]);
    let definitions = load(&traces);
    score_traces::score(&traces, &definitions, &[], NonZeroUsize::MIN).unwrap()
}

/// Scores episodes under the paper's definitions.
pub fn score_paper(episodes: &[Episode]) -> EpisodeTable {
    score_with(episodes, |traces| score_traces::definitions(traces, &score_traces::Request::of("paper")).unwrap())
}

/// The columns of these traces; random definitions compare any of them with any text.
pub fn free_columns(traces: &TraceSet) -> Columns {
    let all = vocabulary::trace_columns(traces);
    let free = |name| (name, KnownColumn { values: Vec::new(), ..all.known(name).unwrap().clone() });
    all.names().map(free).collect()
}

/// Scores episodes under definitions given as text.
pub fn score_toml(episodes: &[Episode], toml: &str) -> EpisodeTable {
    score_with(episodes, |traces| {
        Definitions::from_toml("test", toml, &free_columns(traces)).unwrap_or_else(|faults| panic!("{faults}"))
    })
}

/// The values of one episode, metric by metric.
pub fn values(table: &EpisodeTable, episode_id: &str) -> Vec<Option<i64>> {
    let row = table.keys.iter().position(|key| key.episode_id == episode_id).expect("the episode was scored");
    table.metrics.iter().map(|metric| metric.get(row)).collect()
}

//! The files of the fixture, one per model and experiment: names, footers, and a check that a folder holds exactly
//! them.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::Path;

use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};
use serde_json::{Value, json};

use super::contradiction::Contradiction;
use super::published::{self, Pair, Reading};

/// One file before it is written.
pub struct Trace {
    /// `E1-ministral-3-14b.parquet`.
    pub name: String,
    /// The footer's metadata about the recording.
    pub recording: Value,
    /// Ordered by seed and run.
    pub episodes: Vec<Episode>,
}

/// All 40 files, in the order of the main table.
///
/// # Errors
/// If a pair's published cells contradict each other even with the known errors corrected.
pub fn traces() -> Result<Vec<Trace>, Contradiction> {
    published::pairs(Reading::Corrected).iter().map(trace).collect()
}

fn trace(pair: &Pair) -> Result<Trace, Contradiction> {
    Ok(Trace {
        name: format!("{}-{}.parquet", pair.experiment, slug(&pair.model)),
        recording: json!({
            "kind": "reconstruction",
            "notice": "Rebuilt from the published result tables. Not the original recordings: \
                       whatever the tables leave open is arbitrary.",
            "sources": ["main table", "appendix table", "values in the running text"],
            "made_by": "examples/reconstruct",
            "experiment": pair.experiment,
            "model": pair.model,
        }),
        episodes: super::episodes(pair)?,
    })
}

/// A model's name in file names and episode ids: lowercase letters and digits, joined by hyphens.
pub fn slug(model: &str) -> String {
    let words: Vec<&str> = model.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    words.join("-").to_ascii_lowercase()
}

/// Writes the files into a folder, which is created if missing.
///
/// # Errors
/// If a file cannot be written.
pub fn write(folder: &Path, traces: &[Trace]) -> Result<(), TraceError> {
    fs::create_dir_all(folder)
        .map_err(|source| TraceError::Write { file: folder.display().to_string(), source: Box::new(source) })?;
    for trace in traces {
        let path = folder.join(&trace.name);
        fs::write(&path, bytes(trace)?)
            .map_err(|source| TraceError::Write { file: path.display().to_string(), source: Box::new(source) })?;
    }
    Ok(())
}

/// The bytes of a file that [`write`] writes.
///
/// # Errors
/// If the trace schema forbids an episode.
pub fn bytes(trace: &Trace) -> Result<Vec<u8>, TraceError> {
    let columns = OptionalColumns::used_by(&trace.episodes);
    let metadata = TraceMetadata { recording: Some(trace.recording.clone()), columns };
    let mut encoder = TraceWriter::new(Vec::new(), &metadata)?;
    for episode in &trace.episodes {
        encoder.write(episode)?;
    }
    encoder.finish()
}

/// The differences between a folder and the output of [`write`], one per line; only traces are compared.
///
/// # Errors
/// If the trace schema forbids an episode.
pub fn differences(folder: &Path, traces: &[Trace]) -> Result<Vec<String>, TraceError> {
    let mut differences = Vec::new();
    for trace in traces {
        match fs::read(folder.join(&trace.name)) {
            Ok(found) if found == bytes(trace)? => {}
            Ok(_) => differences.push(format!("{}: not the bytes that are made now", trace.name)),
            Err(error) => differences.push(format!("{}: {error}", trace.name)),
        }
    }
    let known: BTreeSet<&str> = traces.iter().map(|trace| trace.name.as_str()).collect();
    let strangers = parquet_names(folder).unwrap_or_default().into_iter().filter(|name| !known.contains(name.as_str()));
    differences.extend(strangers.map(|name| format!("{name}: not a file of the reconstruction")));
    Ok(differences)
}

fn parquet_names(folder: &Path) -> io::Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".parquet") {
            names.insert(name);
        }
    }
    Ok(names)
}

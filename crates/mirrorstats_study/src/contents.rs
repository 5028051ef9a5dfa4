//! The contents of traces as text: episodes, coverage, files and reply quality.

use std::fmt::{self, Display, Write as _};

use schemars::JsonSchema;
use serde::Serialize;

use super::quality::{CellAnswer, has_quality, quality};
use super::{Study, StudyError};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_report::layout;
use mirrorstats_score::quality::QualityByCell;
use mirrorstats_tables::{Table, wrapped};
use mirrorstats_trace::footers::checksums::Checksums;
use mirrorstats_trace::info::{Cell, EpisodeInfo, Info, SeedRun};

/// The contents of traces.
#[derive(Clone, Debug)]
pub struct Contents {
    pub info: Info,
    /// The reply quality; empty if the traces do not record it.
    pub quality: QualityByCell,
}

/// The answer for a program.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct InfoAnswer {
    /// The contents of the traces.
    #[serde(flatten)]
    pub info: Info,
    /// The reply quality by cell; empty if the traces do not record it.
    pub quality: Vec<CellAnswer>,
}

impl Contents {
    pub fn of(study: &Study, info: Info) -> Result<Self, StudyError> {
        let quality = if has_quality(study)? { quality(study)? } else { QualityByCell::default() };
        Ok(Self { info, quality })
    }

    pub fn answer(self) -> InfoAnswer {
        InfoAnswer { info: self.info, quality: CellAnswer::of_all(&self.quality) }
    }

    pub fn render(&self, width: Option<usize>) -> String {
        let mut out = String::new();
        let _ = write_info(&mut out, &self.info, width);
        let quality = layout::quality::text(&self.quality, width);
        if !quality.is_empty() {
            let _ = writeln!(out, "\nreplies by experiment and model\n{quality}");
        }
        out
    }
}

fn write_info(out: &mut String, info: &Info, width: Option<usize>) -> fmt::Result {
    let bytes: u64 = info.files.iter().map(|file| file.bytes).sum();
    let (episodes, steps) = (counted(info.episodes, "episode"), counted(info.steps, "step"));
    writeln!(out, "{episodes}, {steps}, {}, {}\n", counted(info.files.len() as u64, "file"), counted(bytes, "byte"))?;
    list(out, "models", &info.models, ", ", width)?;
    list(out, "experiments", &info.experiments, ", ", width)?;
    list(out, "seeds", &info.seeds, ", ", width)?;
    list(out, "runs", &info.runs, ", ", width)?;
    if !info.renderers.is_empty() {
        list(out, "renderers", &info.renderers, "; ", width)?;
    }
    let own: Vec<_> = info.columns.iter().filter(|column| !column.known).map(|column| &column.name).collect();
    if !own.is_empty() {
        list(out, "own columns", &own, ", ", width)?;
    }
    if let Some(replies) = info.replies.as_ref().filter(|replies| replies.all_unreadable() > 0) {
        let (bad, all) = (replies.all_unreadable(), replies.replies);
        writeln!(out, "\n{bad} of {all} replies could not be read: {replies} (`reply_status`)")?;
    }
    write!(out, "\nepisodes by experiment and model\n{}", coverage(info).within(width))?;
    gaps(out, info)?;
    write!(out, "\nfiles\n{}", files(info).within(width))
}

fn list(out: &mut String, what: &str, values: &[impl Display], between: &str, width: Option<usize>) -> fmt::Result {
    let shown: Vec<_> = values.iter().map(|value| visible(&value.to_string())).collect();
    let head = format!("{what:<12} {:>3}   ", values.len());
    let indent = head.len();
    let lines = wrapped(&shown.join(between), width.map_or(usize::MAX, |width| width.saturating_sub(indent)), 0);
    writeln!(out, "{head}{}", lines.join(&format!("\n{}", " ".repeat(indent))))
}

fn coverage(info: &Info) -> Table {
    let header = std::iter::once("model").chain(info.experiments.iter().map(String::as_str));
    let mut table = Table::of_texts(header).aligned_right(1..=info.experiments.len());
    for (row, model) in info.models.iter().enumerate() {
        // Cells are ordered by experiment, with all models for each.
        let counts = info.coverage.iter().skip(row).step_by(info.models.len()).map(|cell| match cell.episodes {
            0 => "none".to_owned(),
            episodes => episodes.to_string(),
        });
        table.push(std::iter::once(model.clone()).chain(counts));
    }
    table
}

const LISTED: usize = 8;

fn gaps(out: &mut String, info: &Info) -> fmt::Result {
    let incomplete: Vec<&Cell> = info.coverage.iter().filter(|cell| !cell.missing.is_empty()).collect();
    if incomplete.is_empty() {
        writeln!(out, "\nevery cell has every seed and run that any cell has")?;
    } else {
        writeln!(out, "\nmissing (seed/run), of those that other cells have")?;
    }
    for cell in incomplete {
        let what = if cell.episodes == 0 { "all".to_owned() } else { pairs(&cell.missing) };
        writeln!(out, "  {}, {}: {what}", visible(&cell.experiment), visible(&cell.model))?;
    }
    let repeated = info.coverage.iter().filter(|cell| !cell.repeated.is_empty());
    for (i, cell) in repeated.enumerate() {
        if i == 0 {
            writeln!(out, "\nmore than one episode (seed/run)")?;
        }
        writeln!(out, "  {}, {}: {}", visible(&cell.experiment), visible(&cell.model), pairs(&cell.repeated))?;
    }
    Ok(())
}

fn pairs(pairs: &[SeedRun]) -> String {
    let shown: Vec<_> = pairs.iter().take(LISTED).map(|pair| format!("{}/{}", pair.seed, pair.run)).collect();
    match pairs.len().saturating_sub(LISTED) {
        0 => shown.join(" "),
        more => format!("{} and {more} more", shown.join(" ")),
    }
}

/// The table of episodes: their ids, steps and files.
pub fn episode_list(episodes: &[EpisodeInfo]) -> Table {
    let header = ["episode", "experiment", "model", "seed", "run", "steps", "file"];
    let rows = episodes.iter().map(|episode| {
        [
            episode.episode_id.clone(),
            episode.experiment.clone(),
            episode.model.clone(),
            episode.seed.to_string(),
            episode.run.to_string(),
            episode.steps.to_string(),
            episode.file.clone(),
        ]
    });
    Table::of_texts(header).aligned_right(3..=5).with(rows)
}

fn files(info: &Info) -> Table {
    let header = ["file", "episodes", "steps", "row groups", "bytes", "sha256", "schema", "checksums", "writer"];
    let rows = info.files.iter().map(|file| {
        [
            file.name.clone(),
            file.episodes.to_string(),
            file.steps.to_string(),
            file.row_groups.to_string(),
            file.bytes.to_string(),
            file.sha256.chars().take(12).collect(),
            file.schema_version.as_deref().unwrap_or("not named").to_owned(),
            match file.checksums {
                Checksums::None => "none".to_owned(),
                Checksums::Stale => "stale".to_owned(),
                Checksums::Present => "present".to_owned(),
            },
            file.writer.as_deref().unwrap_or("not named").to_owned(),
        ]
    });
    Table::of_texts(header).aligned_right(1..=4).with(rows)
}

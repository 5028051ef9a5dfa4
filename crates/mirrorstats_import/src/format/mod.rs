//! Reads files of other programs as rows. A format is a mapping in `assets/import`; native code opens the files.
//!
//! Rule: keys that a format does not give are absent or null. Records that are not steps are counted and named.

mod csv;
mod inspect;
pub(super) mod lerobot;
pub(super) mod objects;
mod parquet;

use std::fs::File;
use std::io::{BufRead as _, BufReader, Seek as _};

use super::error::ImportError;
use super::json::BYTE_ORDER_MARK;
use super::mapping::Mapping;
use super::rows::Rows;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    JsonLines,
    /// One object or list in a file.
    Json,
    Csv,
    Parquet,
    /// A log of Inspect, `.eval` or `.json`.
    Inspect,
    InspectRobots,
    /// `eval_info.json`, the folder of a data set, or Parquet files of its frames.
    LeRobot,
    /// A trajectory in the Agent Trajectory Interchange Format.
    Atif,
    /// The aggregate file of `vla-eval export`.
    VlaEval,
    /// A result file of `MirrorBench`.
    MirrorBench,
}

mirrorstats_exact::names!(Format {
    JsonLines: "jsonl",
    Json: "json",
    Csv: "csv",
    Parquet: "parquet",
    Inspect: "inspect",
    InspectRobots: "inspect-robots",
    LeRobot: "lerobot",
    Atif: "atif",
    VlaEval: "vla-eval",
    MirrorBench: "mirrorbench",
});

/// The mappings of formats, each with the bytes that a file of its kind has near its start; the last one that fits
/// counts, or else the last of the format.
const MAPPINGS: [(Format, &str, &str); 7] = [
    (Format::Atif, "\"ATIF-v", include_str!("../../../../assets/import/atif.toml")),
    (Format::VlaEval, "\"harness_version\"", include_str!("../../../../assets/import/vla-eval.toml")),
    (
        Format::InspectRobots,
        "\"inspect_robots_version\"",
        include_str!("../../../../assets/import/inspect-robots.toml"),
    ),
    (Format::MirrorBench, "\"improvement_steps\"", include_str!("../../../../assets/import/mirrorbench.toml")),
    (Format::LeRobot, "PAR1", include_str!("../../../../assets/import/lerobot-frames.toml")),
    (Format::LeRobot, "\"per_episode\"", include_str!("../../../../assets/import/lerobot-episodes.toml")),
    (Format::LeRobot, "\"per_task\"", include_str!("../../../../assets/import/lerobot-tasks.toml")),
];

/// The number of bytes that identify the kind of a file.
pub(super) const HEAD: u64 = 64 << 10;

/// Endings of compressed files, whose contents have the format before it.
const COMPRESSED: [&str; 3] = [".gz", ".zst", ".zstd"];

impl Format {
    /// The format by a file's first bytes, then by its name; JSON Lines if they show no other. A mapping of lists reads
    /// JSON without a mapping.
    pub(super) fn detect(name: &str, head: &[u8], has_lists: bool) -> Self {
        let name = name.to_ascii_lowercase();
        let name = COMPRESSED.iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(&name);
        let text = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head).trim_ascii_start();
        match name.rsplit_once('.').map(|(_, ending)| ending) {
            _ if head.starts_with(b"PAR1") => Self::Parquet,
            _ if head.starts_with(b"PK\x03\x04") => Self::Inspect,
            Some("json") if has_lists => Self::Json,
            _ if text.starts_with(b"{") && !has_lists => Self::of_json(&String::from_utf8_lossy(head)),
            _ if text.starts_with(b"[") => Self::JsonLines,
            Some("csv" | "tsv") => Self::Csv,
            Some("parquet" | "parq" | "pq") => Self::Parquet,
            Some("eval") => Self::Inspect,
            _ => Self::JsonLines,
        }
    }

    fn of_json(head: &str) -> Self {
        let has = |key: &str| head.contains(key);
        let built_in = MAPPINGS.iter().find(|(_, mark, _)| mark.starts_with('"') && has(mark));
        match built_in {
            Some((format, ..)) => *format,
            None if has("\"eval\"") && has("\"status\"") && has("\"version\"") => Self::Inspect,
            None => Self::JsonLines,
        }
    }

    /// Returns true if contents alone tell the format.
    pub(super) const fn is_recognised(self) -> bool {
        !matches!(self, Self::JsonLines | Self::Json | Self::Csv | Self::Parquet)
    }

    /// The built-in definitions for which its files have every column; `None` where that depends on the file.
    pub(super) fn definitions(self) -> Option<&'static str> {
        (self == Self::MirrorBench).then_some("reach")
    }

    /// The mapping of the format, if it has one.
    pub(super) fn mapping(self, head: &[u8]) -> Option<Mapping> {
        let head = String::from_utf8_lossy(head);
        let of_format = || MAPPINGS.iter().rev().filter(|(format, ..)| *format == self);
        let (.., text) = of_format().find(|(_, mark, _)| head.contains(mark)).or_else(|| of_format().next())?;
        Some(Mapping::built_in(text))
    }

    pub(super) fn read(self, mut file: File, rows: &mut Rows<'_>) -> Result<(), ImportError> {
        file.rewind().map_err(ImportError::read(&rows.file))?;
        let mut reader = BufReader::new(file);
        let head = reader.fill_buf().map_err(ImportError::read(&rows.file))?;
        let text = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head).trim_ascii_start();
        let is_list = text.starts_with(b"[");
        // Indented JSON has its first brace in a line of its own.
        let is_indented = text.split(|byte| *byte == b'\n').next().is_some_and(|line| line.trim_ascii() == b"{");
        let is_parquet = head.starts_with(b"PAR1");
        match self {
            Self::JsonLines | Self::Json if is_list => objects::read_list(reader, rows),
            Self::JsonLines if is_indented => objects::read_object(reader, rows),
            Self::JsonLines => objects::read_lines(&mut reader, rows),
            Self::Csv => csv::read(reader, rows),
            Self::Parquet => parquet::read(reader.into_inner(), rows),
            Self::Inspect => inspect::read(reader, rows),
            Self::LeRobot if is_parquet => lerobot::read_frames(reader.into_inner(), rows, &mut |_| Vec::new()),
            Self::Json | Self::InspectRobots | Self::LeRobot | Self::Atif | Self::VlaEval | Self::MirrorBench => {
                objects::read_object(reader, rows)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{MAPPINGS, Mapping};

    #[test]
    fn every_built_in_mapping_is_read() {
        for (format, _, text) in MAPPINGS {
            assert!(!Mapping::built_in(text).is_empty(), "{format:?}");
        }
    }
}

//! mirrorstats scores episodes of embodied agents that must recognise themselves in a mirror.
#![doc = include_str!("../docs/how-to/rust.md")]
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod cli;

pub use mirrorstats_analysis::changes::{CellChange, Changes, Flip};
pub use mirrorstats_analysis::statistics::{Options as StatisticsOptions, Statistics};
pub use mirrorstats_exact::moments::Moments;
pub use mirrorstats_figures::{Figure, FigureFormat, FigureName, FigureWidth};
pub use mirrorstats_report::bundle::Manifest;
pub use mirrorstats_report::layout::MetricTable;
pub use mirrorstats_score::cells::columns::record_batch;
pub use mirrorstats_score::cells::{Cells, Group, KeyValue};
pub use mirrorstats_score::evidence::Evidence;
pub use mirrorstats_score::tables::columns::record_batch as episode_batch;
pub use mirrorstats_score::tables::table::{EpisodeKey, EpisodeTable, MetricColumn};
pub use mirrorstats_study::diff::{Diff, DiffRequest, Side, diff};
pub use mirrorstats_study::explain::explain;
pub use mirrorstats_study::figure::{FigureOptions, figure};
pub use mirrorstats_study::gate::gate;
pub use mirrorstats_study::inputs::resolve;
pub use mirrorstats_study::report::{Report, ReportOptions, report};
pub use mirrorstats_study::rescore::{RescoreRequest, Rescored};
pub use mirrorstats_study::results::{Outputs, Results};
pub use mirrorstats_study::statistics::statistics;
pub use mirrorstats_study::{ErrorKind, Study, StudyError};
pub use mirrorstats_tables::Table;

//! mirrorstats scores episodes of embodied agents that must recognise themselves in a mirror.
//!
//! The input is steps of episodes in Parquet traces. The output is every metric of the study, exact and deterministic,
//! as tables, cells and scores. Metrics are data: definition files that the program checks, plans and evaluates.
//!
//! `ARCHITECTURE.md` has the crates, their rules, and the way of one number.
//!
//! # The main job
//!
//! ```
//! use mirrorstats::{ReportOptions, Study, StudyError, report};
//!
//! # fn main() -> Result<(), StudyError> {
//! let study = Study::open(["fixtures/paper"])?.definitions("paper")?;
//! assert_eq!(study.score()?.episodes.len(), 840);
//! let report = report(&study, &ReportOptions { style: "paper".into(), figures: false, png: false })?;
//! assert!(report.table("main")?.printed().markdown().contains("Claude Sonnet 4.6"));
//! # Ok(())
//! # }
//! ```
//!
//! # Your own metric
//!
//! A definition file may include another one. `TURNS` counts the turns before the decision:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let file = folder.path().join("mine.toml");
//! # let mine = file.to_str().expect("a path in UTF-8");
//! std::fs::write(
//!     mine,
//!     r#"
//!     include = ["paper"]
//!     [metric.TURNS]
//!     title = "Turns before the decision"
//!     value = "count(action in ('turn_left', 'turn_right') and t < finish)"
//!     "#,
//! )?;
//! let scores = mirrorstats::Study::open(["fixtures/paper"])?.definitions(mine)?.metrics(["TURNS"])?.score()?;
//! assert_eq!(scores.episodes.metrics[0].name, "TURNS");
//! # Ok(())
//! # }
//! ```
//!
//! # Cells as Arrow
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let study = mirrorstats::Study::open(["fixtures/paper"])?.metrics(["TSA", "TTD"])?.by(["experiment"]);
//! let batch = mirrorstats::record_batch(&study.cells()?)?;
//! assert_eq!((batch.num_rows(), batch.schema().field(0).name().as_str()), (5 * 2, "experiment"));
//! # Ok(())
//! # }
//! ```
//!
//! # The folder of a report
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let out = folder.path().join("report");
//! let study = mirrorstats::Study::open(["fixtures/paper"])?.filter("experiment = 'E1'")?;
//! let options = mirrorstats::ReportOptions { figures: false, ..Default::default() };
//! let files = mirrorstats::report(&study, &options)?.write(&out)?.files;
//! assert!(files.contains(&"tables/main.tex".to_owned()));
//! # Ok(())
//! # }
//! ```
//!
//! # What another definition changes
//!
//! ```
//! use mirrorstats::{DiffRequest, Side, diff};
//!
//! # fn main() -> Result<(), mirrorstats::StudyError> {
//! let traces = mirrorstats::resolve(&["fixtures/paper".into()], std::io::empty())?;
//! let (old, new) = (Side::of("paper")?, Side::of("extended")?);
//! let found = diff(&old, &new, &traces, &DiffRequest::default())?;
//! assert!(found.changes.flips.is_empty(), "the extended definitions add metrics and change none");
//! # Ok(())
//! # }
//! ```

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

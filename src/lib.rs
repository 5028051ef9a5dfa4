//! mirrorstats scores episodes of embodied agents that must recognise themselves in a mirror.
//!
//! The input is steps of episodes in Parquet traces. The output is every metric of the study, exact and deterministic,
//! as tables, cells and scores. Metrics are data: definition files that the program checks, plans and evaluates.
//!
//! # Code map
//!
//! ```text
//!     trace ──────► score ───────► report ───────► study ───────► this crate, its command line
//!   (steps of      (one row       (cells, tables,  (one scan,
//!    episodes)      per episode)   figures, pages)  every answer)
//!        ▲             ▲               ▲
//!        │          metric         statistics
//!      world     (definitions,    (numbers in,
//!   (recordings)    checked)       numbers out)
//! ```
//!
//! | crate | contents |
//! |---|---|
//! | `exact` | exact numbers and moments, their text, hashes, limits, atomic file writes |
//! | `web` | a local server: hosts, origins, tokens (feature `view`) |
//! | `toml-spec` | files that people write: read by type, every fault underlined |
//! | `metric` | definition files: TOML, SQL expressions, types, plans |
//! | `trace` | the definition of an episode: schema, reader, writer, validation, import, MCAP logs |
//! | `score` | logical plan, physical plan, and kernels over Arrow batches; the episode table |
//! | `statistics` | intervals, tests, survival, power: numbers in, numbers out |
//! | `report` | cells, styles, tables, figures, statistics for people, the folder of a report |
//! | `engines` | other engines: Polars for queries, Spark for scores |
//! | `study` | inputs, definitions and a filter, opened and scanned once; every answer is a function of it |
//! | `world` | experiments, the MuJoCo world, agents, recordings, replays (feature `sim`) |
//! | `view` | the local web application (feature `view`) |
//! | [`cli`] | command-line arguments, standard output, exit codes |
//!
//! # Invariants
//!
//! - A crate depends only on crates above it in this table; the `Cargo.toml` of each crate lists them.
//! - `metric`, `statistics`, `toml-spec` and `exact` use no Arrow; `report` sees no trace; no analysis uses `world`.
//! - `clippy.toml` of a crate lists what it must not use: clocks, files, threads. Only [`cli`] prints.
//! - An episode's value is an integer; a cell keeps n, Σx, Σx² as integers. So results do not depend on threads, on the
//!   order of files, or on the division of rows among them.
//! - Missing is never zero: it is an [`Option`] until the last renderer.
//! - Output is a function of traces and definitions: no clock, no absolute path, no unordered iteration.
//!
//! # The path of one number
//!
//! A score is stored eight times between the page of a trace and a printed cell, always in columns:
//!
//! 1. a page: dictionary keys or bits, as runs and packed values (`parquet_pages`)
//! 2. a key per row (one byte), a value per run, or bits (`parquet_pages::Column`)
//! 3. a vector per step of the physical plan: truth values as bits (`score::physical`, `score::evaluate`)
//! 4. a value per episode: the vector of an aggregate or of a metric
//! 5. a column of the episode table, sorted once by a permutation (`score::builder`, `score::table`)
//! 6. exact moments of a cell (`exact::moments`)
//! 7. a decimal, rounded once (`exact::number`)
//! 8. text (`report`)
//!
//! # The main job
//!
//! ```
//! use mirrorstats::{ReportOptions, Study, StudyError};
//!
//! # fn main() -> Result<(), StudyError> {
//! let study = Study::open(["fixtures/paper"])?.definitions("paper")?;
//! assert_eq!(study.score()?.episodes.len(), 840);
//! let report = study.report(&ReportOptions { style: "paper".into(), figures: false })?;
//! assert!(report.markdown("main").is_some_and(|table| table.contains("Claude Sonnet 4.6")));
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
//! let files = study.report(&options)?.write(&out)?.files;
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

pub use exact::moments::Moments;
pub use report::bundle::Manifest;
pub use report::cells::columns::record_batch;
pub use report::cells::diff::{CellChange, Changes, Flip};
pub use report::cells::{Cells, Group, KeyValue};
pub use report::figures::{Figure, FigureFormat, FigureName, FigureWidth};
pub use report::layout::MetricTable;
pub use report::statistics::{Options as StatisticsOptions, Statistics};
pub use report::tables::Table;
pub use score::columns::record_batch as episode_batch;
pub use score::evidence::Evidence;
pub use score::table::{EpisodeKey, EpisodeTable, MetricColumn};
pub use study::{
    Backend, Diff, DiffRequest, FigureOptions, Outputs, Report, ReportOptions, RescoreRequest, Rescored, Results, Side,
    Study, StudyError, diff, resolve,
};

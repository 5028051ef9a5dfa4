//! mirrorstats scores episodes of embodied agents that must recognise themselves in a mirror.
//!
//! Steps of episodes come in as Parquet traces; every metric of the study comes out, exactly and
//! deterministically, as tables, cells and scores. Metrics are data: definition files that the
//! program checks, plans and evaluates.
//!
//! # Code map
//!
//! ```text
//!          trace ──────► score ───────► stats ───────► report, figures
//!        (steps of      (one row        (cells:        (tables, statistics,
//!         episodes)      per episode)    moments)       the folder)
//!                          ▲
//!                       metric
//!                 (definitions, checked)
//! ```
//!
//! | room | what it knows |
//! |---|---|
//! | [`cli`] | what was typed, standard output, exit codes |
//! | `view` | the local web application: a study as a page, its server, its static copy (feature `view`) |
//! | [`study`] | inputs, definitions and a filter, opened once and scanned once; every answer is a function of it |
//! | `record` | runs episodes: a world, an agent; a trace and a log (feature `sim`) |
//! | [`replay`] | a recorded episode again: re-simulated, as frames, as a film strip |
//! | [`agent`] | who decides the next action: scripted, a model behind a provider, a program |
//! | `sim` | the MuJoCo world: scene, bodies, camera, visibility from rays (feature `sim`) |
//! | [`log`] | MCAP logs: in, out, and what can be saved of a cut one |
//! | [`report`] | styles, tables, statistics for people, the folder of a report |
//! | [`figures`] | one figure per file, and the kit that draws them |
//! | [`engine`] | other engines for the SQL lowering: Polars, Spark |
//! | [`stats`] | grouping, exact moments, intervals, tests |
//! | [`score`] | logical plan to physical plan to kernels over Arrow batches; the episode table |
//! | [`experiment`] | what a world shows, what an agent is asked and how the answer is decided: files, built in or of one's own |
//! | [`metric`] | definition files: TOML, SQL expressions, types, plans |
//! | [`trace`] | what an episode is: schema, writer, reader, validation |
//! | [`base`] | exact numbers to text, hashes, near names, files that are replaced |
//!
//! # Invariants
//!
//! - A room imports only from rooms below it; a test resolves every path of the sources.
//! - Only [`trace`] opens traces, only [`cli`] prints, only [`base`] rounds.
//! - An episode's value is an integer, a cell keeps n, Σx, Σx² as integers: results do not depend on
//!   threads, on the order of files, or on how rows are divided among them.
//! - Missing is never zero: it is an [`Option`] until the last renderer.
//! - Output is a function of traces and definitions: no clock, no absolute path, no unordered iteration.
//!
//! # The way of one number
//!
//! A score is stored eight times between the page of a trace and a printed cell, always in columns:
//!
//! 1. a page: dictionary keys or bits, as runs and packed values (`trace::read::pages`)
//! 2. a key per row (one byte), a value per run, or bits (`trace::read::column`)
//! 3. a vector per step of the physical plan: truth values as bits ([`score::physical`], [`score::evaluate`])
//! 4. a value per episode: the vector of an aggregate or of a metric
//! 5. a column of the episode table, sorted once by a permutation ([`score::builder`], [`score::table`])
//! 6. exact moments of a cell ([`stats::moments`])
//! 7. a decimal, rounded once ([`base::number`])
//! 8. text ([`report`])
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

#[doc(hidden)]
pub mod agent;
#[doc(hidden)]
pub mod base;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod engine;
#[doc(hidden)]
pub mod experiment;
#[doc(hidden)]
pub mod figures;
#[doc(hidden)]
pub mod log;
#[doc(hidden)]
pub mod metric;
#[cfg(feature = "sim")]
#[doc(hidden)]
pub mod record;
#[doc(hidden)]
pub mod replay;
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod score;
#[cfg(feature = "sim")]
#[doc(hidden)]
pub mod sim;
#[doc(hidden)]
pub mod stats;
#[doc(hidden)]
pub mod study;
#[doc(hidden)]
pub mod trace;
#[cfg(feature = "view")]
#[doc(hidden)]
pub mod view;

// The library. What is reachable besides is for this project's own tests and examples, and may change at any time.
pub use figures::{Figure, FigureFormat, FigureName};
pub use report::bundle::Manifest;
pub use report::statistics::{Options as StatisticsOptions, Statistics};
pub use report::table::Table;
pub use score::columns::record_batch as episode_batch;
pub use score::evidence::Evidence;
pub use score::table::{EpisodeKey, EpisodeTable, MetricColumn};
pub use stats::cell::{Cells, Group, KeyValue};
pub use stats::columns::record_batch;
pub use stats::diff::{CellChange, Changes, Flip};
pub use stats::moments::Moments;
pub use study::{
    Backend, Diff, DiffRequest, Outputs, Report, ReportOptions, RescoreRequest, Rescored, Results, Side, Study,
    StudyError, diff, resolve,
};

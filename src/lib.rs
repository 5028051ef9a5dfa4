//! mirrorstats scores episodes of embodied agents that must recognise themselves in a mirror.
//!
//! Steps of episodes come in as Parquet traces; every metric of the study comes out, exactly and
//! deterministically, as tables, cells and scores. Metrics are data: definition files that the
//! program checks, plans and evaluates.
//!
//! # Code map
//!
//! ```text
//!          trace ──────► score ───────► cells ───────► report
//!        (steps of      (one row        (exact         (tables, statistics,
//!         episodes)      per episode)    moments)       the folder)
//!                          ▲
//!                       metric
//!                 (definitions, checked)
//! ```
//!
//! | room | what it knows |
//! |---|---|
//! | [`cli`] | what was typed, standard output, exit codes |
//! | `record` | runs episodes: a world, an agent; a trace and a log (feature `sim`) |
//! | [`replay`] | a recorded episode again: re-simulated, as frames, as a film strip |
//! | [`agent`] | who decides the next action: scripted, a model behind a provider, a program |
//! | `sim` | the MuJoCo world: scene, bodies, eye, ground truth from rays (feature `sim`) |
//! | [`log`] | MCAP logs: in, out, and what can be saved of a cut one |
//! | [`report`] | styles, tables, statistics for people, the folder of a report |
//! | [`engine`] | other engines for the SQL lowering: Polars, Spark |
//! | [`cells`] | grouping, exact moments, intervals, tests |
//! | [`score`] | logical plan to physical plan to kernels over Arrow batches; the episode table |
//! | [`metric`] | definition files: TOML, SQL expressions, types, plans |
//! | [`trace`] | what an episode is: schema, writer, reader, validation |
//! | [`base`] | exact numbers to text, hashes, near names, files that are replaced |
//!
//! # Invariants
//!
//! - A room imports from the rooms below it alone; a test reads the `use` lines.
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
//! 1. a page: dictionary keys or bits, as runs and packed values (`trace::pages`)
//! 2. a key per row (one byte), a value per run, or bits (`trace::column`)
//! 3. a vector per step of the physical plan: truth values as bits ([`score::physical`], [`score::evaluate`])
//! 4. a value per episode: the vector of an aggregate or of a metric
//! 5. a column of the episode table, sorted once by a permutation ([`score::builder`], [`score::table`])
//! 6. exact moments of a cell ([`cells::moments`])
//! 7. a decimal, rounded once ([`base::number`])
//! 8. text ([`report`])
//!
//! # The main job
//!
//! ```
//! use std::num::NonZeroUsize;
//!
//! use mirrorstats::cells::group::group;
//! use mirrorstats::report::{layout, style::Style, tables::markdown};
//! use mirrorstats::score::score_traces::{self, Request};
//! use mirrorstats::trace::{inputs, open::TraceSet};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let files = inputs::resolve(&["fixtures/paper".to_owned()], std::io::empty())?;
//! let traces = TraceSet::open(&files)?;
//! let definitions = score_traces::definitions(&traces, &Request::of("paper"))?;
//! let episodes = score_traces::score(&traces, &definitions, &[], NonZeroUsize::MIN)?;
//! assert_eq!(episodes.len(), 840);
//!
//! let cells = group(&episodes, &["experiment".to_owned(), "model".to_owned()])?;
//! let tables = layout::tables(&cells, &Style::load("paper")?)?;
//! assert!(markdown::render(&tables[0]).contains("Claude Sonnet 4.6"));
//! # Ok(())
//! # }
//! ```
//!
//! # Your own metric
//!
//! ```
//! use mirrorstats::metric::definitions::Definitions;
//! use mirrorstats::score::score_traces::schema_columns;
//!
//! let definitions = Definitions::from_toml(
//!     "mine",
//!     r#"
//!     include = ["paper"]
//!     [metric.TURNS]
//!     title = "Turns before the decision"
//!     value = "count(action in ('turn_left', 'turn_right') and t < finish)"
//!     "#,
//!     &schema_columns(),
//! )
//! .unwrap();
//! assert!(definitions.explain("TURNS").unwrap().words.starts_with("the number of steps where"));
//! ```

pub mod agent;
pub mod base;
pub mod cells;
pub mod cli;
pub mod engine;
pub mod log;
pub mod metric;
#[cfg(feature = "sim")]
pub mod record;
pub mod replay;
pub mod report;
pub mod score;
#[cfg(feature = "sim")]
pub mod sim;
pub mod trace;

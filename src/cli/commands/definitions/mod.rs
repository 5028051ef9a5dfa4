//! `definitions`: check a definition file, explain a metric, list and show the built-in files.

pub mod sensitivity;
pub mod sql;

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::escape::visible;
use mirrorstats_metric::definitions::{Definitions, UnknownMetric};
use mirrorstats_metric::file::{FileError, built_in, built_in_names};
use mirrorstats_score::vocabulary;
use mirrorstats_toml_spec::FaultRecord;
use mirrorstats_trace::inputs;
use mirrorstats_trace::read::open::TraceSet;

/// Check, explain and show metrics, their SQL, their sensitivity
#[derive(Clone, Debug, clap::Subcommand)]
pub enum DefinitionsCommand {
    /// Show every fault of a definition file, underlined, with a suggestion
    Check {
        /// `paper`, `extended`, or a TOML file
        #[arg(value_name = "NAME|FILE")]
        file: PathBuf,
        /// Traces whose own columns the definitions may use
        #[arg(value_name = "TRACES")]
        traces: Vec<OsString>,
        /// Print the answer as JSON
        #[arg(long)]
        json: bool,
    },
    /// Explain in words how a metric is computed
    Explain {
        /// The metric's name
        #[arg(value_name = "METRIC")]
        metric: String,
        /// `paper`, `extended`, or a TOML file
        #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
        definitions: PathBuf,
        /// Print the answer as JSON
        #[arg(long)]
        json: bool,
    },
    /// Print a built-in definition file, to start your own from
    Show {
        /// `paper` or `extended`
        #[arg(value_name = "NAME", default_value = "paper")]
        name: String,
    },
    Sql(sql::SqlArgs),
    Sensitivity(sensitivity::SensitivityArgs),
}

/// The answer of `check` for a program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CheckAnswer {
    /// True if the definitions have no fault.
    pub ok: bool,
    /// The hash of the resolved definitions; null with faults.
    pub hash: Option<String>,
    /// The metrics; empty with faults.
    pub metrics: Vec<String>,
    /// Every fault.
    pub faults: Vec<FaultRecord>,
}

impl DefinitionsCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Check { file, traces, json } => check(&file, &traces, json),
            Self::Explain { metric, definitions, json } => explain(&metric, &definitions, json),
            Self::Show { name } => show(&name),
            Self::Sql(args) => args.run(),
            Self::Sensitivity(args) => args.run(),
        }
    }
}

fn check(file: &Path, traces: &[OsString], json: bool) -> Result<Outcome, Failure> {
    let columns = if traces.is_empty() {
        vocabulary::schema_columns()
    } else {
        let inputs = inputs::resolve(traces, io::stdin().lock())?;
        vocabulary::trace_columns(&TraceSet::open(&inputs)?)
    };
    match Definitions::load(file, &columns) {
        Ok(definitions) if json => {
            let catalog = definitions.catalog;
            let metrics = catalog.metric.keys().cloned().collect();
            output::print_json(&CheckAnswer { ok: true, hash: Some(catalog.hash), metrics, faults: vec![] })
        }
        Ok(definitions) => {
            let catalog = &definitions.catalog;
            let metrics: Vec<&str> = catalog.metric.keys().map(String::as_str).collect();
            output::plain(format!(
                "{}: no fault\n  {} metrics: {}\n  {} named expressions, {} experiments\n  sha256 {}\n",
                visible(&file.display().to_string()),
                metrics.len(),
                visible(&metrics.join(", ")),
                catalog.lets.len(),
                catalog.experiment.len(),
                catalog.hash
            ))
        }
        Err(FileError::Faults(faults)) if json => {
            output::print_json(&CheckAnswer { ok: false, hash: None, metrics: vec![], faults: faults.records() })?;
            Err(Failure::Faults(faults))
        }
        Err(error) => Err(error.into()),
    }
}

fn explain(metric: &str, definitions: &Path, json: bool) -> Result<Outcome, Failure> {
    let definitions = Definitions::load(definitions, &vocabulary::schema_columns())?;
    if let Some(explanation) = definitions.explain(metric) {
        return output::print(&explanation, json);
    }
    let known: Vec<String> = definitions.catalog.metric.keys().cloned().collect();
    Err(Failure::input(UnknownMetric::new(metric, &known)))
}

fn show(name: &str) -> Result<Outcome, Failure> {
    let Some(text) = built_in(name) else {
        let names = built_in_names().join(", ");
        return Err(Failure::input(format!("no built-in definitions `{name}`; there are {names}")));
    };
    output::plain(text)
}

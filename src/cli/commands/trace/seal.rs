//! `mirrorstats trace seal`: a copy with checksums.

use std::fmt;
use std::path::PathBuf;

use crate::cli::args::ThreadArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use exact::format::counted;
use trace::inputs::Input;
use trace::seal::{SealAnswer, SealError, seal};

/// Copy a trace with checksums, so that later damage is found
///
/// For traces of other writers, such as pyarrow and Polars. The trace is validated first, its columns are copied as they
/// are, and the copy is compared with them.
#[derive(Clone, Debug, clap::Args)]
pub struct SealArgs {
    /// The trace
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The copy
    #[arg(value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl SealArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let answer = seal(&Input::new(&self.input), &self.out, self.threads.count())?;
        output::print(&Shown(&answer), self.json)
    }
}

impl From<SealError> for Failure {
    fn from(error: SealError) -> Self {
        match error {
            SealError::Unwritable { path, source } => output::unwritable(&path, source),
            other => Self::input(other),
        }
    }
}

/// The answer as text.
#[derive(serde::Serialize)]
#[serde(transparent)]
struct Shown<'a>(&'a SealAnswer);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SealAnswer { name, out, episodes, steps, sha256, .. } = self.0;
        let (episodes, steps) = (counted(*episodes, "episode"), counted(*steps, "step"));
        writeln!(f, "{out}: {name} with checksums, {episodes}, {steps}; sha256 {sha256}")
    }
}

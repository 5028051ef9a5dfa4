//! `mirrorstats trace seal`: a copy with checksums.

use std::fmt::{self, Write as _};
use std::path::PathBuf;

use crate::cli::args::ThreadArgs;
use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::format::counted;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::write::seal::{SealAnswer, SealError, seal};

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
        let sealed = seal(&Input::new(&self.input), &self.out, self.threads.count());
        let answer = sealed.map_err(|error| match error {
            SealError::Unwritable { path, source } => output::unwritable(&path, source),
            other => other.into(),
        })?;
        output::print_with(&answer, self.json, write_answer)
    }
}

fn write_answer(text: &mut String, answer: &SealAnswer) -> fmt::Result {
    let SealAnswer { name, out, episodes, steps, sha256, .. } = answer;
    let (episodes, steps) = (counted(*episodes, "episode"), counted(*steps, "step"));
    writeln!(text, "{out}: {name} with checksums, {episodes}, {steps}; sha256 {sha256}")
}

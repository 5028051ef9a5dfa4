//! What was typed, where several verbs share it.

use std::num::NonZeroUsize;

/// The traces to read.
#[derive(Clone, Debug, clap::Args)]
pub struct TraceArgs {
    /// Trace files, folders of them, quoted globs, or `-` for a list of files on standard input
    #[arg(required = true, value_name = "TRACES")]
    pub traces: Vec<String>,
    /// How many threads to use.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// How many threads to use.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct ThreadArgs {
    /// Threads to use; results do not depend on it [default: all cores]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
}

impl ThreadArgs {
    /// The number asked for, or one a core.
    pub fn count(self) -> NonZeroUsize {
        self.threads.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN)
    }
}

//! Runs a frame on the streaming engine and reports errors in this program's words.

use std::io;

use polars::prelude::{DataFrame, Engine, LazyFrame, PolarsError as Inner};

use mirrorstats_trace::catch_panic::contained_on_all_threads;
use mirrorstats_trace::error::TraceError;

#[derive(Debug, thiserror::Error)]
pub enum PolarsError {
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{file}: expected a file that can be read; was it moved?")]
    Unreadable { file: String, source: io::Error },
    #[error("the reader of the answer is gone")]
    ReaderGone,
    #[error("Polars cannot do this: {0}")]
    Failed(String),
}

impl From<Inner> for PolarsError {
    fn from(error: Inner) -> Self {
        match &error {
            Inner::IO { error, .. } if error.kind() == io::ErrorKind::BrokenPipe => Self::ReaderGone,
            other => Self::Failed(cause(&other.to_string())),
        }
    }
}

impl PolarsError {
    #[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
    pub(super) fn panicked(words: String) -> Self {
        Self::Failed(cause(&words))
    }
}

pub(super) fn collect(frame: LazyFrame) -> Result<DataFrame, PolarsError> {
    let run = || frame.collect_with_engine(Engine::Streaming);
    Ok(contained_on_all_threads(run).map_err(PolarsError::panicked)??.unwrap_single())
}

/// The cause in a Polars message: its first paragraph, without the plan that may follow. For a panic on a Polars
/// thread: the panic's own message.
fn cause(message: &str) -> String {
    if message.contains("JoinError::Panic") {
        let mut parts = message.split(['"', '\\']).filter(|part| part.starts_with(char::is_alphabetic));
        let own = parts.rfind(|part| !part.contains("JoinError") && !part.contains("unwrap()"));
        return own.unwrap_or("it ended in a panic").to_owned();
    }
    let first = message.split("\n\n").find(|part| !part.trim().is_empty()).unwrap_or(message);
    first.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::cause;

    #[test]
    fn the_cause_comes_without_the_plan() {
        assert_eq!(
            cause("unable to find column \"x\";\nvalid: [\"y\"]\n\nResolved plan: ..."),
            "unable to find column \"x\"; valid: [\"y\"]"
        );
    }

    #[test]
    fn the_cause_of_a_panic_is_its_message() {
        let inner = r#"JoinError::Panic(Id(4), \"expected equal chunks\", ...)"#;
        let told = format!("called `Result::unwrap()` on an `Err` value: JoinError::Panic(Id(3), \"{inner}\", ...)");
        assert_eq!(cause(&told), "expected equal chunks");
        assert_eq!(cause("JoinError::Panic(Id(3), ...)"), "it ended in a panic");
    }
}

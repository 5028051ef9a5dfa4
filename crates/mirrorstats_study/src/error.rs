//! The error of a study: its cause, and the part of the request that the caller has to change.

use std::error::Error;
use std::io;

use mirrorstats_import::ImportError;
use mirrorstats_score::format::FormatError;
use mirrorstats_trace::error::TraceError;

/// An error of a study. The message gives the problem, the location, the expected and found values, and a remedy.
#[derive(Debug, thiserror::Error)]
#[error("{cause}")]
pub struct StudyError {
    /// The part of the request that the caller has to change.
    pub kind: ErrorKind,
    #[source]
    cause: Box<dyn Error + Send + Sync>,
}

/// The part of a request that the caller has to change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Traces, scores or reports.
    Input,
    /// Definitions or a style.
    Definitions,
    /// The name of a metric, column or table, a filter, or another argument.
    Argument,
    /// A query of steps, episodes or cells.
    Query,
    /// The place of the answer.
    Output,
}

impl StudyError {
    pub(crate) fn new(kind: ErrorKind, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self { kind, cause: cause.into() }
    }

    /// The cause, if it is of this type.
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        self.cause.downcast_ref()
    }

    /// The system's error if writing the answer failed, for example because the reader closed a pipe. Errors: this
    /// error, if it is any other.
    pub fn into_io(self) -> Result<io::Error, Self> {
        #[cfg(feature = "polars")]
        if let Some(mirrorstats_engines::polars::run::PolarsError::ReaderGone) = self.cause() {
            return Ok(io::ErrorKind::BrokenPipe.into());
        }
        let kind = self.kind;
        let cause = match self.cause.downcast::<FormatError>() {
            Ok(error) => return error.into_io().map_err(Self::from),
            Err(cause) => cause,
        };
        cause.downcast::<io::Error>().map_or_else(|cause| Err(Self { kind, cause }), |error| Ok(*error))
    }
}

impl From<ImportError> for StudyError {
    fn from(cause: ImportError) -> Self {
        let is_output = matches!(cause, ImportError::Trace(TraceError::Write { .. }));
        Self::new(if is_output { ErrorKind::Output } else { ErrorKind::Input }, cause)
    }
}

/// The kind of each cause that is always of one kind.
macro_rules! kinds {
    ($($kind:ident: $($cause:ty),+;)+) => { $($(
        impl From<$cause> for $crate::StudyError {
            fn from(cause: $cause) -> Self {
                Self::new($crate::ErrorKind::$kind, cause)
            }
        }
    )+)+ };
}

pub(crate) use kinds;

kinds! {
    Input:
        io::Error,
        mirrorstats_engines::spark::SparkError,
        mirrorstats_exact::budget::Exceeded,
        mirrorstats_exact::moments::MomentOverflow,
        mirrorstats_report::html::HtmlError,
        mirrorstats_report::published::PublishedError,
        mirrorstats_report::published::audit::AuditError,
        mirrorstats_report::published::comparison::ComparisonError,
        mirrorstats_score::error::ScoreError,
        FormatError,
        mirrorstats_score::tables::declared_experiments::DeclarationError,
        mirrorstats_score::tables::select::SelectError,
        mirrorstats_trace::beside::ListError,
        TraceError;
    Definitions:
        mirrorstats_metric::file::FileError,
        mirrorstats_report::style::StyleError,
        mirrorstats_toml_spec::Faults;
    Argument:
        mirrorstats_figures::FigureError,
        mirrorstats_metric::definitions::UnknownMetric,
        mirrorstats_score::cells::group::GroupError,
        mirrorstats_score::evidence::EvidenceError;
    Output:
        mirrorstats_exact::replace::TargetIsInput,
        mirrorstats_figures::EncodeError,
        mirrorstats_report::bundle::BundleError;
}

#[cfg(feature = "polars")]
kinds! {
    Query: mirrorstats_engines::polars::run::PolarsError;
}

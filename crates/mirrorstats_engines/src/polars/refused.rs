//! A query that cannot be answered: a mistake in it, or a construct that only DuckDB answers.

use std::sync::Arc;

use sqlparser::tokenizer::Span;

use super::run::PolarsError;
use mirrorstats_metric::syntax::grammar::bytes_of;
use mirrorstats_toml_spec::{Fault, Faults, Place, Source};

#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error(transparent)]
    Faults(#[from] Faults),
    /// The help is to be completed by the same query for DuckDB.
    #[error("{}", .0.message)]
    Unsupported(Box<Fault>),
    #[error(transparent)]
    Polars(#[from] PolarsError),
}

pub(super) type QueryResult<T> = Result<T, QueryError>;

pub(super) fn fault(source: &Arc<Source>, span: Span, message: impl Into<String>) -> Fault {
    Fault::new(Place { source: Arc::clone(source), span: bytes_of(&source.text, span) }, message)
}

pub(super) fn wrong(source: &Arc<Source>, span: Span, message: impl Into<String>, help: Option<String>) -> QueryError {
    QueryError::Faults(Faults(vec![fault(source, span, message).help_if(help)]))
}

pub(super) fn unsupported(source: &Arc<Source>, span: Span, what: impl std::fmt::Display) -> QueryError {
    QueryError::Unsupported(Box::new(fault(source, span, format!("`query` does not support {what}"))))
}

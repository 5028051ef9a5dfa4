//! A query that cannot be answered: a mistake in it, or a construct that only DuckDB answers.

use std::fmt::Display;
use std::sync::Arc;

use sqlparser::ast::Spanned;
use sqlparser::tokenizer::Span;

use super::run::PolarsError;
use super::value::Value;
use mirrorstats_metric::syntax::grammar::{bytes_of, shortened};
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

impl From<Fault> for QueryError {
    fn from(fault: Fault) -> Self {
        Self::Faults(Faults(vec![fault]))
    }
}

/// The text of a query, for errors at their places.
#[derive(Clone, Copy)]
pub(super) struct Text<'s>(pub(super) &'s Arc<Source>);

impl Text<'_> {
    pub(super) fn bytes(self, span: Span) -> std::ops::Range<usize> {
        bytes_of(&self.0.text, span)
    }

    pub(super) fn fault_at(self, span: std::ops::Range<usize>, message: impl Into<String>) -> Fault {
        Fault::new(Place { source: Arc::clone(self.0), span }, message)
    }

    pub(super) fn fault(self, span: Span, message: impl Into<String>) -> Fault {
        self.fault_at(self.bytes(span), message)
    }

    pub(super) fn unsupported<T>(self, span: Span, what: impl Display) -> QueryResult<T> {
        Err(QueryError::Unsupported(Box::new(self.fault(span, format!("`query` does not support {what}")))))
    }

    pub(super) fn refuse_at<T>(self, span: Span, sql: impl Display) -> QueryResult<T> {
        self.unsupported(span, format!("`{}`", shortened(&sql.to_string())))
    }

    pub(super) fn refuse<T>(self, sql: &(impl Display + Spanned)) -> QueryResult<T> {
        self.refuse_at(sql.span(), sql)
    }

    /// Refuses an operation on kinds that do not fit.
    pub(super) fn unfit<T>(self, sql: &(impl Display + Spanned), values: &[Value]) -> QueryResult<T> {
        let kinds = values.iter().map(|value| value.kind.sql()).collect::<Vec<_>>().join(", ");
        self.unsupported(sql.span(), format!("`{}` of {kinds}", shortened(&sql.to_string())))
    }
}

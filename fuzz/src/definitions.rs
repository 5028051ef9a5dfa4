//! Definitions, from their text to values and to every dialect of SQL.

use std::num::NonZeroUsize;
use std::sync::LazyLock;

use mirrorstats_metric::columns::Columns;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::sql::{self, Dialect};
use mirrorstats_score::score_traces;
use mirrorstats_score::vocabulary;

use crate::depth::reached;
use crate::episodes;

static COLUMNS: LazyLock<Columns> = LazyLock::new(|| vocabulary::trace_columns(episodes::open()));

/// A definition file: it is refused, or its catalog restores the same definitions. Every dialect lowers them or says
/// why not. A metric computed alone has the same values as among all metrics.
pub fn target(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    // The input has no other files to include.
    if text.contains("include") {
        return;
    }
    let definitions = match Definitions::from_toml("fuzzed", text, &COLUMNS) {
        Ok(definitions) => definitions,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    reached("bound");
    for dialect in [Dialect::Portable, Dialect::Spark, Dialect::Duckdb] {
        let first = sql::lower(&definitions.plan, dialect);
        assert_eq!(first, sql::lower(&definitions.plan, dialect), "two statements of one plan");
    }
    for output in &definitions.plan.outputs {
        assert!(definitions.explain(&output.name).is_some(), "{} is not explained", output.name);
    }
    // Columns that the text declares are those of the traces when a catalog is restored.
    if definitions.declared_columns().next().is_some() {
        return;
    }
    let restored = Definitions::of_catalog(&definitions.catalog, &COLUMNS).expect("a catalog is its definitions");
    assert_eq!(restored.catalog, definitions.catalog);
    values(&definitions, &restored);
}

fn values(definitions: &Definitions, restored: &Definitions) {
    let score = |definitions: &Definitions| score_traces::score(episodes::open(), definitions, &[], NonZeroUsize::MIN);
    let Ok(all) = score(definitions) else {
        assert!(score(restored).is_err(), "definitions that were restored give values where the others give none");
        return;
    };
    reached("values");
    assert_eq!(score(restored).expect("the same definitions").metrics, all.metrics);
    for metric in all.metrics.iter().take(6) {
        let mut one = definitions.clone();
        one.select(std::slice::from_ref(&metric.name)).expect("a metric of these");
        let alone = score(&one).expect("a part of what was computed");
        assert_eq!(&alone.metrics[0], metric, "alone, and among all");
    }
}

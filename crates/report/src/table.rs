//! The one table model: what every format of a table prints.
//!
//! Rule: all decisions are taken here already (columns, order, rounding, emphasis, marks); a format only spells
//! them. Names from traces are raw text until a format escapes them.

use crate::cells::KeyValue;
use crate::style::CellForm;
use exact::moments::Moments;
use exact::number::Decimal;
use metric::catalog::Better;

/// A table ready to be spelled out.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// `main`, `appendix`, ...: the name of its files.
    pub name: String,
    /// The first words of its caption.
    pub title: String,
    /// The sentences after them.
    pub note: String,
    /// Sentences that its cells call for, such as what the dagger means.
    pub footnotes: Vec<String>,
    /// The LaTeX label.
    pub label: Option<String>,
    /// What stands where a value is undefined.
    pub undefined: String,
    /// What its cells show.
    pub form: CellForm,
    /// The key columns of a row, as the episodes were grouped.
    pub keys: Vec<String>,
    /// What a row is: `Model`.
    pub row_heading: String,
    /// One column per metric.
    pub columns: Vec<Column>,
    /// The rows, in groups that are headed together and compete together.
    pub groups: Vec<RowGroup>,
}

/// The column of a metric.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The metric's name.
    pub metric: String,
    /// The header as LaTeX, where the escaped name will not do.
    pub latex: Option<String>,
    /// Which way the arrow points.
    pub better: Better,
}

/// Rows under one heading.
#[derive(Clone, Debug, PartialEq)]
pub struct RowGroup {
    /// `E1: Active mirror-based self-identification`; none where all rows are of one group.
    pub heading: Option<String>,
    /// The rows in order.
    pub rows: Vec<Row>,
}

/// The cells of one key.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// A value for each of [`Table::keys`].
    pub key: Vec<KeyValue>,
    /// The row's name within its group.
    pub name: String,
    /// One cell per column.
    pub cells: Vec<Cell>,
}

/// One metric of one row.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// What it shows.
    pub value: Value,
    /// How it stands out.
    pub emphasis: Emphasis,
    /// Whether it rests on so few episodes that a dagger says so.
    pub is_marked: bool,
    /// All episodes of the row, defined or not.
    pub episodes: u64,
    /// The episodes where the metric is defined.
    pub n: u64,
    /// The sum of the metric's values.
    pub sum: i128,
}

/// What a cell shows, rounded already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// Nothing is known.
    Undefined,
    /// A mean and its standard error, where there is one.
    MeanSe {
        /// The mean.
        mean: Decimal,
        /// The standard error of the mean.
        se: Option<Decimal>,
    },
    /// A rate as a count.
    Count {
        /// Episodes where the metric holds.
        count: i128,
        /// Episodes where it is defined.
        n: u64,
        /// The rate.
        mean: Decimal,
        /// Its Wilson interval.
        spread: Spread,
    },
    /// The mean of a quantity.
    Mean {
        /// The mean.
        mean: Decimal,
        /// Its Student interval.
        spread: Spread,
        /// The episodes where it is defined, if those are not all, or if it is a single one.
        n: Option<u64>,
    },
}

/// How far the truth may lie from the mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spread {
    /// Not to be said: too few values.
    Unknown,
    /// All values are equal, which is no evidence of certainty.
    AllEqual,
    /// A 95 % interval.
    Interval {
        /// The lower bound.
        low: Decimal,
        /// The upper bound.
        high: Decimal,
    },
}

/// How a cell stands out in its group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Emphasis {
    /// Not at all.
    #[default]
    Plain,
    /// The best.
    Bold,
    /// The next after the best.
    Underline,
}

/// The sign that marks a cell of few episodes.
pub const DAGGER: char = '†';

impl Table {
    /// Caption without markup: note and footnotes.
    pub fn sentences(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.note.as_str()).chain(self.footnotes.iter().map(String::as_str)).filter(|s| !s.is_empty())
    }
}

impl Cell {
    /// A cell of these moments in a row of `episodes` episodes, without emphasis or mark.
    pub fn plain(value: Value, moments: &Moments, episodes: u64) -> Self {
        Self { value, emphasis: Emphasis::Plain, is_marked: false, episodes, n: moments.n, sum: moments.sum }
    }
}

impl Emphasis {
    /// The word for it in CSV files; empty for none.
    pub fn word(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Bold => "bold",
            Self::Underline => "underline",
        }
    }
}

impl Value {
    /// The part that is the estimate, and the part that says how sure it is, as plain text.
    pub fn parts(&self, undefined: &str) -> (String, Option<String>) {
        match self {
            Self::Undefined => (undefined.to_owned(), None),
            Self::MeanSe { mean, se } => (mean.to_string(), se.map(|se| format!("± {se}"))),
            Self::Count { count, n, spread, .. } => (format!("{count}/{n}"), spread.text(Decimal::compact)),
            Self::Mean { mean, spread, n } => {
                let of = n.map(|n| format!("n={n}"));
                let parts: Vec<String> = spread.text(|bound| bound.to_string()).into_iter().chain(of).collect();
                (mean.to_string(), (!parts.is_empty()).then(|| parts.join(" ")))
            }
        }
    }

    /// The mean as printed, or as it would be.
    pub fn mean(&self) -> Option<Decimal> {
        match self {
            Self::Undefined => None,
            Self::MeanSe { mean, .. } | Self::Count { mean, .. } | Self::Mean { mean, .. } => Some(*mean),
        }
    }
}

impl Spread {
    fn text(self, bound: impl Fn(Decimal) -> String) -> Option<String> {
        match self {
            Self::Unknown => None,
            Self::AllEqual => Some("(all equal)".to_owned()),
            Self::Interval { low, high } => Some(format!("[{}, {}]", bound(low), bound(high))),
        }
    }
}

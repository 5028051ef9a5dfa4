//! The episode table: one row per episode, its keys and one integer per metric, in Arrow columns.

use std::fmt;
use std::ops::Range;

use arrow::array::{
    Array, ArrayRef, AsArray as _, BooleanArray, Int32Array, Int64Array, LargeStringArray, UInt32Array,
};
use arrow::compute::take;

use mirrorstats_exact::moments::{MomentOverflow, Moments};
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::Catalog;
pub use mirrorstats_trace::footers::declared::Declared;
use mirrorstats_trace::schema::{self, Column};

/// Scores of some episodes, ordered by experiment, model, seed, run, `episode_id` (bytes and integers, ascending).
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodeTable {
    /// The definitions that gave the values.
    pub catalog: Catalog,
    /// The keys, one row per episode.
    pub keys: EpisodeKeys,
    /// Further columns that are constant in an episode (`body_color`, ...), if requested.
    pub labels: Vec<LabelColumn>,
    /// The metrics in the order of the catalog, or of the selection.
    pub metrics: Vec<MetricColumn>,
    /// The declarations of the traces about their recording.
    pub declared: Declared,
}

#[derive(Clone, Debug)]
pub struct EpisodeKeys {
    pub experiment: TextColumn,
    pub model: TextColumn,
    pub(crate) seed: Int32Array,
    pub(crate) run: Int32Array,
    pub episode_id: TextColumn,
}

/// The label of the factor that a study varies besides the model.
pub const CONDITION: &str = "condition";

/// The label of episodes that were lost because no answer came.
pub const LOST: &str = "lost";

/// The label of an episode's [`UnusableCount`].
pub const UNUSABLE_REPLIES: &str = "unusable_replies";

/// The replies of an episode: those without a decision, and all. As a label, and in score files: `3/20`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnusableCount {
    pub unusable: u64,
    pub replies: u64,
}

impl fmt::Display for UnusableCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.unusable, self.replies)
    }
}

impl UnusableCount {
    pub fn add(&mut self, other: Self) {
        self.unusable = self.unusable.saturating_add(other.unusable);
        self.replies = self.replies.saturating_add(other.replies);
    }

    /// The count that a label spells; `None` for any other text.
    pub fn of_label(label: &str) -> Option<Self> {
        let (unusable, replies) = label.split_once('/')?;
        Some(Self { unusable: unusable.parse().ok()?, replies: replies.parse().ok()? })
    }
}

/// The key of an episode. The derived order is the order of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EpisodeKey<T = String> {
    /// `E1`..`E5` in the paper.
    pub experiment: T,
    /// The model's name in tables.
    pub model: T,
    /// The seed of the block of runs.
    pub seed: i32,
    /// The run within the seed.
    pub run: i32,
    /// Unique in a report.
    pub episode_id: T,
}

pub type KeyRef<'a> = EpisodeKey<&'a str>;

/// A text column: a code per row, null without text, and the text of each code.
#[derive(Clone, Debug)]
pub struct TextColumn {
    pub(crate) codes: UInt32Array,
    pub(crate) texts: LargeStringArray,
}

/// A further key column: text, null if the trace has null.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelColumn {
    pub name: String,
    pub values: TextColumn,
}

/// The values of one metric, null if undefined.
#[derive(Clone, Debug)]
pub struct MetricColumn {
    /// The metric's name in the catalog.
    pub name: String,
    pub(crate) values: MetricValues,
}

#[derive(Clone, Debug)]
pub(crate) enum MetricValues {
    /// Truth values, for 0 and 1.
    Bools(BooleanArray),
    Ints(Int64Array),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    pub catalog: Catalog,
    pub labels: Vec<String>,
    pub metrics: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    #[error("expected scores under one set of definitions, found `{0}` and another `{1}`; score the traces again")]
    Definitions(String, String),
    #[error("expected the columns {0}, found {1}")]
    Columns(String, String),
    #[error("the episode `{0}` is in two files of scores; leave one out")]
    Episode(String),
}

impl EpisodeTable {
    /// The names of the columns.
    pub fn header(&self) -> Header {
        Header {
            catalog: self.catalog.clone(),
            labels: self.labels.iter().map(|label| label.name.clone()).collect(),
            metrics: self.metrics.iter().map(|metric| metric.name.clone()).collect(),
        }
    }

    /// Returns true if the episode was lost: the label [`LOST`] says so.
    pub fn is_lost(&self, row: usize) -> bool {
        self.label(LOST).is_some_and(|label| label.get(row) == Some("true"))
    }

    /// Returns true if any episode was recorded under a condition other than the default.
    pub fn has_conditions(&self) -> bool {
        let default = default_text(CONDITION);
        self.label(CONDITION).is_some_and(|column| column.iter().flatten().any(|condition| Some(condition) != default))
    }

    /// The further key column of this name, if the table has it.
    pub fn label(&self, name: &str) -> Option<&TextColumn> {
        self.labels.iter().find(|label| label.name == name).map(|label| &label.values)
    }

    /// A value in the metric's unit, exactly; `None` if the metric is undefined.
    pub fn decimal(&self, column: &MetricColumn, row: usize) -> Option<Decimal> {
        let digits = self.catalog.metric.get(&column.name).map_or(0, |metric| metric.decimals);
        Some(Decimal::of_units(column.get(row)?.into(), digits.into()))
    }

    /// The metric of this name, if the table has it.
    pub fn metric(&self, name: &str) -> Option<&MetricColumn> {
        self.metrics.iter().find(|metric| metric.name == name)
    }

    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Returns true if there are no episodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The rows at these positions, in this order.
    #[must_use]
    pub fn taken(&self, rows: &[usize]) -> Self {
        let rows: UInt32Array = rows.iter().map(|row| narrow(*row)).collect::<Vec<_>>().into();
        let label = |label: &LabelColumn| LabelColumn { name: label.name.clone(), values: label.values.taken(&rows) };
        Self {
            catalog: self.catalog.clone(),
            keys: self.keys.taken(&rows),
            labels: self.labels.iter().map(label).collect(),
            metrics: self.metrics.iter().map(|metric| metric.taken(&rows)).collect(),
            declared: self.declared.clone(),
        }
    }
}

/// The meaning of a missing value of a column of the schema.
pub(crate) fn default_text(name: &str) -> Option<&'static str> {
    schema::column(name).and_then(Column::default_text)
}

pub(crate) fn narrow(row: usize) -> u32 {
    u32::try_from(row).expect("2^32 episodes do not fit into memory")
}

impl EpisodeKeys {
    pub fn len(&self) -> usize {
        self.seed.len()
    }

    /// Returns true if there are no episodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn get(&self, row: usize) -> KeyRef<'_> {
        KeyRef {
            experiment: self.experiment.get(row).unwrap_or_default(),
            model: self.model.get(row).unwrap_or_default(),
            seed: self.seed.value(row),
            run: self.run.value(row),
            episode_id: self.episode_id.get(row).unwrap_or_default(),
        }
    }

    /// Returns true if other columns have the same key in each row. May return false if keys are encoded differently.
    pub fn has_keys_of(&self, other: &Self) -> bool {
        let is_same = |a: &TextColumn, b: &TextColumn| a.codes == b.codes && a.texts == b.texts;
        self.seed == other.seed
            && self.run == other.run
            && is_same(&self.experiment, &other.experiment)
            && is_same(&self.model, &other.model)
            && is_same(&self.episode_id, &other.episode_id)
    }

    pub fn seed(&self, row: usize) -> i32 {
        self.seed.value(row)
    }

    pub fn run(&self, row: usize) -> i32 {
        self.run.value(row)
    }

    pub fn iter(&self) -> impl ExactSizeIterator<Item = KeyRef<'_>> + Clone {
        (0..self.len()).map(|row| self.get(row))
    }

    pub(crate) fn taken(&self, rows: &UInt32Array) -> Self {
        let ints = |column: &Int32Array| taken(column, rows).as_primitive().clone();
        Self {
            experiment: self.experiment.taken(rows),
            model: self.model.taken(rows),
            seed: ints(&self.seed),
            run: ints(&self.run),
            episode_id: self.episode_id.taken(rows),
        }
    }
}

pub(crate) fn taken(column: &dyn Array, rows: &UInt32Array) -> ArrayRef {
    take(column, rows, None).expect("the rows are those of the column")
}

impl PartialEq for EpisodeKeys {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl KeyRef<'_> {
    pub fn to_owned(&self) -> EpisodeKey {
        EpisodeKey {
            experiment: self.experiment.to_owned(),
            model: self.model.to_owned(),
            seed: self.seed,
            run: self.run,
            episode_id: self.episode_id.to_owned(),
        }
    }
}

impl EpisodeKey {
    pub fn as_ref(&self) -> KeyRef<'_> {
        let Self { experiment, model, seed, run, episode_id } = self;
        KeyRef { experiment, model, seed: *seed, run: *run, episode_id }
    }
}

impl TextColumn {
    /// The text of a row; `None` for null.
    pub fn get(&self, row: usize) -> Option<&str> {
        self.codes.is_valid(row).then(|| self.texts.value(self.codes.value(row) as usize))
    }

    /// A number that represents the text of a row; `None` for null. Equal texts have equal numbers, except episode ids:
    /// each row has its own.
    pub fn code(&self, row: usize) -> Option<usize> {
        self.codes.is_valid(row).then(|| self.codes.value(row) as usize)
    }

    pub(crate) fn longest(&self) -> usize {
        let offsets = self.texts.value_offsets().windows(2);
        let longest = offsets.map(|ends| ends[1] - ends[0]).max().unwrap_or_default();
        usize::try_from(longest).unwrap_or_default()
    }

    pub fn iter(&self) -> impl Iterator<Item = Option<&str>> {
        (0..self.codes.len()).map(|row| self.get(row))
    }

    pub(crate) fn taken(&self, rows: &UInt32Array) -> Self {
        Self { codes: taken(&self.codes, rows).as_primitive().clone(), texts: self.texts.clone() }
    }
}

impl PartialEq for TextColumn {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl MetricColumn {
    /// A column of these values.
    pub fn new(name: impl Into<String>, values: impl IntoIterator<Item = Option<i64>>) -> Self {
        Self { name: name.into(), values: MetricValues::Ints(values.into_iter().collect()) }
    }

    /// The value of a row; `None` if the metric is undefined. Panics if the row does not exist.
    pub fn get(&self, row: usize) -> Option<i64> {
        match &self.values {
            MetricValues::Bools(bools) => bools.is_valid(row).then(|| bools.value(row).into()),
            MetricValues::Ints(ints) => ints.is_valid(row).then(|| ints.value(row)),
        }
    }

    /// The values of all rows.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Option<i64>> + Clone {
        (0..self.array().len()).map(|row| self.get(row))
    }

    /// Returns true if another column has the same values. May return false if they are encoded differently.
    pub fn has_values_of(&self, other: &Self) -> bool {
        match (&self.values, &other.values) {
            (MetricValues::Bools(a), MetricValues::Bools(b)) => a == b,
            (MetricValues::Ints(a), MetricValues::Ints(b)) => a == b,
            _ => false,
        }
    }

    /// Adds the defined values of some rows to `moments`. Errors: a sum beyond 128 bits. Panics if a row is out of
    /// range.
    pub fn add_moments(&self, moments: Moments, rows: Range<usize>) -> Result<Moments, MomentOverflow> {
        match &self.values {
            // For a few rows, single values are faster than a slice of bits.
            MetricValues::Bools(bools) if rows.len() >= 16 => {
                let some = bools.slice(rows.start, rows.len());
                moments.with_truths(some.false_count(), some.true_count())
            }
            _ => rows.filter_map(|row| self.get(row)).try_fold(moments, Moments::with),
        }
    }

    pub(crate) fn array(&self) -> &dyn Array {
        match &self.values {
            MetricValues::Bools(bools) => bools,
            MetricValues::Ints(ints) => ints,
        }
    }

    pub(crate) fn taken(&self, rows: &UInt32Array) -> Self {
        let values = taken(self.array(), rows);
        let values = match &self.values {
            MetricValues::Bools(_) => MetricValues::Bools(values.as_boolean().clone()),
            MetricValues::Ints(_) => MetricValues::Ints(values.as_primitive().clone()),
        };
        Self { name: self.name.clone(), values }
    }
}

impl PartialEq for MetricColumn {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.iter().eq(other.iter())
    }
}

//! Scans traces for scoring: one streaming pass over the requested columns, with checks on the way.
//!
//! Rule: `work` gets complete episodes that keep every rule of the schema in the columns read. The first fault by file,
//! row group and row ends the scan; it is the same for any number of threads.

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::Arc;

use arrow::array::{
    Array as _, ArrayRef, AsArray as _, BooleanArray, RecordBatch, RecordBatchOptions, StringArray, UInt8Array,
};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Schema};
use arrow::error::ArrowError;

use super::beside::labels::Labels;
use super::error::TraceError;
use super::read::open::TraceSet;
use super::read::parallel_scan::{Episodes, ScanEvent, pass};
use super::read::projection::Layout;
use super::read::row_hashes;
use super::schema::DeclaredColumn;
use super::validate::color_set::{Spellings, other_names};
use super::validate::duplicate_ids::{IdHashes, hashes};
use super::validate::episode_hashes;
use super::validate::rules::Rules;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Projection {
    pub steps: Vec<String>,
    /// Columns with one value per step, taken unchanged: the schema's rules about values do not apply.
    pub unchecked: Vec<String>,
    /// Columns with one value per episode, besides [`EPISODE_COLUMNS`]; checked to be constant in each. Labels come
    /// from beside the traces.
    pub constants: Vec<String>,
    pub declared: Vec<DeclaredColumn>,
    /// The known experiments; an episode of another one is a fault. Any if `None`.
    pub experiments: Option<Vec<String>>,
    pub row_hashes: bool,
    /// True to leave the timesteps unread and unchecked.
    pub without_t: bool,
}

impl Projection {
    fn step_columns(&self) -> impl Iterator<Item = &str> {
        self.steps.iter().chain(&self.unchecked).map(String::as_str)
    }
}

/// The first columns of [`EpisodeBatch::episodes`].
pub const EPISODE_COLUMNS: [&str; 5] = ["episode_id", "model", "experiment", "seed", "run"];

/// Some complete episodes of one file.
///
/// Columns have one of four types, whatever the file stores: bool, `Int64`, `Float64`, and text. Text has the type
/// `Dictionary(Int32, Utf8)` or, with few distinct texts, [`Texts`]. A dictionary may hold unused values, and a value
/// under two keys. A column that the file does not have is all null.
#[derive(Clone, Debug)]
pub struct EpisodeBatch {
    /// The rows of episode `i` in `steps` are `offsets[i]..offsets[i + 1]`, with the timesteps 1, 2, ... in order.
    pub offsets: Vec<usize>,
    /// One row per step: the columns of [`Projection::steps`] and [`Projection::unchecked`], except those in `texts`.
    pub steps: RecordBatch,
    /// Some columns of [`Projection::steps`] and [`Projection::unchecked`].
    pub texts: Vec<Texts>,
    /// One row per episode: [`EPISODE_COLUMNS`], then the columns of [`Projection::constants`], those of labels last.
    pub episodes: RecordBatch,
    pub origin: RowOrigin,
    /// One number per episode, if asked for: equal for equal rows in the columns read, without the id.
    pub row_hashes: Option<Vec<u64>>,
}

/// A column of steps with few distinct texts, one byte per row.
///
/// An Arrow dictionary would be equivalent, but making one means reading each key once more.
#[derive(Clone, Debug)]
pub struct Texts {
    pub name: String,
    /// One key per row, the index of its text; null for null.
    pub keys: UInt8Array,
    /// The texts, never null.
    pub texts: StringArray,
}

impl Texts {
    #[must_use]
    pub fn slice(&self, start: usize, length: usize) -> Self {
        Self { keys: self.keys.slice(start, length), ..self.clone() }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RowOrigin {
    /// The file's position in [`TraceSet::files`].
    pub file: usize,
    pub row_group: usize,
    pub row: usize,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScanSummary {
    pub episodes: u64,
    pub steps: u64,
}

impl TraceSet {
    /// Reads all episodes once, `threads` row groups at a time, and passes the results of `work` to `sink` in the order
    /// of files and rows.
    pub fn scan<T: Send, E: Send + From<TraceError>>(
        &self,
        projection: &Projection,
        threads: NonZeroUsize,
        work: impl Fn(EpisodeBatch) -> Result<T, E> + Sync,
        mut sink: impl FnMut(T) -> Result<(), E>,
    ) -> Result<ScanSummary, E> {
        let (labels, constants): (Vec<&str>, Vec<&str>) =
            projection.constants.iter().map(String::as_str).partition(|name| self.is_label_column(name));
        let read = || EPISODE_COLUMNS.into_iter().chain(constants.iter().copied());
        let mut layout = Layout::new(self, projection.step_columns(), read())?;
        layout.with_declared(&projection.declared);
        if projection.without_t {
            layout.without_steps();
        }
        for column in layout.columns.iter_mut().filter(|column| projection.unchecked.contains(&column.name)) {
            column.known = None;
        }
        let rules = Rules { layout: &layout, experiments: projection.experiments.as_deref() };
        let shape = Shape {
            layout: &layout,
            labels: (self.labels(), labels),
            steps: projection.step_columns().filter_map(|name| layout.position(name)).collect(),
            episodes: read().filter_map(|name| layout.position(name)).collect(),
        };
        let whole = |episodes: Episodes| -> Result<EpisodeBatch, TraceError> {
            let row_hashes = projection.row_hashes.then(|| row_hashes::of_episodes(&layout, &episodes));
            Ok(EpisodeBatch { row_hashes, ..shape.batch(episodes)? })
        };
        let mut id_hashes = IdHashes::default();
        let mut spellings = Spellings::new(self.files());
        let mut summary = ScanSummary::default();
        let checked = |episodes: Episodes| {
            let file = &self.files()[episodes.file];
            let mut faults = rules.check(file, &episodes);
            faults.extend(episode_hashes::check(file, &layout, &episodes));
            let fault = faults.into_iter().min_by_key(|fault| fault.row);
            let ids = hashes(&episodes, fault.as_ref().map_or(usize::MAX, |fault| fault.row));
            let rows = (episodes.len() as u64, episodes.columns[0].len() as u64);
            let colors = other_names(&layout, &episodes);
            let result = match fault {
                Some(fault) => Err(TraceError::from(fault.finding).into()),
                None => whole(episodes).map_err(E::from).and_then(&work),
            };
            (ids, colors, rows, result)
        };
        let passed = pass(self.files(), &layout, threads, &checked, |_, event| {
            let (ids, colors, (episodes, steps), result) = match event {
                ScanEvent::Whole(checked) => checked,
                ScanEvent::Fault(finding) => return Err(TraceError::from(finding).into()),
            };
            id_hashes.add(&ids);
            spellings.add(colors);
            summary.episodes += episodes;
            summary.steps += steps;
            sink(result?)
        });
        // A repeated id is found only at the end, though it precedes the event that ended the pass.
        id_hashes.check(self.files(), &layout)?;
        passed?;
        // Two spellings of one colour are found only when all names are known.
        spellings.check(self.files(), &layout, threads)?;
        Ok(summary)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EpisodePlace {
    pub file: usize,
    /// Its rows, counted from the start of the file.
    pub rows: Range<usize>,
}

/// The location of each episode, by id: one pass over the columns that distinguish episodes.
pub fn episode_places(traces: &TraceSet, threads: NonZeroUsize) -> Result<HashMap<String, EpisodePlace>, TraceError> {
    let mut places = HashMap::new();
    let work = |batch: EpisodeBatch| -> Result<Vec<(String, EpisodePlace)>, TraceError> {
        let RowOrigin { file, row_group, row } = batch.origin;
        let before: usize = (0..row_group).map(|group| traces.files()[file].row_group_rows(group)).sum();
        let start = before + row;
        let ids = batch.episodes.column_by_name("episode_id").expect("every batch names its episodes");
        let ids = cast(ids, &DataType::Utf8).map_err(TraceError::Memory)?;
        let ids = ids.as_string::<i32>();
        let ends = batch.offsets.windows(2).map(|pair| start + pair[0]..start + pair[1]);
        Ok(ends.enumerate().map(|(at, rows)| (ids.value(at).to_owned(), EpisodePlace { file, rows })).collect())
    };
    traces.scan(&Projection::default(), threads, work, |found| {
        places.extend(found);
        Ok(())
    })?;
    Ok(places)
}

struct Shape<'a> {
    layout: &'a Layout,
    labels: (&'a Labels, Vec<&'a str>),
    steps: Vec<usize>,
    episodes: Vec<usize>,
}

impl Shape<'_> {
    fn batch(&self, episodes: Episodes) -> Result<EpisodeBatch, TraceError> {
        let rows = episodes.columns[0].len();
        let firsts = &episodes.offsets[..episodes.len()];
        let (mut texts, mut others) = (Vec::new(), Vec::new());
        for &place in &self.steps {
            match episodes.columns[place].byte_texts() {
                Some((keys, values)) => {
                    let name = self.layout.columns[place].name.clone();
                    texts.push(Texts { name, keys: keys.clone(), texts: values.clone() });
                }
                None => others.push(place),
            }
        }
        let steps = batch(self.columns(&others, |place| episodes.columns[place].flat())?, rows)?;
        let mut constants = self.columns(&self.episodes, |place| episodes.columns[place].at(firsts))?;
        let (labels, names) = &self.labels;
        for name in names {
            let values: BooleanArray = episodes.ids(firsts).map(|id| labels.value(name, id?)).collect();
            constants.push((Field::new(*name, DataType::Boolean, true), Arc::new(values)));
        }
        let constants = batch(constants, episodes.len())?;
        let first = episodes.pieces[0];
        let origin = RowOrigin { file: episodes.file, row_group: first.row_group, row: first.row };
        Ok(EpisodeBatch { offsets: episodes.offsets, steps, texts, episodes: constants, origin, row_hashes: None })
    }

    fn columns(
        &self,
        places: &[usize],
        values: impl Fn(usize) -> Result<ArrayRef, ArrowError>,
    ) -> Result<Vec<(Field, ArrayRef)>, TraceError> {
        let column = |place: &usize| {
            let (column, values) = (&self.layout.columns[*place], values(*place).map_err(TraceError::Memory)?);
            let nullable = column.known.is_none_or(|known| known.nullable || known.is_of_some_tasks);
            Ok((Field::new(&column.name, values.data_type().clone(), nullable), values))
        };
        places.iter().map(column).collect()
    }
}

fn batch(columns: Vec<(Field, ArrayRef)>, rows: usize) -> Result<RecordBatch, TraceError> {
    let (fields, values): (Vec<Field>, Vec<ArrayRef>) = columns.into_iter().unzip();
    let options = RecordBatchOptions::new().with_row_count(Some(rows));
    RecordBatch::try_new_with_options(Arc::new(Schema::new(fields)), values, &options).map_err(TraceError::Memory)
}

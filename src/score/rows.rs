//! Rows of the episode table on their way from the order of the files into the order of the table.
//!
//! Rule: a row is bytes that compare as its key does, so that sorting knows no column. Rows beyond a fixed amount of
//! memory are put away as sorted runs ([`crate::base::runs`]); how many there are changes nothing but the time.
//!
//! ```text
//! title    experiment 00 00  model 00 00
//! record   seed  run  episode_id 00 00  labels  metrics
//! ```
//!
//! [`super::row_bytes`] spells texts, integers and metrics. Few bytes of a trace can be many here, as a dictionary holds a
//! text once and rows hold it each: a batch is made into rows in [`Parts`].

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io;

use arrow::array::{
    Array, ArrayAccessor as _, ArrayRef, AsArray as _, Int64Array, RecordBatch, StringArray, TypedDictionaryArray,
};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type};

use super::engine::Scores;
use super::row_bytes::{Bytes, Metrics, put_label, put_text};
use super::table::{EpisodeKey, EpisodeRow, Header};
use crate::base::runs::{self, Merge, Place, Run, Runs, Section};
use crate::trace::scan::EPISODE_COLUMNS;

/// Bytes of rows that are held in memory before they are put away.
const MEMORY: usize = 17 << 20;

/// Bytes of rows that are sorted at a time.
const SORTED: usize = 1 << 20;

/// What a row takes, about.
const USUAL_BYTES: usize = 64;

/// Bytes of the rows of one batch that are held at a time.
const PART: usize = 16 << 20;

/// The bytes that a row or a title must stay below: their lengths are numbers of 31 bits where they are put away.
const TOO_LARGE: usize = 1 << 31;

/// Some rows as bytes.
#[derive(Debug, Default)]
pub struct Rows {
    bytes: Vec<u8>,
    /// The rows of each title, in the order of their coming.
    titled: Vec<(Vec<u8>, Vec<Record>)>,
}

/// A row among the bytes.
#[derive(Clone, Copy, Debug)]
struct Record {
    place: Place,
    /// The bytes of its seed and run, which decide most comparisons.
    numbers: u64,
}

/// A row with so long names that it cannot be sorted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "an episode of the model `{model}`: expected names and labels of less than 2 GiB, found more; group by other columns"
)]
pub struct RowTooLarge {
    /// The beginning of the model's name.
    pub model: String,
}

impl Rows {
    /// The scores of the episodes of one batch, from the one at `from` among those kept: as many as take `most` bytes,
    /// and one at least. Comes with the place of the next one.
    ///
    /// # Errors
    /// Names and labels of 2 GiB.
    pub fn of(
        episodes: &RecordBatch,
        scores: &Scores,
        labels: &[String],
        from: usize,
        most: usize,
    ) -> Result<(Self, usize), RowTooLarge> {
        let keys = KeyColumns::of(episodes);
        let column = |name: &String| episodes.column_by_name(name).expect("the projection asks for this column");
        let labels: Vec<&ArrayRef> = labels.iter().map(column).collect();
        let metrics = Metrics::of(&scores.metrics, scores.kept.len());
        let most = most.min(PART);
        let mut bytes = Vec::with_capacity(most.min((scores.kept.len() - from) * USUAL_BYTES));
        let mut titled: Vec<(Vec<u8>, Vec<Record>)> = Vec::new();
        let mut known: HashMap<[Option<i32>; 2], usize> = HashMap::new();
        let mut next = from;
        // Experiment and model seldom change from row to row.
        while let Some(&first) = scores.kept.get(next).filter(|_| next == from || bytes.len() < most) {
            let names = keys.names(first);
            let title = *known.entry(names).or_insert_with(|| {
                titled.push((keys.title(first), Vec::new()));
                titled.len() - 1
            });
            let (title, records) = &mut titled[title];
            while let Some(&row) = scores.kept.get(next).filter(|row| keys.names(**row) == names) {
                let start = bytes.len();
                let numbers = keys.numbers(row);
                bytes.extend_from_slice(&numbers.to_be_bytes());
                put_text(&mut bytes, text(keys.episode_id, row).unwrap_or_default());
                for label in &labels {
                    put_label(&mut bytes, shown(label, row).as_deref());
                }
                metrics.put(&mut bytes, next);
                let length = bytes.len() - start;
                if length.max(title.len()) >= TOO_LARGE {
                    return Err(keys.too_large(row));
                }
                records.push(Record { place: Place { start: narrow(start), length: narrow(length) }, numbers });
                next += 1;
                if bytes.len() >= most {
                    break;
                }
            }
        }
        Ok((Self { bytes, titled }, next))
    }
}

fn narrow(count: usize) -> u32 {
    u32::try_from(count).expect("rows are made some MiB at a time, and each is smaller than 2 GiB")
}

/// The rows of one batch, some MiB at a time: the first of them made at once, the others when they are asked for.
pub struct Parts {
    episodes: RecordBatch,
    scores: Scores,
    labels: Vec<String>,
    first: Option<Rows>,
    /// The place of the next row among those kept.
    next: usize,
    most: usize,
}

impl Parts {
    /// The scores of the episodes of one batch.
    ///
    /// # Errors
    /// Names and labels of 2 GiB.
    pub fn of(episodes: RecordBatch, scores: Scores, labels: &[String]) -> Result<Self, RowTooLarge> {
        Self::within(PART, episodes, scores, labels)
    }

    fn within(most: usize, episodes: RecordBatch, scores: Scores, labels: &[String]) -> Result<Self, RowTooLarge> {
        let (first, next) = Rows::of(&episodes, &scores, labels, 0, most)?;
        Ok(Self { episodes, scores, labels: labels.to_vec(), first: Some(first), next, most })
    }
}

impl Iterator for Parts {
    type Item = Result<Rows, RowTooLarge>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(first) = self.first.take() {
            return Some(Ok(first));
        }
        let left = self.next < self.scores.kept.len();
        left.then(|| {
            let (rows, next) = Rows::of(&self.episodes, &self.scores, &self.labels, self.next, self.most)?;
            self.next = next;
            Ok(rows)
        })
    }
}

/// Sorts rows as they come, in bounded memory.
pub struct RowSorter {
    header: Header,
    /// The bytes of rows that are not sorted yet, and where those of each title are.
    bytes: Vec<u8>,
    titled: BTreeMap<Vec<u8>, Vec<Record>>,
    sorted: Vec<Run>,
    runs: Runs,
    at_a_time: usize,
    memory: usize,
}

impl RowSorter {
    /// A sorter without rows.
    pub fn new(header: Header) -> Self {
        Self {
            header,
            bytes: Vec::new(),
            titled: BTreeMap::new(),
            sorted: Vec::new(),
            runs: Runs::default(),
            at_a_time: SORTED,
            memory: MEMORY,
        }
    }

    /// Adds rows.
    ///
    /// # Errors
    /// When rows cannot be put away.
    pub fn add(&mut self, rows: &Rows) -> io::Result<()> {
        if self.bytes.len() + rows.bytes.len() > self.at_a_time {
            self.sort();
            if self.sorted.iter().map(Run::size).sum::<usize>() >= self.memory {
                self.runs.put_away(std::mem::take(&mut self.sorted))?;
            }
            self.bytes.reserve(self.at_a_time);
        }
        let offset = narrow(self.bytes.len());
        self.bytes.extend_from_slice(&rows.bytes);
        for (title, records) in &rows.titled {
            self.titled.entry(title.clone()).or_default().extend(records.iter().map(|record| {
                let place = Place { start: record.place.start + offset, ..record.place };
                Record { place, ..*record }
            }));
        }
        Ok(())
    }

    /// Makes a sorted run of the rows that have come since the last one.
    fn sort(&mut self) {
        let bytes = std::mem::take(&mut self.bytes);
        let (mut sections, mut places): (Vec<Section>, Vec<Place>) = (Vec::new(), Vec::new());
        places.reserve_exact(self.titled.values().map(Vec::len).sum());
        for (title, mut records) in std::mem::take(&mut self.titled) {
            let rest = |record: &Record| &bytes[record.place.range()];
            // Rows of one file mostly come in order, which this sort makes use of.
            records.sort_by(|a, b| a.numbers.cmp(&b.numbers).then_with(|| rest(a).cmp(rest(b))));
            places.extend(records.iter().map(|record| record.place));
            sections.push(Section { title, end: places.len() });
        }
        self.sorted.push(Run::new(bytes, sections, places));
    }

    /// All rows in order.
    ///
    /// # Errors
    /// When rows that were put away cannot be read.
    pub fn finish(mut self) -> io::Result<SortedRows> {
        self.sort();
        let merge = self.runs.merge(self.sorted)?;
        Ok(SortedRows { header: self.header, merge, row: EpisodeRow::default() })
    }
}

/// The rows of a table, one after the other.
pub struct SortedRows {
    header: Header,
    merge: Merge,
    row: EpisodeRow,
}

impl SortedRows {
    /// What stands above them.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The next row.
    ///
    /// # Errors
    /// When rows that were put away cannot be read.
    pub fn next_row(&mut self) -> io::Result<Option<&EpisodeRow>> {
        let Some(runs::Record { title, bytes }) = self.merge.next()? else { return Ok(None) };
        let EpisodeRow { key, labels, metrics } = &mut self.row;
        let EpisodeKey { experiment, model, seed, run, episode_id } = key;
        if let Some(title) = title {
            let mut title = Bytes(title);
            title.text(experiment)?;
            title.text(model)?;
        }
        let mut record = Bytes(bytes);
        *seed = record.int()?;
        *run = record.int()?;
        record.text(episode_id)?;
        labels.resize(self.header.labels.len(), None);
        labels.iter_mut().try_for_each(|label| record.label(label))?;
        record.metrics(self.header.metrics.len(), metrics)?;
        Ok(Some(&self.row))
    }
}

/// The keys of some rows of [`crate::trace::scan::EpisodeBatch::episodes`].
pub(super) fn keys(episodes: &RecordBatch, rows: impl IntoIterator<Item = usize>) -> Vec<EpisodeKey> {
    let columns = KeyColumns::of(episodes);
    let owned = |column: TextColumn<'_>, row| text(column, row).unwrap_or_default().to_owned();
    let key = |row: usize| EpisodeKey {
        experiment: owned(columns.experiment, row),
        model: owned(columns.model, row),
        seed: columns.seed(row),
        run: columns.run(row),
        episode_id: owned(columns.episode_id, row),
    };
    rows.into_iter().map(key).collect()
}

/// The key columns of a batch.
struct KeyColumns<'a> {
    experiment: TextColumn<'a>,
    model: TextColumn<'a>,
    seed: &'a Int64Array,
    run: &'a Int64Array,
    episode_id: TextColumn<'a>,
}

/// A dictionary whose values are known to be texts.
type TextColumn<'a> = TypedDictionaryArray<'a, Int32Type, StringArray>;

impl<'a> KeyColumns<'a> {
    fn of(episodes: &'a RecordBatch) -> Self {
        let column = |name: &str| episodes.column_by_name(name).expect("every batch has the key columns");
        let [episode_id, model, experiment, seed, run] = EPISODE_COLUMNS.map(column);
        Self {
            experiment: texts(experiment),
            model: texts(model),
            seed: seed.as_primitive(),
            run: run.as_primitive(),
            episode_id: texts(episode_id),
        }
    }

    fn seed(&self, row: usize) -> i32 {
        i32::try_from(self.seed.value(row)).unwrap_or_default()
    }

    fn run(&self, row: usize) -> i32 {
        i32::try_from(self.run.value(row)).unwrap_or_default()
    }

    /// Experiment and model as keys of this batch.
    fn names(&self, row: usize) -> [Option<i32>; 2] {
        [self.experiment, self.model].map(|column| column.keys().is_valid(row).then(|| column.keys().value(row)))
    }

    fn title(&self, row: usize) -> Vec<u8> {
        let mut title = Vec::new();
        put_text(&mut title, text(self.experiment, row).unwrap_or_default());
        put_text(&mut title, text(self.model, row).unwrap_or_default());
        title
    }

    fn too_large(&self, row: usize) -> RowTooLarge {
        RowTooLarge { model: text(self.model, row).unwrap_or_default().chars().take(40).collect() }
    }

    /// Seed and run, as a number that compares as they do.
    fn numbers(&self, row: usize) -> u64 {
        // The scan has checked that seed and run fit.
        let ordered = |value: i32| u64::from((value ^ i32::MIN).cast_unsigned());
        ordered(self.seed(row)) << 32 | ordered(self.run(row))
    }
}

fn texts(column: &ArrayRef) -> TextColumn<'_> {
    column.as_dictionary().downcast_dict().expect("the values of every text column are texts")
}

/// The text at a row of a text column; `None` for null.
fn text(column: TextColumn<'_>, row: usize) -> Option<&str> {
    column.is_valid(row).then(|| column.value(row))
}

/// The value at a row of any column as text; `None` for null.
fn shown(column: &ArrayRef, row: usize) -> Option<Cow<'_, str>> {
    if column.is_null(row) {
        return None;
    }
    match column.data_type() {
        DataType::Boolean => Some(column.as_boolean().value(row).to_string().into()),
        DataType::Int64 => Some(column.as_primitive::<Int64Type>().value(row).to_string().into()),
        DataType::Float64 => Some(column.as_primitive::<Float64Type>().value(row).to_string().into()),
        _ => text(texts(column), row).map(Cow::from),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{DictionaryArray, Int32Array, Int64Array};
    use proptest::collection::vec;
    use proptest::option;
    use proptest::prelude::*;

    use super::*;
    use crate::metric::definitions::Definitions;
    use crate::score::run::schema_columns;

    fn header() -> Header {
        let catalog = Definitions::from_toml("none", "", &schema_columns()).unwrap().catalog;
        Header { catalog, labels: vec!["distractors".into()], metrics: vec!["A".into(), "B".into()] }
    }

    fn row() -> impl Strategy<Value = EpisodeRow> {
        let name = || proptest::string::string_regex("[a\u{0}\u{1}é\u{ff}]{0,3}").unwrap();
        let number = || prop_oneof![-2..3, Just(i32::MIN), Just(i32::MAX)];
        let metric = || option::of(prop_oneof![-1..3_i64, 252..258_i64, Just(i64::MIN), Just(i64::MAX)]);
        let key =
            (name(), name(), number(), number(), name()).prop_map(|(experiment, model, seed, run, episode_id)| {
                EpisodeKey { experiment, model, seed, run, episode_id }
            });
        (key, option::of(0..3_i64), vec(metric(), 2)).prop_map(|(key, distractors, metrics)| EpisodeRow {
            key,
            labels: vec![distractors.map(|number| number.to_string())],
            metrics,
        })
    }

    /// Rows as one batch gives them, parts of so many bytes.
    fn batch(rows: &[EpisodeRow], most: usize) -> Parts {
        let texts = |of: fn(&EpisodeKey) -> &str| {
            let texts = rows.iter().map(|row| Some(of(&row.key)));
            Arc::new(texts.collect::<DictionaryArray<Int32Type>>()) as ArrayRef
        };
        let ints = |of: fn(&EpisodeKey) -> i32| {
            Arc::new(rows.iter().map(|row| i64::from(of(&row.key))).collect::<Int64Array>()) as ArrayRef
        };
        let distractors: Int64Array =
            rows.iter().map(|row| row.labels[0].as_ref().map(|label| label.parse::<i64>().unwrap())).collect();
        let episodes = RecordBatch::try_from_iter_with_nullable([
            ("episode_id", texts(|key| &key.episode_id), false),
            ("model", texts(|key| &key.model), false),
            ("experiment", texts(|key| &key.experiment), false),
            ("seed", ints(|key| key.seed), false),
            ("run", ints(|key| key.run), false),
            ("distractors", Arc::new(distractors), true),
        ]);
        let metrics = (0..2).map(|metric| rows.iter().map(|row| row.metrics[metric]).collect()).collect();
        let scores = Scores { kept: (0..rows.len()).collect(), metrics };
        Parts::within(most, episodes.unwrap(), scores, &["distractors".to_owned()]).unwrap()
    }

    /// Episodes of one step with the same label, which is in memory once.
    fn alike(count: usize, label: &str) -> (RecordBatch, Scores) {
        let same = |text: &str| {
            let keys = Int32Array::from(vec![0; count]);
            let texts = Arc::new(StringArray::from(vec![text]));
            Arc::new(DictionaryArray::<Int32Type>::new(keys, texts)) as ArrayRef
        };
        let ints = || Arc::new(Int64Array::from(vec![1; count])) as ArrayRef;
        let episodes = RecordBatch::try_from_iter([
            ("episode_id", same("e")),
            ("model", same("m")),
            ("experiment", same("E1")),
            ("seed", ints()),
            ("run", ints()),
            ("stated_color", same(label)),
        ]);
        (episodes.unwrap(), Scores { kept: (0..count).collect(), metrics: Vec::new() })
    }

    #[test]
    fn more_than_4_gib_of_labels_come_in_parts_that_fit_into_memory() {
        let (count, label) = (70_000, "x".repeat(64 * 1024));
        let (episodes, scores) = alike(count, &label);
        let (mut found, mut bytes) = (0, 0);
        for rows in Parts::of(episodes, scores, &["stated_color".to_owned()]).unwrap() {
            let rows = rows.unwrap();
            assert!(rows.bytes.len() < PART + 2 * label.len());
            let records: usize = rows.titled.iter().map(|(_, records)| records.len()).sum();
            found += records;
            bytes += rows.bytes.len();
        }
        assert_eq!(found, count);
        assert!(bytes > u32::MAX as usize, "{bytes}");
    }

    proptest! {
        #[test]
        fn rows_come_out_as_they_went_in_and_in_the_order_of_keys(
            rows in vec(row(), 1..30), batches in 1_usize..10, at_a_time in 1_usize..200, memory in 1_usize..400,
            most in 1_usize..300,
        ) {
            let mut sorter = RowSorter { at_a_time, memory, ..RowSorter::new(header()) };
            for some in rows.chunks(rows.len().div_ceil(batches)) {
                for part in batch(some, most) {
                    sorter.add(&part.unwrap()).unwrap();
                }
            }
            let mut sorted = sorter.finish().unwrap();
            let mut found = Vec::new();
            while let Some(row) = sorted.next_row().unwrap() {
                found.push(row.clone());
            }
            prop_assert!(found.is_sorted_by_key(|row| row.key.clone()));
            let by_all = |row: &EpisodeRow| (row.key.clone(), row.labels.clone(), row.metrics.clone());
            let mut expected = rows;
            expected.sort_by_key(by_all);
            found.sort_by_key(by_all);
            prop_assert_eq!(found, expected);
        }
    }
}

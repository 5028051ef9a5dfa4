//! Builds an episode table: rows come in any order, columns leave in key order.
//!
//! Rule: values stay in columns. Texts are interned, so that only small integers are sorted; ids are stored once, in
//! order of arrival, and the sorted column points at them.

use std::collections::HashMap;

use arrow::array::{
    Array, ArrayRef, AsArray as _, BooleanArray, BooleanBufferBuilder, DictionaryArray, Int32Array, Int64Array,
    LargeStringBuilder, RecordBatch, UInt32Array, UInt32Builder,
};
use arrow::buffer::NullBuffer;
use arrow::datatypes::{ArrowNativeType as _, DataType, Float64Type, Int32Type, Int64Type};

use crate::tables::order::order;
use crate::tables::table::{
    EpisodeKey, EpisodeKeys, EpisodeTable, Header, KeyRef, LabelColumn, MetricColumn, MetricValues, TextColumn,
    default_text, narrow,
};
use mirrorstats_trace::footers::declared::Declared;
use mirrorstats_trace::scan::{EPISODE_COLUMNS, EpisodeBatch};

#[derive(Debug)]
pub struct TableBuilder {
    header: Header,
    keys: KeyBuilder,
    labels: Vec<TextBuilder>,
    metrics: Vec<MetricBuilder>,
}

impl TableBuilder {
    pub fn new(header: Header) -> Self {
        let labels = header.labels.iter().map(|_| TextBuilder::default()).collect();
        let metrics = header.metrics.iter().map(|_| MetricBuilder::default()).collect();
        Self { header, keys: KeyBuilder::default(), labels, metrics }
    }

    pub fn header(&self) -> &Header {
        &self.header
    }

    pub fn push<'a>(
        &mut self,
        key: KeyRef<'_>,
        labels: impl IntoIterator<Item = Option<&'a str>>,
        metrics: impl IntoIterator<Item = Option<i64>>,
    ) {
        self.keys.push(key);
        self.labels.iter_mut().zip(labels).for_each(|(column, label)| column.push(label));
        self.metrics.iter_mut().zip(metrics).for_each(|(column, value)| column.push(value));
    }

    /// Adds scored episodes: their columns from a scan, and a column for each metric of the header.
    pub fn extend(&mut self, episodes: &RecordBatch, metrics: &[ArrayRef]) {
        self.keys.extend(episodes);
        for (name, label) in self.header.labels.iter().zip(&mut self.labels) {
            match episodes.column_by_name(name) {
                Some(column) => label.extend(column, default_text(name)),
                None => label.repeat(default_text(name), episodes.num_rows()),
            }
        }
        self.metrics.iter_mut().zip(metrics).for_each(|(builder, column)| builder.extend(column));
    }

    pub fn finish(self) -> EpisodeTable {
        let Header { catalog, labels, metrics } = self.header;
        let keys = self.keys.finish();
        let order = order(&keys).map(UInt32Array::from);
        let sorted = |column: TextColumn| order.as_ref().map_or_else(|| column.clone(), |order| column.taken(order));
        let labels = labels.into_iter().zip(self.labels);
        let metrics = metrics.into_iter().zip(self.metrics).map(|(name, values)| {
            let column = MetricColumn { name, values: values.finish() };
            order.as_ref().map_or_else(|| column.clone(), |order| column.taken(order))
        });
        EpisodeTable {
            catalog,
            labels: labels.map(|(name, values)| LabelColumn { name, values: sorted(values.finish()) }).collect(),
            metrics: metrics.collect(),
            keys: order.as_ref().map_or_else(|| keys.clone(), |order| keys.taken(order)),
            declared: Declared::default(),
        }
    }
}

#[derive(Debug, Default)]
pub(crate) struct KeyBuilder {
    experiment: TextBuilder,
    model: TextBuilder,
    seed: Vec<i32>,
    run: Vec<i32>,
    episode_id: LargeStringBuilder,
}

impl KeyBuilder {
    pub(crate) fn push(&mut self, key: KeyRef<'_>) {
        self.experiment.push(Some(key.experiment));
        self.model.push(Some(key.model));
        self.seed.push(key.seed);
        self.run.push(key.run);
        self.episode_id.append_value(key.episode_id);
    }

    fn extend(&mut self, episodes: &RecordBatch) {
        let [ids, models, experiments, seeds, runs] = EPISODE_COLUMNS.map(|name| column(episodes, name));
        self.experiment.extend(experiments, None);
        self.model.extend(models, None);
        // The scan has checked the range.
        let int = |value: &i64| i32::try_from(*value).unwrap_or_default();
        self.seed.extend(seeds.as_primitive::<Int64Type>().values().iter().map(int));
        self.run.extend(runs.as_primitive::<Int64Type>().values().iter().map(int));
        let ids = ids.as_dictionary::<Int32Type>();
        let texts = ids.values().as_string::<i32>();
        ids.keys().values().iter().for_each(|key| self.episode_id.append_value(texts.value(key.as_usize())));
    }

    pub(crate) fn finish(mut self) -> EpisodeKeys {
        let texts = self.episode_id.finish();
        EpisodeKeys {
            experiment: self.experiment.finish(),
            model: self.model.finish(),
            seed: Int32Array::from(self.seed),
            run: Int32Array::from(self.run),
            episode_id: TextColumn { codes: (0..narrow(texts.len())).collect::<Vec<_>>().into(), texts },
        }
    }
}

impl EpisodeKeys {
    pub(crate) fn of_batch(episodes: &RecordBatch) -> Self {
        let mut keys = KeyBuilder::default();
        keys.extend(episodes);
        keys.finish()
    }
}

#[derive(Debug, Default)]
pub(crate) struct TextBuilder {
    codes: UInt32Builder,
    texts: LargeStringBuilder,
    known: HashMap<Box<str>, u32>,
}

impl TextBuilder {
    pub(crate) fn push(&mut self, text: Option<&str>) {
        let code = text.map(|text| self.code(text));
        self.codes.append_option(code);
    }

    /// Adds the values of a column of any type as text; a null value becomes `null`.
    fn extend(&mut self, column: &ArrayRef, null: Option<&str>) {
        match column.as_dictionary_opt::<Int32Type>() {
            Some(texts) => self.extend_coded(texts, null),
            None => (0..column.len()).for_each(|row| self.push(shown(column, row).as_deref().or(null))),
        }
    }

    fn repeat(&mut self, text: Option<&str>, rows: usize) {
        let code = text.map(|text| self.code(text));
        (0..rows).for_each(|_| self.codes.append_option(code));
    }

    fn extend_coded(&mut self, column: &DictionaryArray<Int32Type>, null: Option<&str>) {
        let null = null.filter(|_| column.null_count() > 0).map(|text| self.code(text));
        let texts = column.values().as_string::<i32>();
        let mut known = vec![None; texts.len()];
        for key in column.keys() {
            let code =
                key.map(|key| *known[key.as_usize()].get_or_insert_with(|| self.code(texts.value(key.as_usize()))));
            self.codes.append_option(code.or(null));
        }
    }

    pub(crate) fn code(&mut self, text: &str) -> u32 {
        if let Some(code) = self.known.get(text) {
            return *code;
        }
        let code = narrow(self.known.len());
        self.texts.append_value(text);
        self.known.insert(text.into(), code);
        code
    }

    pub(crate) fn finish(mut self) -> TextColumn {
        TextColumn { codes: self.codes.finish(), texts: self.texts.finish() }
    }
}

fn column<'a>(episodes: &'a RecordBatch, name: &str) -> &'a ArrayRef {
    episodes.column_by_name(name).expect("the projection asks for this column")
}

pub(crate) fn episode_ids(batch: &EpisodeBatch) -> Vec<String> {
    let dictionary = column(&batch.episodes, "episode_id").as_dictionary::<Int32Type>();
    let texts = dictionary.values().as_string::<i32>();
    let text = |row| dictionary.key(row).map_or_else(String::new, |key| texts.value(key).to_owned());
    (0..dictionary.len()).map(text).collect()
}

fn shown(column: &ArrayRef, row: usize) -> Option<String> {
    if column.is_null(row) {
        return None;
    }
    match column.data_type() {
        DataType::Boolean => Some(column.as_boolean().value(row).to_string()),
        DataType::Int64 => Some(column.as_primitive::<Int64Type>().value(row).to_string()),
        DataType::Float64 => Some(column.as_primitive::<Float64Type>().value(row).to_string()),
        other => unreachable!("a scan gives no column of {other}"),
    }
}

impl FromIterator<EpisodeKey> for EpisodeKeys {
    fn from_iter<I: IntoIterator<Item = EpisodeKey>>(keys: I) -> Self {
        let mut columns = KeyBuilder::default();
        keys.into_iter().for_each(|key| columns.push(key.as_ref()));
        columns.finish()
    }
}

impl<T: AsRef<str>> FromIterator<Option<T>> for TextColumn {
    fn from_iter<I: IntoIterator<Item = Option<T>>>(texts: I) -> Self {
        let mut column = TextBuilder::default();
        texts.into_iter().for_each(|text| column.push(text.as_ref().map(AsRef::as_ref)));
        column.finish()
    }
}

/// A score column under construction: bits as long as all values are truth values.
#[derive(Debug)]
pub(crate) struct MetricBuilder {
    values: Values,
    valid: BooleanBufferBuilder,
}

#[derive(Debug)]
enum Values {
    Bools(BooleanBufferBuilder),
    Ints(Vec<i64>),
}

impl Default for MetricBuilder {
    fn default() -> Self {
        Self { values: Values::Bools(BooleanBufferBuilder::new(0)), valid: BooleanBufferBuilder::new(0) }
    }
}

impl MetricBuilder {
    pub(crate) fn extend(&mut self, column: &ArrayRef) {
        match (column.as_boolean_opt(), &mut self.values) {
            (Some(more), Values::Bools(bools)) => bools.append_buffer(more.values()),
            (Some(more), Values::Ints(ints)) => ints.extend(more.values().iter().map(i64::from)),
            (None, _) => self.ints().extend_from_slice(column.as_primitive::<Int64Type>().values()),
        }
        match column.nulls() {
            Some(nulls) => self.valid.append_buffer(nulls.inner()),
            None => self.valid.append_n(column.len(), true),
        }
    }

    fn push(&mut self, value: Option<i64>) {
        self.ints().push(value.unwrap_or_default());
        self.valid.append(value.is_some());
    }

    fn ints(&mut self) -> &mut Vec<i64> {
        if let Values::Bools(bools) = &mut self.values {
            self.values = Values::Ints(bools.finish().iter().map(i64::from).collect());
        }
        match &mut self.values {
            Values::Ints(ints) => ints,
            Values::Bools(_) => unreachable!("they are integers now"),
        }
    }

    fn finish(mut self) -> MetricValues {
        let nulls = Some(NullBuffer::new(self.valid.finish())).filter(|nulls| nulls.null_count() > 0);
        match self.values {
            Values::Bools(mut bools) => MetricValues::Bools(BooleanArray::new(bools.finish(), nulls)),
            Values::Ints(ints) => MetricValues::Ints(Int64Array::new(ints.into(), nulls)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::collection::vec;
    use proptest::option;
    use proptest::prelude::*;

    use super::*;
    use crate::tables::table::EpisodeKey;
    use crate::vocabulary::schema_columns;
    use mirrorstats_metric::definitions::Definitions;

    /// A key, a label and two metrics.
    type Row = (EpisodeKey, Option<i64>, [Option<i64>; 2]);

    fn header(metrics: usize) -> Header {
        let catalog = Definitions::from_toml("none", "", &schema_columns()).unwrap().catalog;
        let metrics = (0..metrics).map(|at| format!("M{at}")).collect();
        Header { catalog, labels: vec!["distractors".into()], metrics }
    }

    fn row() -> impl Strategy<Value = Row> {
        let name = || proptest::string::string_regex("[a\u{0}\u{1}é\u{ff}]{0,3}").unwrap();
        let number = || prop_oneof![-2..3, Just(i32::MIN), Just(i32::MAX)];
        let metric = || option::of(prop_oneof![-1..3_i64, Just(i64::MIN), Just(i64::MAX)]);
        let key =
            (name(), name(), number(), number(), name()).prop_map(|(experiment, model, seed, run, episode_id)| {
                EpisodeKey { experiment, model, seed, run, episode_id }
            });
        (key, option::of(0..3_i64), option::of(0..2_i64), metric())
            .prop_map(|(key, label, rate, number)| (key, label, [rate, number]))
    }

    fn extend(builder: &mut TableBuilder, rows: &[Row]) {
        let texts = |of: fn(&EpisodeKey) -> &str| {
            let texts = rows.iter().map(|row| Some(of(&row.0)));
            Arc::new(texts.collect::<DictionaryArray<Int32Type>>()) as ArrayRef
        };
        let ints = |of: fn(&EpisodeKey) -> i32| {
            Arc::new(rows.iter().map(|row| i64::from(of(&row.0))).collect::<Int64Array>()) as ArrayRef
        };
        let episodes = RecordBatch::try_from_iter_with_nullable([
            ("episode_id", texts(|key| &key.episode_id), false),
            ("model", texts(|key| &key.model), false),
            ("experiment", texts(|key| &key.experiment), false),
            ("seed", ints(|key| key.seed), false),
            ("run", ints(|key| key.run), false),
            ("distractors", Arc::new(rows.iter().map(|row| row.1).collect::<Int64Array>()) as _, true),
        ]);
        let bools = rows.iter().map(|row| row.2[0].map(|value| value == 1)).collect::<BooleanArray>();
        let numbers = rows.iter().map(|row| row.2[1]).collect::<Int64Array>();
        builder.extend(&episodes.unwrap(), &[Arc::new(bools), Arc::new(numbers)]);
    }

    fn rows_of(table: &EpisodeTable) -> Vec<Row> {
        let row = |row: usize| {
            let label = table.labels[0].values.get(row).map(|text| text.parse().unwrap());
            (table.keys.get(row).to_owned(), label, [0, 1].map(|at| table.metrics[at].get(row)))
        };
        (0..table.len()).map(row).collect()
    }

    proptest! {
        #[test]
        fn rows_are_unchanged_and_sorted_by_key(
            mut rows in vec(row(), 1..30), batches in 1_usize..10, by_row in any::<bool>(),
        ) {
            let mut builder = TableBuilder::new(header(2));
            for some in rows.chunks(rows.len().div_ceil(batches)) {
                if by_row {
                    for (key, label, metrics) in some {
                        let label = label.map(|label| label.to_string());
                        builder.push(key.as_ref(), [label.as_deref()], metrics.iter().copied());
                    }
                } else {
                    extend(&mut builder, some);
                }
            }
            let table = builder.finish();
            let found = rows_of(&table);
            prop_assert!(found.is_sorted_by_key(|row| &row.0));
            // Rows with equal keys stay in order of arrival.
            rows.sort_by(|a, b| a.0.cmp(&b.0));
            prop_assert_eq!(&found, &rows);
            let taken: Vec<usize> = (0..rows.len()).rev().step_by(2).collect();
            let expected: Vec<Row> = taken.iter().map(|row| rows[*row].clone()).collect();
            prop_assert_eq!(rows_of(&table.taken(&taken)), expected);
        }
    }

    #[test]
    fn truth_values_and_integers_make_one_column() {
        let mut builder = MetricBuilder::default();
        builder.extend(&(Arc::new(BooleanArray::from(vec![Some(true), None, Some(false)])) as ArrayRef));
        builder.extend(&(Arc::new(Int64Array::from(vec![Some(7), None])) as ArrayRef));
        builder.extend(&(Arc::new(BooleanArray::from(vec![true])) as ArrayRef));
        let column = MetricColumn { name: "M".into(), values: builder.finish() };
        assert!(column.iter().eq([Some(1), None, Some(0), Some(7), None, Some(1)]));
    }

    #[test]
    fn a_table_takes_less_than_50_bytes_per_episode_and_the_text_of_its_id() {
        const EPISODES: usize = 10_000;
        let mut builder = TableBuilder::new(Header { labels: Vec::new(), ..header(10) });
        let mut text = 0;
        for episode in 0..EPISODES {
            let [experiment, model] = [format!("E{}", episode % 5), format!("model {}", episode % 8)];
            let (seed, run) = (i32::try_from(episode % 3).unwrap(), i32::try_from(episode * 7919 % EPISODES).unwrap());
            let episode_id = format!("{experiment}-{model}-{episode:07}");
            text += episode_id.len();
            builder.keys.push(KeyRef { experiment: &experiment, model: &model, seed, run, episode_id: &episode_id });
        }
        // The paper's metrics: eight rates and two numbers of steps.
        for (at, metric) in builder.metrics.iter_mut().enumerate() {
            metric.extend(&if at < 8 {
                Arc::new((0..EPISODES).map(|row| (row % 9 > 0).then_some(row % 2 == 0)).collect::<BooleanArray>())
                    as ArrayRef
            } else {
                Arc::new((0..EPISODES).map(|row| (row % 9 > 0).then_some(7)).collect::<Int64Array>())
            });
        }
        let table = builder.finish();
        let EpisodeKeys { experiment, model, seed, run, episode_id } = &table.keys;
        let columns: [&dyn Array; 8] = [
            &experiment.codes,
            &experiment.texts,
            &model.codes,
            &model.texts,
            seed,
            run,
            &episode_id.codes,
            &episode_id.texts,
        ];
        let metrics = table.metrics.iter().map(MetricColumn::array);
        let size = |column: &dyn Array| column.to_data().get_slice_memory_size().unwrap();
        let bytes: usize = columns.into_iter().chain(metrics).map(size).sum();
        assert!(bytes - text < 50 * EPISODES, "{bytes} bytes, {text} of them ids");
    }
}

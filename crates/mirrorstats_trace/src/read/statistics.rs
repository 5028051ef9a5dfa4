//! Compares the values of a row group with the statistics in its footer, if no checksum protects them.
//!
//! Rule: a file is refused only for errors that no sound writer makes. These are a wrong null count, values out of
//! bounds, a wrong total size of texts, and a bound (number, truth or short text) that neither a row nor a dictionary
//! has. Long texts may be cut.

use std::cmp::Ordering;

use arrow::array::{Array, ArrayRef, AsArray as _};
use arrow::datatypes::{DataType, Float64Type, Int64Type};
use parquet::basic::{ConvertedType, Encoding, LogicalType};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
use parquet::file::statistics::Statistics;

use super::entry_use::{EntryUse, count, lengths};
use mirrorstats_exact::escape::visible;
use mirrorstats_parquet_pages::{Column, Runs};

/// Writers may cut texts from this length on.
const CUT: usize = 60;

#[derive(Debug, Default)]
pub(crate) struct DeclaredStatistics(Vec<Vec<Option<Chunk>>>);

#[derive(Clone, Debug, Default)]
pub(crate) struct Chunk {
    nulls: Option<u64>,
    bytes: Option<u64>,
    least: Option<Bound>,
    greatest: Option<Bound>,
}

#[derive(Clone, Debug, PartialEq)]
enum Bound {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(Vec<u8>),
}

impl DeclaredStatistics {
    pub(crate) fn from_metadata(metadata: &ParquetMetaData) -> Self {
        let groups = metadata.row_groups().iter();
        Self(groups.map(|group| group.columns().iter().map(Chunk::from_chunk).collect()).collect())
    }

    pub(crate) fn chunk(&self, row_group: usize, column: usize) -> Option<&Chunk> {
        self.0.get(row_group)?.get(column)?.as_ref()
    }
}

impl Chunk {
    fn from_chunk(chunk: &ColumnChunkMetaData) -> Option<Self> {
        // Arrow's C++ writer counts the stored bytes of delta-encoded texts here.
        let is_delta = chunk
            .encodings()
            .any(|encoding| matches!(encoding, Encoding::DELTA_BYTE_ARRAY | Encoding::DELTA_LENGTH_BYTE_ARRAY));
        let bytes = chunk.unencoded_byte_array_data_bytes().filter(|_| !is_delta);
        let bytes = bytes.and_then(|bytes| u64::try_from(bytes).ok());
        let Some(statistics) = chunk.statistics() else {
            return bytes.map(|bytes| Self { bytes: Some(bytes), ..Self::default() });
        };
        let described = chunk.column_descr();
        let logical = described.logical_type_ref();
        let is_unsigned = matches!(logical, Some(LogicalType::Integer(integer)) if !integer.is_signed)
            || matches!(
                described.converted_type(),
                ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64
            );
        let [least, greatest] = match statistics {
            _ if is_unsigned => [None, None],
            Statistics::Boolean(of) => ends([of.min_opt(), of.max_opt()], |value| Bound::Bool(*value)),
            Statistics::Int32(of) => ends([of.min_opt(), of.max_opt()], |value| Bound::Int((*value).into())),
            Statistics::Int64(of) => ends([of.min_opt(), of.max_opt()], |value| Bound::Int(*value)),
            Statistics::Float(of) => ends([of.min_opt(), of.max_opt()], |value| Bound::Float((*value).into())),
            Statistics::Double(of) => ends([of.min_opt(), of.max_opt()], |value| Bound::Float(*value)),
            // The older fields are ordered as signed bytes.
            Statistics::ByteArray(of) if !statistics.is_min_max_deprecated() => {
                ends([of.min_opt(), of.max_opt()], |value| Bound::Text(value.data().to_vec()))
            }
            _ => [None, None],
        };
        Some(Self { nulls: statistics.null_count_opt(), bytes, least, greatest })
    }
}

fn ends<T>(ends: [Option<&T>; 2], value: impl Fn(&T) -> Bound) -> [Option<Bound>; 2] {
    ends.map(|end| end.map(&value))
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Seen {
    nulls: u64,
    bytes: u64,
    least: Option<Bound>,
    greatest: Option<Bound>,
    /// The bounds of dictionary texts. Some writers use these for statistics, even if no row has them.
    entries: Option<[Vec<u8>; 2]>,
    /// The texts of the rows since the entries changed: all rows of a row group may have the same.
    texts: Option<EntryUse>,
}

impl Seen {
    pub(crate) fn add(&mut self, column: &Column) {
        if self.texts.as_mut().is_some_and(|texts| texts.extend(column)) {
            return;
        }
        self.finish();
        self.texts = EntryUse::of_column(column);
        match column {
            _ if self.texts.is_some() => {}
            Column::Flat(values) => {
                self.nulls += values.null_count() as u64;
                self.ends(values, 0..values.len());
            }
            Column::Runs(runs) => self.runs(runs),
            Column::Keys(keys) => {
                let mut rows = vec![0; keys.values().len()];
                count(keys.keys(), &mut rows, &mut self.nulls);
                self.ends(keys.values(), (0..rows.len()).filter(|at| rows[*at] > 0));
            }
        }
    }

    pub(crate) fn finish(&mut self) {
        let Some(texts) = self.texts.take() else { return };
        self.nulls += texts.nulls;
        self.bytes += texts.bytes();
        let all = texts.entries().map(str::as_bytes).chain(self.entries.iter().flatten().map(Vec::as_slice));
        self.entries = all.clone().min().zip(all.max()).map(|(least, greatest)| [least.to_vec(), greatest.to_vec()]);
        self.both(texts.used().map(|(text, _)| text.as_bytes()), Ord::cmp, |text| Bound::Text(text.to_vec()));
    }

    pub(crate) fn fault(&self, declared: &Chunk) -> Option<(String, String)> {
        let nulls = declared.nulls.filter(|nulls| *nulls != self.nulls);
        if let Some(nulls) = nulls {
            return Some((format!("{nulls} nulls, as in the footer's statistics"), self.nulls.to_string()));
        }
        if let Some(bytes) = declared.bytes.filter(|bytes| *bytes != self.bytes) {
            return Some((format!("texts of {bytes} bytes, as in the footer's statistics"), self.bytes.to_string()));
        }
        let bounds = [
            (&declared.least, &self.least, Ordering::Less, "least"),
            (&declared.greatest, &self.greatest, Ordering::Greater, "greatest"),
        ];
        bounds.into_iter().find_map(|(declared, found, beyond, word)| {
            let (declared, found) = (declared.as_ref()?, found.as_ref()?);
            let order = found.order(declared)?;
            // Some row must have a bound that is not cut, unless it is that of a dictionary.
            let may_be_absent = matches!(declared, Bound::Text(text)
                if text.len() >= CUT || self.entries.as_ref().is_some_and(|ends| ends.contains(text)));
            let expected = || format!("{} as the {word} value, as in the footer's statistics", declared.words());
            let is_wrong = order == beyond || order != Ordering::Equal && !may_be_absent;
            is_wrong.then(|| (expected(), found.words()))
        })
    }

    fn value(&mut self, value: &Bound) {
        let is_beyond =
            |bound: &Option<Bound>, beyond| bound.as_ref().is_none_or(|bound| value.order(bound) == Some(beyond));
        if is_beyond(&self.least, Ordering::Less) {
            self.least = Some(value.clone());
        }
        if is_beyond(&self.greatest, Ordering::Greater) {
            self.greatest = Some(value.clone());
        }
    }

    fn runs(&mut self, runs: &Runs) {
        let values = runs.values();
        let nulls = lengths(runs).filter(|(_, run, _)| values.is_null(*run));
        self.nulls += nulls.map(|(_, _, length)| length).sum::<u64>();
        self.ends(values, runs.starts().map(|(_, run)| run));
    }

    fn ends(&mut self, values: &ArrayRef, rows: impl Iterator<Item = usize>) {
        let nulls = values.nulls();
        let rows = rows.filter(|row| nulls.is_none_or(|nulls| nulls.is_valid(*row)));
        match values.data_type() {
            DataType::Boolean => {
                let values = values.as_boolean().values();
                self.both(rows.map(|row| values.value(row)), Ord::cmp, Bound::Bool);
            }
            DataType::Int64 => {
                let values = values.as_primitive::<Int64Type>().values();
                self.both(rows.map(|row| values[row]), Ord::cmp, Bound::Int);
            }
            DataType::Float64 => {
                let values = values.as_primitive::<Float64Type>().values();
                let numbers = rows.map(|row| values[row]).filter(|value| !value.is_nan());
                self.both(numbers, f64::total_cmp, Bound::Float);
            }
            _ => {}
        }
    }

    fn both<T: Copy>(
        &mut self,
        mut values: impl Iterator<Item = T>,
        order: impl Fn(&T, &T) -> Ordering,
        value: impl Fn(T) -> Bound,
    ) {
        let Some(first) = values.next() else { return };
        let (least, greatest) = values.fold((first, first), |(least, greatest), next| {
            (
                if order(&next, &least).is_lt() { next } else { least },
                if order(&next, &greatest).is_gt() { next } else { greatest },
            )
        });
        self.value(&value(least));
        self.value(&value(greatest));
    }
}

impl Bound {
    /// `None` for values of two types: the column is wider than its statistics.
    fn order(&self, other: &Self) -> Option<Ordering> {
        match (self, other) {
            (Self::Bool(a), Self::Bool(b)) => Some(a.cmp(b)),
            (Self::Int(a), Self::Int(b)) => Some(a.cmp(b)),
            // Equal regardless of the sign of zero; NaN does not compare.
            (Self::Float(a), Self::Float(b)) => a.partial_cmp(b),
            (Self::Text(a), Self::Text(b)) => Some(a.cmp(b)),
            _ => None,
        }
    }

    fn words(&self) -> String {
        match self {
            Self::Bool(value) => value.to_string(),
            Self::Int(value) => value.to_string(),
            Self::Float(value) => value.to_string(),
            Self::Text(text) => format!("`{}`", visible(&String::from_utf8_lossy(text))),
        }
    }
}

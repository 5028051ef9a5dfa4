//! Vectors: the result of a physical step for one batch, and a batch's texts as small integers.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, ArrowPrimitiveType, AsArray as _, BooleanArray, Float64Array, Int32Array, Int64Array,
    PrimitiveArray, RecordBatch, StringArray, UInt8Array, UInt32Array, UInt64Array,
};
use arrow::buffer::{BooleanBuffer, NullBuffer};
use arrow::compute::take;
use arrow::datatypes::{ArrowNativeType, Float64Type, Int32Type, Int64Type, UInt8Type, UInt32Type};
use arrow::error::ArrowError;

use crate::kernels::segments::{Segments, Stretch};
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::Constant;
use mirrorstats_parquet_pages::bits;
use mirrorstats_trace::scan::Texts;

#[derive(Clone, Debug)]
pub(crate) enum Vector {
    /// Truth values, integers, floats, or text symbols ([`Symbols`]): one per timestep, one per episode, or one that
    /// represents all.
    Array(ArrayRef),
    Keyed(Arc<Keyed>),
    Rows(Rc<Vec<Stretch>>),
}

impl<A: Array + 'static> From<A> for Vector {
    fn from(array: A) -> Self {
        Self::Array(Arc::new(array))
    }
}

impl Vector {
    pub(crate) fn constant(constant: &Constant, ty: Type, symbols: &mut Symbols) -> Self {
        match (constant, ty) {
            (Constant::Bool(value), _) => BooleanArray::from(vec![*value]).into(),
            (Constant::Int(value), _) => Int64Array::from(vec![*value]).into(),
            (Constant::Float(bits), _) => Float64Array::from(vec![canonical(f64::from_bits(*bits))]).into(),
            (Constant::Text(text), _) => UInt32Array::from(vec![symbols.intern(text)]).into(),
            (Constant::Null, Type::Bool) => BooleanArray::from(vec![None]).into(),
            (Constant::Null, Type::Int) => Int64Array::from(vec![None]).into(),
            (Constant::Null, Type::Float) => Float64Array::from(vec![None]).into(),
            (Constant::Null, Type::Text) => UInt32Array::from(vec![None]).into(),
        }
    }

    pub(crate) fn array(&self) -> &ArrayRef {
        match self {
            Self::Array(array) => array,
            Self::Keyed(_) | Self::Rows(_) => unreachable!("the physical plan takes the symbols of keys"),
        }
    }

    pub(crate) fn keyed(&self) -> &Keyed {
        match self {
            Self::Keyed(keyed) => keyed,
            Self::Array(_) | Self::Rows(_) => unreachable!("the physical plan takes keys from columns alone"),
        }
    }

    pub(crate) fn rows(&self) -> &[Stretch] {
        match self {
            Self::Rows(rows) => rows,
            Self::Array(_) | Self::Keyed(_) => unreachable!("the physical plan searches within rows alone"),
        }
    }

    /// An array that is null where the values are.
    pub(crate) fn validity(&self) -> &dyn Array {
        match self {
            Self::Keyed(keyed) => keyed.keys.array(),
            _ => self.array().as_ref(),
        }
    }

    pub(crate) fn bools(&self) -> &BooleanArray {
        self.array().as_boolean()
    }

    pub(crate) fn ints(&self) -> &Int64Array {
        self.array().as_primitive::<Int64Type>()
    }

    pub(crate) fn floats(&self) -> &Float64Array {
        self.array().as_primitive::<Float64Type>()
    }

    pub(crate) fn symbols(&self) -> &UInt32Array {
        self.array().as_primitive::<UInt32Type>()
    }
}

/// A column of texts: a key per row, and what each key represents.
#[derive(Debug)]
pub(crate) struct Keyed {
    keys: Keys,
    symbols: Vec<u32>,
}

/// A text column of a batch: a key per row, and the text of each key, which several keys may share.
pub(crate) struct Coded<'a> {
    keys: Keys,
    pub(crate) texts: &'a StringArray,
}

impl<'a> Coded<'a> {
    /// The text column of this name; `None` without one.
    pub(crate) fn of(texts: &'a [Texts], columns: &'a RecordBatch, name: &str) -> Option<Self> {
        if let Some(texts) = texts.iter().find(|texts| texts.name == name) {
            return Some(Self { keys: Keys::Narrow(texts.keys.clone()), texts: &texts.texts });
        }
        let column = columns.column_by_name(name)?.as_dictionary_opt::<Int32Type>()?;
        Some(Self { keys: Keys::Wide(column.keys().clone()), texts: column.values().as_string_opt()? })
    }

    pub(crate) fn code(&self, row: usize) -> Option<usize> {
        match &self.keys {
            Keys::Narrow(keys) => keys.is_valid(row).then(|| keys.value(row).into()),
            Keys::Wide(keys) => keys.is_valid(row).then(|| usize::try_from(keys.value(row)).ok())?,
        }
    }
}

/// The keys of rows, as bytes if they fit.
#[derive(Debug)]
enum Keys {
    Narrow(UInt8Array),
    Wide(Int32Array),
}

impl Keys {
    fn array(&self) -> &dyn Array {
        match self {
            Self::Narrow(keys) => keys,
            Self::Wide(keys) => keys,
        }
    }
}

impl Keyed {
    pub(crate) fn symbols(&self) -> UInt32Array {
        match &self.keys {
            Keys::Narrow(keys) => self.symbols_of(keys),
            Keys::Wide(keys) => self.symbols_of(keys),
        }
    }

    /// The symbols of some rows, null for a null row.
    pub(crate) fn at(&self, rows: &UInt64Array) -> Result<UInt32Array, ArrowError> {
        let keys = take(self.keys.array(), rows, None)?;
        Ok(match &self.keys {
            Keys::Narrow(_) => self.symbols_of(keys.as_primitive::<UInt8Type>()),
            Keys::Wide(_) => self.symbols_of(keys.as_primitive::<Int32Type>()),
        })
    }

    fn symbols_of<K: ArrowPrimitiveType>(&self, keys: &PrimitiveArray<K>) -> UInt32Array {
        // The key of a null is arbitrary; the null buffer masks it.
        let symbol = |key: &K::Native| self.symbols.get(key.as_usize()).copied().unwrap_or(0);
        UInt32Array::new(keys.values().iter().map(symbol).collect(), keys.nulls().cloned())
    }

    /// True where a text equals its episode's text (or differs from it, unless `equal`); null where either is null.
    pub(crate) fn compare(&self, segments: Segments<'_>, texts: &UInt32Array, equal: bool) -> BooleanArray {
        let mut keys_of = vec![None; self.symbols.iter().max().map_or(0, |last| *last as usize + 1)];
        self.symbols.iter().enumerate().for_each(|(key, symbol)| keys_of[*symbol as usize] = Some(key));
        let wanted = texts.values().iter().map(|symbol| *keys_of.get(*symbol as usize)?);
        let truths = match &self.keys {
            Keys::Narrow(keys) => equal_to(keys.values(), segments, wanted),
            Keys::Wide(keys) => equal_to(keys.values(), segments, wanted),
        };
        let nulls = segments.spread_nulls(texts.nulls());
        let bits = packed(&truths);
        BooleanArray::new(
            if equal { bits } else { !&bits },
            NullBuffer::union(self.keys.array().nulls(), nulls.as_ref()),
        )
    }

    /// True where a text equals one given text (or differs from it, unless `equal`); null where the text is null.
    pub(crate) fn compare_with(&self, text: &UInt32Array, equal: bool) -> BooleanArray {
        if text.is_null(0) {
            return BooleanArray::new_null(self.keys.array().len());
        }
        self.test(|symbol| (symbol == text.value(0)) == equal)
    }

    /// True where the row's symbol satisfies `test`, null where the text is null.
    pub(crate) fn test(&self, test: impl FnMut(u32) -> bool) -> BooleanArray {
        let fulfilled: Vec<bool> = self.symbols.iter().copied().map(test).collect();
        let truths = match &self.keys {
            Keys::Narrow(keys) => look_up(keys.values(), &fulfilled),
            Keys::Wide(keys) => look_up(keys.values(), &fulfilled),
        };
        BooleanArray::new(packed(&truths), self.keys.array().nulls().cloned())
    }
}

fn equal_to<N: ArrowNativeType>(
    keys: &[N],
    segments: Segments<'_>,
    wanted: impl Iterator<Item = Option<usize>>,
) -> Vec<bool> {
    let mut truths = vec![false; keys.len()];
    for ((start, length), wanted) in segments.each().zip(wanted) {
        if let Some(wanted) = wanted.and_then(N::from_usize) {
            let rows = start..start + length;
            for (truth, key) in truths[rows.clone()].iter_mut().zip(&keys[rows]) {
                *truth = *key == wanted;
            }
        }
    }
    truths
}

fn look_up<N: ArrowNativeType>(keys: &[N], fulfilled: &[bool]) -> Vec<bool> {
    let alone = |wanted: bool| {
        let mut keys = (0..fulfilled.len()).filter(|key| fulfilled[*key] == wanted);
        keys.next().filter(|_| keys.next().is_none()).and_then(N::from_usize)
    };
    match (alone(true), alone(false)) {
        (Some(one), _) => keys.iter().map(|key| *key == one).collect(),
        (None, Some(one)) => keys.iter().map(|key| *key != one).collect(),
        (None, None) => keys.iter().map(|key| fulfilled.get(key.as_usize()) == Some(&true)).collect(),
    }
}

fn packed(truths: &[bool]) -> BooleanBuffer {
    BooleanBuffer::new(bits::pack(truths).into(), 0, truths.len())
}

/// Makes NaN and zero unique: comparisons use the total order, which distinguishes several forms of them.
pub(crate) fn canonical(value: f64) -> f64 {
    if value.is_nan() { f64::NAN } else { value + 0.0 }
}

/// The distinct texts of a batch, numbered in order of first appearance.
#[derive(Debug, Default)]
pub(crate) struct Symbols {
    texts: Vec<Arc<str>>,
    numbers: HashMap<Arc<str>, u32>,
}

impl Symbols {
    fn intern(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = u32::try_from(self.texts.len()).expect("a batch has fewer than 2^32 rows");
        let text: Arc<str> = text.into();
        self.texts.push(text.clone());
        self.numbers.insert(text, number);
        number
    }

    pub(crate) fn text(&self, number: u32) -> &str {
        &self.texts[number as usize]
    }

    /// The rank of each symbol in the order of UTF-8 bytes.
    pub(crate) fn ranks(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..).take(self.texts.len()).collect();
        order.sort_unstable_by_key(|&number| self.text(number));
        let mut ranks = vec![0; order.len()];
        (0..).zip(order).for_each(|(rank, number)| ranks[number as usize] = rank);
        ranks
    }

    pub(crate) fn of_coded(&mut self, Coded { keys, texts }: Coded<'_>) -> Keyed {
        let (mut symbols, mut places) = (Vec::new(), HashMap::new());
        let mut key = |text: &str| {
            let symbol = self.intern(text);
            *places.entry(symbol).or_insert_with(|| {
                symbols.push(symbol);
                symbols.len() - 1
            })
        };
        let known: Vec<Option<usize>> = texts.iter().map(|text| text.map(&mut key)).collect();
        if symbols.len() == known.len() {
            return Keyed { keys, symbols };
        }
        let key = |key: Option<usize>| known.get(key?).copied()?.and_then(i32::from_usize);
        let keys: Int32Array = match &keys {
            Keys::Narrow(keys) => keys.iter().map(|old| key(old.map(ArrowNativeType::as_usize))).collect(),
            Keys::Wide(keys) => keys.iter().map(|old| key(old.map(ArrowNativeType::as_usize))).collect(),
        };
        Keyed { keys: Keys::Wide(keys), symbols }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{
        Array, ArrayRef, BooleanArray, DictionaryArray, Int32Array, RecordBatch, StringArray, UInt8Array,
    };
    use arrow::datatypes::Int32Type;
    use proptest::collection::vec;
    use proptest::option;
    use proptest::prelude::*;

    use super::{Coded, Symbols, Texts, Vector};
    use crate::kernels::segments::Segments;

    fn both(symbols: &mut Symbols, known: &[&str], keys: &[Option<u8>]) -> [Vector; 2] {
        let texts = StringArray::from(known.to_vec());
        let wide: Int32Array = keys.iter().map(|key| key.map(i32::from)).collect();
        let wide: ArrayRef = Arc::new(DictionaryArray::<Int32Type>::new(wide, Arc::new(texts.clone())));
        let wide = RecordBatch::try_from_iter([("a", wide)]).unwrap();
        let narrow = Texts { name: "a".into(), keys: UInt8Array::from(keys.to_vec()), texts };
        [&[narrow][..], &[]].map(|texts| {
            let coded = Coded::of(texts, &wide, "a").unwrap();
            Vector::Keyed(Arc::new(symbols.of_coded(coded)))
        })
    }

    fn truths(found: &BooleanArray) -> Vec<Option<bool>> {
        found.iter().collect()
    }

    proptest! {
        #[test]
        fn comparing_keys_equals_comparing_texts(
            episodes in vec((option::of(0..4_usize), vec(option::of(0..3_u8), 1..12)), 1..9), equal in any::<bool>(),
        ) {
            const KNOWN: [&str; 3] = ["red", "blue", "green"];
            const ASKED: [&str; 4] = ["blue", "red", "nowhere", "green"];
            let keys: Vec<Option<u8>> = episodes.iter().flat_map(|(_, keys)| keys).copied().collect();
            let mut offsets = vec![0];
            offsets.extend(episodes.iter().scan(0, |end, (_, keys)| {
                *end += keys.len();
                Some(*end)
            }));
            let mut symbols = Symbols::default();
            let columns = both(&mut symbols, &KNOWN, &keys);
            let asked = episodes.iter().map(|(asked, _)| asked.map(|asked| symbols.intern(ASKED[asked]))).collect();
            let text = |key: Option<u8>| key.map(|key| KNOWN[usize::from(key)]);
            let rows = episodes.iter().flat_map(|(asked, keys)| keys.iter().map(move |key| (asked.map(|at| ASKED[at]), *key)));
            let expected: Vec<_> = rows.map(|(asked, key)| Some((text(key)? == asked?) == equal)).collect();
            let blue = symbols.intern("blue");
            let is_blue: Vec<_> = keys.iter().map(|key| text(*key).map(|text| (text == "blue") == equal)).collect();
            for column in columns.iter().map(Vector::keyed) {
                prop_assert_eq!(&truths(&column.compare(Segments::new(&offsets), &asked, equal)), &expected);
                prop_assert_eq!(&truths(&column.test(|symbol| (symbol == blue) == equal)), &is_blue);
            }
        }
    }

    #[test]
    fn equal_texts_under_two_keys_are_equal() {
        let mut symbols = Symbols::default();
        for column in both(&mut symbols, &["red", "blue", "red"], &[Some(0), None, Some(1), Some(2)]) {
            let found = column.keyed().symbols();
            assert!(found.value(0) == found.value(3) && found.value(0) != found.value(2) && found.is_null(1));
            let red = symbols.intern("red");
            let is_red = column.keyed().test(|symbol| symbol == red);
            assert_eq!(truths(&is_red), [Some(true), None, Some(false), Some(true)]);
        }
    }
}

//! Columns of values while a plan is evaluated, and the texts of a batch as small integers.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use arrow::array::{
    Array, ArrayRef, AsArray as _, BooleanArray, Datum, DictionaryArray, Float64Array, Int64Array, UInt32Array,
};
use arrow::buffer::{BooleanBuffer, NullBuffer};
use arrow::datatypes::{Float64Type, Int32Type, Int64Type, UInt32Type};

use crate::metric::columns::Type;
use crate::metric::plan::Constant;

/// The values of one node: one a step, one an episode, or a single one that stands for all.
#[derive(Clone, Debug)]
pub(super) struct Values {
    held: Held,
    ty: Type,
    single: bool,
}

#[derive(Clone, Debug)]
enum Held {
    Array(ArrayRef),
    /// A column of texts as the trace holds it.
    Coded(Arc<Coded>),
}

impl Datum for Values {
    fn get(&self) -> (&dyn Array, bool) {
        (self.array(), self.single)
    }
}

impl Values {
    /// One value a step or an episode. Text is an array of symbols ([`Symbols`]).
    pub(super) fn new(array: impl Array + 'static, ty: Type) -> Self {
        Self { held: Held::Array(Arc::new(array)), ty, single: false }
    }

    /// The same, shared.
    pub(super) fn shared(array: ArrayRef, ty: Type) -> Self {
        Self { held: Held::Array(array), ty, single: false }
    }

    /// A constant: one value that stands for all.
    pub(super) fn constant(constant: &Constant, ty: Type, symbols: &mut Symbols) -> Self {
        let array: ArrayRef = match (constant, ty) {
            (Constant::Bool(value), _) => Arc::new(BooleanArray::from(vec![*value])),
            (Constant::Int(value), _) => Arc::new(Int64Array::from(vec![*value])),
            (Constant::Float(bits), _) => Arc::new(Float64Array::from(vec![canonical(f64::from_bits(*bits))])),
            (Constant::Text(text), _) => Arc::new(UInt32Array::from(vec![symbols.intern(text)])),
            (Constant::Null, Type::Bool) => Arc::new(BooleanArray::from(vec![None])),
            (Constant::Null, Type::Int) => Arc::new(Int64Array::from(vec![None])),
            (Constant::Null, Type::Float) => Arc::new(Float64Array::from(vec![None])),
            (Constant::Null, Type::Text) => Arc::new(UInt32Array::from(vec![None])),
        };
        Self { held: Held::Array(array), ty, single: true }
    }

    /// The type of the values.
    pub(super) fn ty(&self) -> Type {
        self.ty
    }

    /// The values themselves.
    pub(super) fn array(&self) -> &ArrayRef {
        match &self.held {
            Held::Array(array) => array,
            Held::Coded(coded) => coded.array(),
        }
    }

    /// A column of texts as keys, where that is how it is held.
    pub(super) fn coded(&self) -> Option<&Coded> {
        match &self.held {
            Held::Array(_) => None,
            Held::Coded(coded) => Some(coded),
        }
    }

    /// An array that is null where the values are.
    pub(super) fn validity(&self) -> &dyn Array {
        self.coded().map_or_else(|| self.array().as_ref(), |coded| &coded.keys)
    }

    /// Whether one value stands for all.
    pub(super) fn is_single(&self) -> bool {
        self.single
    }

    /// The values as truth values; the binder has checked the type.
    pub(super) fn bools(&self) -> &BooleanArray {
        self.array().as_boolean()
    }

    /// The values as integers; the binder has checked the type.
    pub(super) fn ints(&self) -> &Int64Array {
        self.array().as_primitive::<Int64Type>()
    }

    /// The values as floats; the binder has checked the type.
    pub(super) fn floats(&self) -> &Float64Array {
        self.array().as_primitive::<Float64Type>()
    }

    /// The values as symbols; the binder has checked the type.
    pub(super) fn symbols(&self) -> &UInt32Array {
        self.array().as_primitive::<UInt32Type>()
    }
}

/// A column of texts: a key a row, and what each key stands for.
#[derive(Debug)]
pub(super) struct Coded {
    keys: UInt32Array,
    /// The symbol of each key; two keys may have one symbol.
    symbols: Vec<u32>,
    /// The symbols of the rows, once they are asked for.
    array: OnceLock<ArrayRef>,
}

impl Coded {
    /// The column of texts.
    pub(super) fn values(keys: UInt32Array, symbols: Vec<u32>) -> Values {
        let coded = Self { keys, symbols, array: OnceLock::new() };
        Values { held: Held::Coded(Arc::new(coded)), ty: Type::Text, single: false }
    }

    fn array(&self) -> &ArrayRef {
        self.array.get_or_init(|| Arc::new(self.of(&self.keys)))
    }

    /// The keys of the rows.
    pub(super) fn keys(&self) -> &UInt32Array {
        &self.keys
    }

    /// The symbols of some keys.
    pub(super) fn of(&self, keys: &UInt32Array) -> UInt32Array {
        // A null's key may be anything; it is masked by the null buffer.
        let symbol = |key: &u32| self.symbols.get(*key as usize).copied().unwrap_or(0);
        UInt32Array::new(keys.values().iter().map(symbol).collect(), keys.nulls().cloned())
    }

    /// Where the texts are equal to others, or where they are not; null where one of them is.
    pub(super) fn equal(&self, others: &UInt32Array, equal: bool) -> BooleanArray {
        let (keys, others, nulls) =
            (self.keys.values(), others.values(), NullBuffer::union(self.keys.nulls(), others.nulls()));
        let symbol = |row: usize| self.symbols.get(keys[row] as usize).copied().unwrap_or(0);
        BooleanArray::new(BooleanBuffer::collect_bool(keys.len(), |row| (symbol(row) == others[row]) == equal), nulls)
    }

    /// The rows whose symbol fulfils `test`, null where the text is null.
    pub(super) fn test(&self, test: impl FnMut(u32) -> bool) -> BooleanArray {
        let fulfilled: Vec<bool> = self.symbols.iter().copied().map(test).collect();
        let keys = self.keys.values();
        let alone = |wanted: bool| {
            let mut keys = fulfilled.iter().zip(0..).filter(|(found, _)| **found == wanted).map(|(_, key)| key);
            keys.next().filter(|_| keys.next().is_none())
        };
        let bits = match (alone(true), alone(false)) {
            (Some(key), _) => compare_with(keys, |found| found == key),
            (None, Some(key)) => compare_with(keys, |found| found != key),
            (None, None) => compare_with(keys, |found| fulfilled.get(found as usize) == Some(&true)),
        };
        BooleanArray::new(bits, self.keys.nulls().cloned())
    }
}

fn compare_with(keys: &[u32], holds: impl Fn(u32) -> bool) -> BooleanBuffer {
    BooleanBuffer::collect_bool(keys.len(), |row| holds(keys[row]))
}

/// One NaN, and one zero: comparisons are by total order, in which these have several forms.
pub(super) fn canonical(value: f64) -> f64 {
    if value.is_nan() { f64::NAN } else { value + 0.0 }
}

/// The distinct texts of a batch, numbered in the order of their coming.
#[derive(Debug, Default)]
pub(super) struct Symbols {
    texts: Vec<Arc<str>>,
    numbers: HashMap<Arc<str>, u32>,
}

impl Symbols {
    /// The number of a text.
    pub(super) fn intern(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = u32::try_from(self.texts.len()).expect("a batch has fewer than 2^32 rows");
        let text: Arc<str> = text.into();
        self.texts.push(text.clone());
        self.numbers.insert(text, number);
        number
    }

    /// The text of a number.
    pub(super) fn text(&self, number: u32) -> &str {
        &self.texts[number as usize]
    }

    /// For each symbol its place in the order of UTF-8 bytes.
    pub(super) fn ranks(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..).take(self.texts.len()).collect();
        order.sort_unstable_by_key(|&number| self.text(number));
        let mut ranks = vec![0; order.len()];
        (0..).zip(order).for_each(|(rank, number)| ranks[number as usize] = rank);
        ranks
    }

    /// A column of texts.
    pub(super) fn of_column(&mut self, column: &DictionaryArray<Int32Type>) -> Values {
        let texts = column.values().as_string::<i32>();
        let symbols: Vec<Option<u32>> = texts.iter().map(|text| text.map(|text| self.intern(text))).collect();
        let keys = column.keys();
        if texts.null_count() > 0 {
            let symbol = |key: Option<i32>| symbols[usize::try_from(key?).ok()?];
            return Values::new(keys.iter().map(symbol).collect::<UInt32Array>(), Type::Text);
        }
        // A valid key is not negative; what stands in the place of nulls does not matter.
        let unsigned = UInt32Array::new(keys.values().inner().clone().into(), keys.nulls().cloned());
        Coded::values(unsigned, symbols.into_iter().flatten().collect())
    }
}

/// The set bits where a truth value is true, null counting as not.
pub(super) fn truths(values: &BooleanArray) -> BooleanBuffer {
    match values.nulls() {
        None => values.values().clone(),
        Some(valid) => values.values() & valid.inner(),
    }
}

/// A null buffer, if any value is null.
pub(super) fn nulls_of(valid: Vec<bool>) -> Option<NullBuffer> {
    if valid.iter().all(|&valid| valid) { None } else { Some(NullBuffer::from(valid)) }
}

//! Kernels that compute each value from the values at the same position. They do not know episodes.

use arrow::array::{
    Array, ArrayRef, ArrowPrimitiveType, AsArray as _, BooleanArray, Datum, Float64Array, Int64Array, PrimitiveArray,
};
use arrow::buffer::{BooleanBuffer, NullBuffer};
use arrow::compute::kernels::{boolean, cmp, numeric};
use arrow::compute::prep_null_mask_filter;
use arrow::datatypes::Float64Type;
use arrow::error::ArrowError;

use crate::kernels::segments::repeat_bool;
use crate::kernels::vectors::{Vector, canonical};
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::{Arithmetic, Comparison};

pub(crate) fn compare(comparison: Comparison, x: &dyn Datum, y: &dyn Datum) -> Result<BooleanArray, ArrowError> {
    match comparison {
        Comparison::Equal => cmp::eq(x, y),
        Comparison::NotEqual => cmp::neq(x, y),
        Comparison::Less => cmp::lt(x, y),
        Comparison::LessEqual => cmp::lt_eq(x, y),
        Comparison::Greater => cmp::gt(x, y),
        Comparison::GreaterEqual => cmp::gt_eq(x, y),
    }
}

pub(crate) fn arithmetic(op: Arithmetic, x: &dyn Datum, y: &dyn Datum) -> Result<ArrayRef, ArrowError> {
    match op {
        Arithmetic::Add => numeric::add(x, y),
        Arithmetic::Subtract => numeric::sub(x, y),
        Arithmetic::Multiply => numeric::mul(x, y),
        Arithmetic::Quotient | Arithmetic::Remainder => unreachable!("the physical plan has a kernel for division"),
    }
}

/// Quotient or remainder towards zero; null where an operand is null or the divisor is 0.
pub(crate) fn divide(op: Arithmetic, a: &Int64Array, b: &Int64Array) -> Result<Int64Array, ArrowError> {
    let one = |pair: (Option<i64>, Option<i64>)| {
        let (Some(a), Some(b)) = pair else { return Ok(None) };
        if b == 0 {
            return Ok(None);
        }
        // The remainder of the smallest integer by -1 is 0, though its quotient overflows.
        let result = if op == Arithmetic::Quotient { a.checked_div(b) } else { Some(a.wrapping_rem(b)) };
        result.map(Some).ok_or_else(|| ArrowError::ArithmeticOverflow(format!("overflow happened on: div({a}, {b})")))
    };
    a.iter().zip(b.iter()).map(one).collect::<Result<Vec<Option<i64>>, _>>().map(Int64Array::from_iter)
}

/// Floats times a power of ten as integers, halves away from zero: in the order of operations that the SQL has, so that
/// engines agree to the last bit.
pub(crate) fn scale(floats: &Float64Array, decimals: u8) -> Result<Int64Array, ArrowError> {
    // Below 2^53, neighbouring integers are different floats.
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    let factor = 10_f64.powi(decimals.into());
    floats.try_unary(|value| {
        let scaled = value * factor;
        let rounded = if value < 0.0 { 0.0 - (0.5 - scaled).floor() } else { (scaled + 0.5).floor() };
        #[expect(clippy::cast_possible_truncation, reason = "a whole number below 2^53")]
        if rounded.abs() < LARGEST { Ok(rounded as i64) } else { Err(ArrowError::CastError(value.to_string())) }
    })
}

pub(crate) fn numbers(array: ArrayRef, ty: Type) -> Vector {
    match ty {
        Type::Float => array.as_primitive::<Float64Type>().unary::<_, Float64Type>(canonical).into(),
        _ => Vector::Array(array),
    }
}

/// The value of the first branch whose condition is true; a null condition is not true.
pub(crate) fn case(branches: &[(&Vector, &Vector)], otherwise: &Vector, ty: Type) -> Vector {
    branches.iter().rev().fold(otherwise.clone(), |result, (when, then)| {
        let mask = when.bools();
        let mask = if mask.null_count() > 0 { prep_null_mask_filter(mask) } else { mask.clone() };
        choose(&mask, then, &result, ty)
    })
}

pub(crate) fn coalesce(values: &[&Vector], ty: Type) -> Result<Vector, ArrowError> {
    let (last, before) = values.split_last().expect("the binder has seen an argument at least");
    before.iter().rev().try_fold((*last).clone(), |result, values| {
        let mask = boolean::is_not_null(values.array())?;
        Ok(choose(&mask, values, &result, ty))
    })
}

/// The values of `then` where the mask is set, and of `otherwise` elsewhere. The mask has no nulls.
fn choose(mask: &BooleanArray, then: &Vector, otherwise: &Vector, ty: Type) -> Vector {
    match ty {
        Type::Bool => choose_bools(mask.values(), then.bools(), otherwise.bools()).into(),
        Type::Int => choose_numbers(mask, then.ints(), otherwise.ints()).into(),
        Type::Float => choose_numbers(mask, then.floats(), otherwise.floats()).into(),
        Type::Text => choose_numbers(mask, then.symbols(), otherwise.symbols()).into(),
    }
}

/// Like `zip`, on whole words of bits. One value of `then` represents all.
fn choose_bools(mask: &BooleanBuffer, then: &BooleanArray, otherwise: &BooleanArray) -> BooleanArray {
    let then = if then.len() == 1 { repeat_bool(then, mask.len()) } else { then.clone() };
    let others = !mask;
    let chosen = |a: &BooleanBuffer, b: &BooleanBuffer| &(a & mask) | &(b & &others);
    let nulls = (then.null_count() + otherwise.null_count() > 0).then(|| {
        let valid = |array: &BooleanArray| match array.nulls() {
            Some(nulls) => nulls.inner().clone(),
            None => BooleanBuffer::new_set(array.len()),
        };
        NullBuffer::new(chosen(&valid(&then), &valid(otherwise)))
    });
    BooleanArray::new(chosen(then.values(), otherwise.values()), nulls)
}

/// Like `zip`, which copies run by run; here the mask changes from row to row. One value of `then` represents all.
fn choose_numbers<T: ArrowPrimitiveType>(
    mask: &BooleanArray,
    then: &PrimitiveArray<T>,
    otherwise: &PrimitiveArray<T>,
) -> PrimitiveArray<T> {
    let bits = mask.values();
    let place = |row: usize| if then.len() == 1 { 0 } else { row };
    let value = |row: usize| if bits.value(row) { then.value(place(row)) } else { otherwise.value(row) };
    let nulls = (then.null_count() + otherwise.null_count() > 0).then(|| {
        let valid = |row| if bits.value(row) { then.is_valid(place(row)) } else { otherwise.is_valid(row) };
        NullBuffer::new(BooleanBuffer::collect_bool(mask.len(), valid))
    });
    PrimitiveArray::new((0..mask.len()).map(value).collect(), nulls)
}

//! Compares the page decoder with the Parquet library on the same bytes. Both refuse, both give the same rows, or the
//! program is stricter for a reason of [`stricter::Reason`].
//!
//! Also, the short cut gives the same rows as the checked path, up to the row at which it gives up. A column that is
//! read has valid headers and checksums.

mod codec;
pub mod mutate;
mod one_column;
mod reference;
mod shape;
pub mod stricter;
mod thrift;

use std::sync::LazyLock;

use arrow::array::{Array as _, ArrayRef, AsArray as _, new_empty_array};
use arrow::compute::{cast, concat};
use arrow::datatypes::{DataType, Float64Type, Int64Type};

use crate::depth::reached;
use crate::quiet;
use mutate::{Mutant, START, mutant};
use one_column::{OneColumn, Refusal};
use stricter::{Depth, Reason};

/// The columns that mutants start from.
static BASES: LazyLock<Vec<shape::Base>> = LazyLock::new(shape::all);

/// The outcome of a mutant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// Both read the same rows.
    Agreed,
    /// Both read the same rows, the library only as keys of a dictionary: as texts it reads ahead into the bytes behind
    /// the last value.
    AgreedOnKeys,
    /// The program reads all rows. The library would also read a header of a size for which it is not asked.
    NotAsked,
    /// Both refuse.
    Refused(Depth),
    /// The program refuses what the library reads.
    Stricter(Reason),
}

/// The number of base columns.
pub fn bases() -> usize {
    BASES.len()
}

/// The target.
pub fn target(data: &[u8]) {
    reached(match outcome(data) {
        Outcome::Agreed | Outcome::AgreedOnKeys | Outcome::NotAsked => "rows",
        Outcome::Stricter(_) => "stricter",
        Outcome::Refused(Depth::Header) => "header",
        Outcome::Refused(Depth::Body) => "body",
        Outcome::Refused(Depth::Levels) => "levels",
        Outcome::Refused(Depth::Values) => "values",
    });
}

/// The outcome of the mutant that these bytes encode.
///
/// # Panics
/// On a disagreement.
pub fn outcome(data: &[u8]) -> Outcome {
    let mutant = mutant(&BASES, data);
    let ours = ours(&mutant);
    let theirs = reference::read(&mutant);
    match (ours, theirs) {
        (Ok(ours), Ok(theirs)) => {
            let theirs = joined(&theirs, ours.data_type());
            assert!(same(&ours, &theirs), "ours {}, the library's {}", shown(&ours), shown(&theirs));
            Outcome::Agreed
        }
        (Ok(ours), Err(_)) if *ours.data_type() == DataType::Utf8 && is_read_as_keys(&mutant, &ours) => {
            Outcome::AgreedOnKeys
        }
        (Ok(_), Err(error)) if error.contains(reference::TOO_LARGE) => Outcome::NotAsked,
        (Ok(ours), Err(error)) => panic!("the library refuses what is read: {error}; read: {}", shown(&ours)),
        (Err(refusal), Err(_)) => Outcome::Refused(depth(&refusal)),
        (Err(refusal), Ok(theirs)) => {
            let known = match &refusal.expected {
                Some(expected) => stricter::of(expected).and_then(|(reason, _)| reason),
                None => (refusal.found == stricter::SPLIT_TEXTS).then_some(Reason::Texts),
            };
            let read = || theirs.iter().map(shown).collect::<String>();
            Outcome::Stricter(
                known.unwrap_or_else(|| panic!("no listed reason: {refusal:?}; the library reads {}", read())),
            )
        }
    }
}

fn is_read_as_keys(mutant: &Mutant, ours: &ArrayRef) -> bool {
    reference::read_keys(mutant).is_ok_and(|theirs| same(ours, &joined(&theirs, ours.data_type())))
}

/// An array as text. It may be an array that only the library accepts and that panics when printed.
fn shown(array: &ArrayRef) -> String {
    quiet::contained(|| format!("{array:?}"))
        .unwrap_or_else(|panic| format!("an array that cannot be printed: {panic}"))
}

fn depth(refusal: &Refusal) -> Depth {
    match &refusal.expected {
        None => Depth::Body,
        Some(expected) => stricter::of(expected).unwrap_or_else(|| panic!("words that are not listed: {expected}")).1,
    }
}

fn ours(mutant: &Mutant) -> Result<ArrayRef, Refusal> {
    let column = OneColumn::new(mutant.metadata.clone(), START, mutant.bytes.clone())?;
    let checked = column.checked(0, mutant.at_once);
    let whole = checked.map(|rows| {
        let first = rows.first().map_or(DataType::Null, |rows| plain(rows.data_type()));
        joined(&rows, &first)
    });
    for runs in [false, true] {
        let (cut, is_whole) = column.short_cut(runs, mutant.at_once).expect("the short cut does not panic");
        let count: usize = cut.iter().map(arrow::array::Array::len).sum();
        match &whole {
            Ok(whole) if whole.data_type() == &DataType::Null => assert_eq!(count, 0),
            Ok(whole) => {
                let begin = joined(&cut, whole.data_type());
                assert!(same(&begin, &whole.slice(0, count)), "the short cut {begin:?}, the checked path {whole:?}");
                if !is_whole && count > 0 && !runs {
                    let rest = column.checked(count, mutant.at_once).expect("a part of what is read");
                    let rest = joined(&rest, whole.data_type());
                    assert!(same(&rest, &whole.slice(count, whole.len() - count)), "from row {count} on: {rest:?}");
                }
            }
            Err(refusal) => assert!(!is_whole, "the short cut reads what is refused: {refusal:?}"),
        }
    }
    if whole.is_ok()
        && let Err(refusal) = column.verified()
    {
        // A page after the last row gives no rows, and only `validate` checks it. The reference refuses any other page
        // with a bad checksum.
        let of_checksum =
            refusal.expected.as_deref().is_some_and(|expected| expected.starts_with("bytes with the CRC-32 "));
        assert!(of_checksum, "what is read has headers that hold: {refusal:?}");
    }
    whole
}

/// The type in which columns are compared.
fn plain(ty: &DataType) -> DataType {
    match ty {
        DataType::Dictionary(_, of) => of.as_ref().clone(),
        other => other.clone(),
    }
}

fn joined(rows: &[ArrayRef], ty: &DataType) -> ArrayRef {
    if *ty == DataType::Null {
        return new_empty_array(ty);
    }
    let rows: Vec<ArrayRef> = rows.iter().map(|rows| cast(rows, ty).expect("a type of the same kind")).collect();
    let rows: Vec<_> = rows.iter().map(AsRef::as_ref).collect();
    if rows.is_empty() { new_empty_array(ty) } else { concat(&rows).expect("arrays of one type") }
}

/// Returns true if the rows are the same; floats are compared bit by bit.
fn same(ours: &ArrayRef, theirs: &ArrayRef) -> bool {
    match ours.data_type() {
        DataType::Float64 => {
            let (ours, theirs) = (ours.as_primitive::<Float64Type>(), theirs.as_primitive::<Float64Type>());
            ours.len() == theirs.len()
                && ours.iter().zip(theirs).all(|(ours, theirs)| ours.map(f64::to_bits) == theirs.map(f64::to_bits))
        }
        DataType::Int64 => ours.as_primitive::<Int64Type>() == theirs.as_primitive::<Int64Type>(),
        _ => ours == theirs,
    }
}

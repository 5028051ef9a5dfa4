//! Finds episodes that copy others under another id: all rows are the same, except the id.
//!
//! A copy counts as an independent episode in every number, so it makes results look more certain than they are.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::num::NonZeroUsize;

use arrow::array::{ArrayRef, AsArray as _, RecordBatch};
use arrow::row::{RowConverter, SortField};
use sha2::{Digest as _, Sha256};

use super::episodes::episode_hash::EPISODE_HASH;
use super::error::TraceError;
use super::read::open::TraceSet;
use super::read::steps::Steps;
use super::schema::Kind;

/// The column that differs in a copy; the hash of its rows includes it.
const EPISODE_ID: &str = "episode_id";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Copied {
    pub episode: String,
    /// The first episode with the same rows.
    pub of: String,
}

/// The copies among these episodes, in the order of the files.
pub fn copies(set: &TraceSet, may_be: BTreeSet<String>, threads: NonZeroUsize) -> Result<Vec<Copied>, TraceError> {
    if may_be.is_empty() {
        return Ok(Vec::new());
    }
    let is_plain = |name: &&str| {
        *name != EPISODE_HASH
            && set.column(name).is_some_and(|column| column.kind != Kind::Unsupported && column.conflict.is_none())
    };
    let columns: Vec<String> = set.column_names().into_iter().filter(is_plain).map(str::to_owned).collect();
    let (mut order, mut hashers) = (Vec::new(), HashMap::<String, Sha256>::new());
    for rows in Steps::new(set, Some(&columns), Some(may_be), threads)? {
        let rows = rows?;
        let Some((ids, bytes)) = without_ids(&rows) else { continue };
        let mut from = 0;
        for (row, bytes) in bytes.iter().enumerate() {
            if row == 0 || ids.value(row) != ids.value(from) {
                from = row;
                if !hashers.contains_key(ids.value(row)) {
                    order.push(ids.value(row).to_owned());
                }
            }
            hashers.entry(ids.value(row).to_owned()).or_default().update(bytes);
        }
    }
    let mut first: BTreeMap<Vec<u8>, String> = BTreeMap::new();
    let mut found = Vec::new();
    for episode in order {
        let hash = hashers.remove(&episode).unwrap_or_default().finalize().to_vec();
        match first.get(&hash) {
            Some(of) => found.push(Copied { episode, of: of.clone() }),
            None => drop(first.insert(hash, episode)),
        }
    }
    Ok(found)
}

fn without_ids(rows: &RecordBatch) -> Option<(&arrow::array::StringArray, Vec<Box<[u8]>>)> {
    let id = rows.schema().index_of(EPISODE_ID).ok()?;
    let ids = rows.column(id).as_string_opt::<i32>()?;
    let others: Vec<ArrayRef> =
        rows.columns().iter().enumerate().filter(|(at, _)| *at != id).map(|(_, values)| values.clone()).collect();
    let fields = others.iter().map(|values| SortField::new(values.data_type().clone())).collect();
    let rows = RowConverter::new(fields).ok()?.convert_columns(&others).ok()?;
    Some((ids, rows.iter().map(|row| row.as_ref().into()).collect()))
}

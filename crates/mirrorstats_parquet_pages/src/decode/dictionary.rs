use std::sync::Arc;

use arrow::array::{
    Array as _, ArrayRef, AsArray as _, DictionaryArray, Int32Array, Int64Array, StringBuilder, UInt8Array,
};
use arrow::buffer::NullBuffer;
use arrow::compute::{TakeOptions, take};

use crate::column::Keys;
use crate::error::Unsupported;

pub(crate) struct Dictionary(ArrayRef);

impl Dictionary {
    pub(crate) fn texts(mut data: &[u8], count: usize) -> Result<Self, Unsupported> {
        let mut texts = StringBuilder::with_capacity(count.min(data.len()), data.len());
        for _ in 0..count {
            let (length, rest) = data.split_first_chunk().ok_or(Unsupported)?;
            let length = usize::try_from(u32::from_le_bytes(*length)).map_err(|_| Unsupported)?;
            let (text, rest) = rest.split_at_checked(length).ok_or(Unsupported)?;
            texts.append_value(std::str::from_utf8(text).map_err(|_| Unsupported)?);
            data = rest;
        }
        Ok(Self(Arc::new(texts.finish())))
    }

    pub(crate) fn ints(data: &[u8], count: usize, long: bool) -> Result<Self, Unsupported> {
        let ints: Vec<i64> = if long {
            data.as_chunks().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
        } else {
            data.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes).into()).collect()
        };
        let ints = ints.get(..count).ok_or(Unsupported)?;
        Ok(Self(Arc::new(Int64Array::from(ints.to_vec()))))
    }

    pub(crate) fn is_small(&self) -> bool {
        self.0.len() <= 1 << u8::BITS
    }

    /// One-byte keys and their values; the key of a null is 0.
    pub(crate) fn keys(&self, keys: Vec<u8>, nulls: Option<NullBuffer>) -> Result<Keys, Unsupported> {
        let keys = UInt8Array::try_new(keys.into(), nulls).map_err(|_| Unsupported)?;
        Keys::new(keys, Arc::clone(&self.0)).ok_or(Unsupported)
    }

    /// The values of keys; the key of a null is 0.
    pub(crate) fn values(&self, keys: Vec<i32>, nulls: Option<NullBuffer>) -> Result<ArrayRef, Unsupported> {
        let keys = Int32Array::try_new(keys.into(), nulls).map_err(|_| Unsupported)?;
        if self.0.as_string_opt::<i32>().is_some() {
            let column = DictionaryArray::try_new(keys, Arc::clone(&self.0)).map_err(|_| Unsupported)?;
            return Ok(Arc::new(column));
        }
        take(&self.0, &keys, Some(TakeOptions { check_bounds: true })).map_err(|_| Unsupported)
    }
}

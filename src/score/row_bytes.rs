//! A row of the episode table as bytes and back: texts, labels, metrics.
//!
//! Rule: bytes compare as the values do, up to the labels. Zero bytes within a text are followed by FF, integers are
//! big-endian with the sign bit turned over.

use std::io;

use arrow::array::{Array as _, Int64Array};
use memchr::memchr;

/// Ends a text, and sorts before anything that could stand there.
const END: [u8; 2] = [0, 0];
/// A zero byte within a text.
const ZERO: [u8; 2] = [0, 0xFF];

pub(super) fn put_text(bytes: &mut Vec<u8>, text: &str) {
    let mut rest = text.as_bytes();
    while let Some(zero) = memchr(0, rest) {
        bytes.extend_from_slice(&rest[..zero]);
        bytes.extend_from_slice(&ZERO);
        rest = &rest[zero + 1..];
    }
    bytes.extend_from_slice(rest);
    bytes.extend_from_slice(&END);
}

const NO_LABEL: u8 = 0;
const LABEL: u8 = 1;

pub(super) fn put_label(bytes: &mut Vec<u8>, label: Option<&str>) {
    match label {
        None => bytes.push(NO_LABEL),
        Some(text) => {
            bytes.push(LABEL);
            put_text(bytes, text);
        }
    }
}

/// An undefined metric.
const UNDEFINED: u8 = 0xFF;
/// A metric whose value follows in eight bytes behind the codes of all; any other code is the value.
const LARGE: u8 = 0xFE;

/// The metrics of some rows, to be written as bytes: a code each, then the values that no code stands for.
pub(super) struct Metrics<'a> {
    metrics: &'a [Int64Array],
    /// The codes of all rows, row by row.
    codes: Vec<u8>,
}

impl<'a> Metrics<'a> {
    pub(super) fn of(metrics: &'a [Int64Array], rows: usize) -> Self {
        let mut codes = vec![UNDEFINED; rows * metrics.len()];
        for (first, metric) in metrics.iter().enumerate() {
            let codes = codes.iter_mut().skip(first).step_by(metrics.len());
            match metric.nulls() {
                None => codes.zip(metric.values()).for_each(|(place, value)| *place = code(*value)),
                Some(nulls) => codes
                    .zip(metric.values().iter().zip(nulls))
                    .for_each(|(place, (value, defined))| *place = if defined { code(*value) } else { UNDEFINED }),
            }
        }
        Self { metrics, codes }
    }

    pub(super) fn put(&self, bytes: &mut Vec<u8>, row: usize) {
        let count = self.metrics.len();
        let codes = &self.codes[row * count..(row + 1) * count];
        bytes.extend_from_slice(codes);
        for (metric, _) in self.metrics.iter().zip(codes).filter(|(_, code)| **code == LARGE) {
            bytes.extend_from_slice(&metric.value(row).to_le_bytes());
        }
    }
}

fn code(value: i64) -> u8 {
    u8::try_from(value).map_or(LARGE, |small| small.min(LARGE))
}

/// What is left of a row's bytes.
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl Bytes<'_> {
    fn take(&mut self, length: usize) -> io::Result<&[u8]> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or_else(damaged)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        self.take(N)?.try_into().map_err(|_| damaged())
    }

    /// Reads a text into a buffer.
    pub(super) fn text(&mut self, text: &mut String) -> io::Result<()> {
        text.clear();
        loop {
            let until = memchr(0, self.0).ok_or_else(damaged)?;
            text.push_str(str::from_utf8(self.take(until)?).map_err(|_| damaged())?);
            match self.array()? {
                END => return Ok(()),
                _ => text.push('\0'),
            }
        }
    }

    pub(super) fn int(&mut self) -> io::Result<i32> {
        Ok(i32::from_be_bytes(self.array()?) ^ i32::MIN)
    }

    pub(super) fn label(&mut self, label: &mut Option<String>) -> io::Result<()> {
        match self.array()? {
            [NO_LABEL] => {
                *label = None;
                Ok(())
            }
            _ => self.text(label.get_or_insert_default()),
        }
    }

    /// Reads so many metrics, the last ones of a row.
    pub(super) fn metrics(mut self, count: usize, metrics: &mut Vec<Option<i64>>) -> io::Result<()> {
        let (codes, rest) = self.0.split_at_checked(count).ok_or_else(damaged)?;
        self.0 = rest;
        metrics.clear();
        for code in codes {
            metrics.push(match *code {
                UNDEFINED => None,
                LARGE => Some(i64::from_le_bytes(self.array()?)),
                small => Some(small.into()),
            });
        }
        Ok(())
    }
}

fn damaged() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "a temporary file was changed by another program")
}

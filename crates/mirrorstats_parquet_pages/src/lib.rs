//! Columns from the pages of Parquet files: verified as stored, and decoded without expanding rows if encodings allow
//! it.
//!
//! | module | contents |
//! |---|---|
//! | `stored` | bytes of a file, page headers compared with the footer, checksums of pages and chunks, decompression |
//! | `decode` | the short cut: runs, keys into small dictionaries, bits; what the Parquet library decodes is checked before |
//! | `column` | rows as runs, as keys, or one by one |
//! | [`bits`] | bits in bytes |
//! | [`checksums`] | a CRC-32 of each column chunk in the footer: written, read |
//! | `expansion`, `footer_shape` | limits: what may come out of a file, and what its footer may be |
//!
//! Rule: [`Cursor`] is only a short cut. Anything unexpected, such as another encoding or damage, is [`Unsupported`]:
//! [`Library`] then decodes the column or reports the problem. This crate does not know the schema of traces, episodes
//! or metrics.
//!
//! A column that is constant stays one run:
//!
//! ```
//! use std::sync::Arc;
//!
//! use arrow::array::{ArrayRef, Int64Array, RecordBatch};
//! use parquet::arrow::ArrowWriter;
//! use parquet::file::metadata::ParquetMetaDataReader;
//! use mirrorstats_parquet_pages::checksums::ChunkChecksums;
//! use mirrorstats_parquet_pages::{Column, Cursor, Form, Place, Store};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let seeds: ArrayRef = Arc::new(Int64Array::from(vec![7; 1000]));
//! let batch = RecordBatch::try_from_iter([("seed", seeds)])?;
//! let mut writer = ArrowWriter::try_new(Vec::new(), batch.schema(), None)?;
//! writer.write(&batch)?;
//! let bytes = bytes::Bytes::from(writer.into_inner()?);
//!
//! let metadata = ParquetMetaDataReader::new().parse_and_finish(&bytes)?;
//! let checksums = ChunkChecksums::default();
//! let place = Place { metadata: &metadata, checksums: &checksums, row_group: 0, column: 0 };
//! let stored = batch.schema().field(0).data_type().clone();
//! let mut cursor = Cursor::open(&Store::of_memory(0, bytes), place, &stored, Form::Runs)?;
//! let Column::Runs(runs) = cursor.read(1000)? else { panic!("runs were asked for") };
//! assert_eq!(runs.starts().count(), 1);
//! assert_eq!(Column::Runs(runs).int(999), Some(7));
//! # Ok(())
//! # }
//! ```

#![warn(clippy::print_stdout, clippy::print_stderr, unreachable_pub)]

pub mod bits;
pub mod checksums;
mod column;
mod decode;
mod error;
mod expansion;
mod footer_shape;
mod stored;
mod thrift;
mod types;

use std::sync::Arc;

use ::parquet::errors::Result;

pub use column::{Column, Keys, Runs, text_at};
pub use decode::cursor::{Cursor, Form};
pub use decode::library::Library;
pub use error::{FaultKind, FaultSlot, PageFault, Part, Unsupported};
pub use expansion::{Expansion, INFLATED_PER_BYTE};
pub use footer_shape::{check_footer, footer_bytes};
pub use stored::bytes::{Place, Store, rows_of};
pub use types::{Refused, normal_column, text_type, with_texts_as_keys};

use stored::verified::Verified;

/// Reads all pages of a column and checks their headers and checksums, without decoding them.
pub fn verify(store: &Store, place: Place<'_>, slot: &FaultSlot) -> Result<()> {
    Verified::new(store, place, Arc::clone(slot))?.walk()
}

//! Takes Parquet files apart into pages, and rebuilds them with changed pages.

use std::sync::{Arc, Mutex};

use bytes::Bytes;
use bytes::buf::{Buf as _, Reader};
use parquet::column::page::PageReader as _;
use parquet::file::metadata::{
    FileMetaData, ParquetMetaData, ParquetMetaDataBuilder, ParquetMetaDataReader, ParquetMetaDataWriter,
};
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

/// A stored page.
#[derive(Clone, Debug)]
pub struct Page {
    pub row_group: usize,
    pub column: String,
    /// True for a dictionary, which is the first of at least two pages.
    pub dictionary: bool,
    /// The positions in the file of its start, and of its bytes after the header.
    pub offset: usize,
    pub body: usize,
    pub end: usize,
}

/// Records which bytes a reader takes for pages.
struct Watched(Bytes, Arc<Mutex<Vec<(usize, usize)>>>);

impl Length for Watched {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }
}

impl ChunkReader for Watched {
    type T = Reader<Bytes>;

    fn get_read(&self, start: u64) -> parquet::errors::Result<Self::T> {
        Ok(self.0.slice(usize::try_from(start).unwrap()..).reader())
    }

    fn get_bytes(&self, start: u64, length: usize) -> parquet::errors::Result<Bytes> {
        let start = usize::try_from(start).unwrap();
        self.1.lock().unwrap().push((start, start + length));
        Ok(self.0.slice(start..start + length))
    }
}

pub fn footer(file: &[u8]) -> ParquetMetaData {
    ParquetMetaDataReader::new().parse_and_finish(&Bytes::copy_from_slice(file)).unwrap()
}

/// All pages of a sound file.
pub fn pages(file: &[u8]) -> Vec<Page> {
    let mut found = Vec::new();
    for (row_group, group) in footer(file).row_groups().iter().enumerate() {
        for chunk in group.columns() {
            let taken = Arc::default();
            let watched = Arc::new(Watched(Bytes::copy_from_slice(file), Arc::clone(&taken)));
            let rows = usize::try_from(group.num_rows()).unwrap();
            let mut reader = SerializedPageReader::new(watched, chunk, rows, None).unwrap();
            let mut offset = usize::try_from(chunk.byte_range().0).unwrap();
            while let Some(page) = reader.get_next_page().unwrap() {
                let (body, end) = *taken.lock().unwrap().last().unwrap();
                let (column, dictionary) = (chunk.column_path().string(), page.is_dictionary_page());
                found.push(Page { row_group, column, dictionary, offset, body, end });
                offset = end;
            }
        }
    }
    found
}

/// Rebuilds the file; `change` gives each page with its header, `last` the footer.
pub fn rebuild(
    file: &[u8],
    change: impl Fn(&Page, &[u8]) -> Vec<u8>,
    last: impl FnOnce(ParquetMetaData) -> ParquetMetaData,
) -> Vec<u8> {
    let (metadata, pages) = (footer(file), pages(file));
    let mut out = b"PAR1".to_vec();
    let mut groups = Vec::new();
    for (row_group, group) in metadata.row_groups().iter().enumerate() {
        let mut chunks = Vec::new();
        for chunk in group.columns() {
            let name = chunk.column_path().string();
            let start = out.len();
            let (mut data, mut dictionary) = (start, None);
            for page in pages.iter().filter(|page| page.row_group == row_group && page.column == name) {
                if page.dictionary {
                    dictionary = Some(i64::try_from(out.len()).unwrap());
                }
                out.extend(change(page, &file[page.offset..page.end]));
                if page.dictionary {
                    data = out.len();
                }
            }
            let chunk = chunk.clone().into_builder().set_data_page_offset(i64::try_from(data).unwrap());
            let chunk = chunk.set_dictionary_page_offset(dictionary);
            let chunk = chunk.set_column_index_offset(None).set_column_index_length(None);
            let chunk = chunk.set_offset_index_offset(None).set_offset_index_length(None);
            let length = i64::try_from(out.len() - start).unwrap();
            chunks.push(chunk.set_total_compressed_size(length).build().unwrap());
        }
        groups.push(group.clone().into_builder().set_column_metadata(chunks).build().unwrap());
    }
    let metadata = last(metadata.into_builder().set_row_groups(groups).set_page_index(None).build());
    ParquetMetaDataWriter::new(&mut out, &metadata).finish().unwrap();
    out
}

/// The footer with another number of rows in every row group and column.
pub fn with_rows(metadata: &ParquetMetaData, rows: i64) -> ParquetMetaData {
    let about = metadata.file_metadata();
    let groups = metadata.row_groups().iter().map(|group| {
        let chunks = group.columns().iter().map(|chunk| chunk.clone().into_builder().set_num_values(rows).build());
        let chunks = chunks.collect::<Result<_, _>>().unwrap();
        group.clone().into_builder().set_num_rows(rows).set_column_metadata(chunks).build().unwrap()
    });
    let groups: Vec<_> = groups.collect();
    let sum = rows.wrapping_mul(i64::try_from(groups.len()).unwrap());
    let about = FileMetaData::new(
        about.version(),
        sum,
        about.created_by().map(str::to_owned),
        about.key_value_metadata().cloned(),
        about.schema_descr_ptr(),
        about.column_orders().cloned(),
    );
    ParquetMetaDataBuilder::new(about).set_row_groups(groups).build()
}

/// A page header in Thrift's compact protocol, with arbitrary numbers.
#[derive(Clone, Copy, Debug)]
pub struct Header {
    /// 0 for a data page, 2 for a dictionary.
    pub kind: i64,
    pub whole: i64,
    pub stored: i64,
    pub values: i64,
    pub encoding: i64,
}

impl Header {
    /// The header's bytes, with these fields after its own.
    pub fn bytes(self, behind: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        for number in [self.kind, self.whole, self.stored] {
            int(&mut out, number);
        }
        // The structure of the kind: field 5 or 7, two or four after the third.
        out.push(if self.kind == 0 { 0x2c } else { 0x4c });
        int(&mut out, self.values);
        int(&mut out, self.encoding);
        if self.kind == 0 {
            // The encodings of levels: RLE.
            int(&mut out, 3);
            int(&mut out, 3);
        }
        out.push(0);
        out.extend(behind);
        out.push(0);
        out
    }
}

/// The next field: an integer.
fn int(out: &mut Vec<u8>, number: i64) {
    out.push(0x15);
    let mut zigzag = ((number << 1) ^ (number >> 63)).cast_unsigned();
    while zigzag >= 0x80 {
        out.push(zigzag.to_le_bytes()[0] | 0x80);
        zigzag >>= 7;
    }
    out.push(zigzag.to_le_bytes()[0]);
}

/// A whole file with a changed byte.
pub fn patched(file: &[u8], at: usize, byte: u8) -> Vec<u8> {
    let mut bytes = file.to_vec();
    bytes[at] = byte;
    bytes
}

/// The output of a child, as text.
pub fn told(output: &std::process::Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

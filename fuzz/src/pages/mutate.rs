//! Mutations of a column, encoded in a few bytes and made where the decoder sees them: pages are compressed and
//! checksummed again afterwards, unless that is what changes.

use bytes::Bytes;
use parquet::file::metadata::ParquetMetaData;

use super::codec::compress;
use super::shape::{Base, Page};

/// The offset of the column in its file, after the magic number.
pub const START: u64 = 4;
/// Bytes that encode one change.
pub const CHANGE: usize = 5;
/// The most changes of a mutant; further bytes are ignored.
const MOST_CHANGES: usize = 12;

/// A column of changed pages.
pub struct Mutant {
    /// The file's footer.
    pub metadata: ParquetMetaData,
    /// Its bytes, from [`START`] on.
    pub bytes: Bytes,
    /// Rows to read at a time.
    pub at_once: usize,
}

/// Changes that are made when a page is written.
#[derive(Clone, Default)]
struct Changes {
    checksum: Option<u8>,
    /// Changed bytes of the header and of the stored body: position and value.
    header: Vec<(usize, u8)>,
    stored: Vec<(usize, u8)>,
    whole: Option<i64>,
    size: Option<i64>,
    /// Bytes to cut off the header's end.
    cut: usize,
}

/// Numbers at the limits of fields.
const ODD: [i64; 12] = [0, 1, -1, 2, 7, 8, 63, 255, 1 << 16, i32::MAX as i64, i32::MIN as i64, 1 << 33];

fn number(old: i64, byte: u8) -> i64 {
    match byte {
        0..=11 => ODD[usize::from(byte)],
        12..=127 => old + i64::from(byte) - 70,
        _ => i64::from(byte) - 128,
    }
}

/// The column that these bytes encode: two choose the base, one the rows per read, the rest are changes.
pub fn mutant(bases: &[Base], data: &[u8]) -> Mutant {
    let (head, rest) = data.split_at(data.len().min(3));
    let head = [0, 1, 2].map(|at| head.get(at).copied().unwrap_or(0));
    let base = &bases[usize::from(u16::from_le_bytes([head[0], head[1]])) % bases.len()];
    let mut pages: Vec<(Page, Changes)> = base.pages.iter().map(|page| (page.clone(), Changes::default())).collect();
    let mut footer = [0_u8; 2];
    for change in rest.chunks_exact(CHANGE).take(MOST_CHANGES) {
        apply(base, &mut pages, &mut footer, change.try_into().expect("chunks are of that length"));
    }
    let mut bytes = Vec::new();
    let (mut data_at, mut dictionary_at) = (None, None);
    for (page, changes) in &pages {
        let place = START.cast_signed() + i64::try_from(bytes.len()).expect("small");
        let first = if page.header.kind == 2 { &mut dictionary_at } else { &mut data_at };
        first.get_or_insert(place);
        write(base, page, changes, &mut bytes);
    }
    Mutant {
        metadata: metadata(base, footer, &bytes, data_at, dictionary_at),
        bytes: bytes.into(),
        at_once: at_once(head[2]),
    }
}

fn at_once(byte: u8) -> usize {
    [1024, 1, 7, 8, 64, 65, 100, 301][usize::from(byte % 8)]
}

fn apply(base: &Base, pages: &mut Vec<(Page, Changes)>, footer: &mut [u8; 2], change: [u8; CHANGE]) {
    let [what, which, low, high, value] = change;
    let place = usize::from(u16::from_le_bytes([low, high]));
    if pages.is_empty() {
        return;
    }
    let at = usize::from(which) % pages.len();
    match what % 18 {
        13 => {
            pages.remove(at);
            return;
        }
        14 => {
            let page = pages[at].clone();
            pages.insert(place % (pages.len() + 1), page);
            return;
        }
        15 => {
            let other = place % pages.len();
            pages.swap(at, other);
            return;
        }
        16 => {
            footer[usize::from(low % 2)] = value;
            return;
        }
        _ => {}
    }
    let (page, changes) = &mut pages[at];
    let levels = levels(base, page);
    match what % 18 {
        0 | 1 => in_values(page, levels, |values| set(values, place, value)),
        2 => in_values(page, levels, |values| flip(values, place, value)),
        3 | 4 => in_levels(page, levels, |levels| set(levels, place, value)),
        5 => in_levels(page, levels, |levels| flip(levels, place, value)),
        // The width of keys and the first run, which matter most.
        6 => in_values(page, levels, |values| set(values, place % 4, value)),
        7 => {
            let fields: Vec<u8> = page.header.own.iter().map(|(field, _)| *field).collect();
            if let Some(field) = fields.get(place % fields.len().max(1)) {
                page.header.set(*field, number(page.header.get(*field), value));
            }
        }
        8 => match low % 4 {
            0 => changes.whole = Some(i64::from(value)),
            1 => changes.size = Some(i64::from(value)),
            2 => page.header.is_compressed = page.header.is_compressed.map(|is| !is),
            _ => page.header.kind = i64::from(value % 5),
        },
        9 => changes.checksum = Some(value),
        10 => changes.stored.push((place, value)),
        11 => changes.header.push((usize::from(low), value)),
        12 => body_length(page, place, value),
        _ => rows_and_values(page, levels, value),
    }
}

fn levels(base: &Base, page: &Page) -> usize {
    match page.header.kind {
        0 if base.optional => {
            let length = page.body.first_chunk().map_or(0, |length| u32::from_le_bytes(*length) as usize);
            (4 + length).min(page.body.len())
        }
        _ => 0,
    }
}

fn in_values(page: &mut Page, levels: usize, change: impl FnOnce(&mut [u8])) {
    let levels = levels.min(page.body.len());
    change(&mut page.body[levels..]);
}

fn in_levels(page: &mut Page, levels: usize, change: impl FnOnce(&mut [u8])) {
    if page.header.kind == 3 {
        change(&mut page.levels);
    } else {
        change(&mut page.body[..levels]);
    }
}

fn set(bytes: &mut [u8], place: usize, value: u8) {
    if !bytes.is_empty() {
        let length = bytes.len();
        bytes[place % length] = value;
    }
}

fn flip(bytes: &mut [u8], place: usize, value: u8) {
    if !bytes.is_empty() {
        let length = bytes.len();
        bytes[place % length] ^= 1 << (value % 8);
    }
}

/// Inserts, removes or appends a byte of the body, or truncates it.
fn body_length(page: &mut Page, place: usize, value: u8) {
    let at = place % (page.body.len() + 1);
    match value % 4 {
        0 => page.body.insert(at, value >> 2),
        1 => drop((at < page.body.len()).then(|| page.body.remove(at))),
        2 => page.body.push(value >> 2),
        _ => page.body.truncate(at),
    }
}

/// Declares another number of rows, both in the page's header and in the first run of its levels or keys.
fn rows_and_values(page: &mut Page, levels: usize, value: u8) {
    let rows = i64::from(value % 64) + 1;
    page.header.set(1, rows);
    if page.header.kind == 3 {
        page.header.set(3, rows);
        set(&mut page.levels, 0, (value % 64 + 1) << 1);
    } else if levels > 4 {
        page.body[4] = (value % 64 + 1) << 1;
    }
    let values = levels.min(page.body.len());
    if page.body.len() > values + 1 {
        page.body[values + 1] = (value % 64 + 1) << 1;
    }
}

fn write(base: &Base, page: &Page, changes: &Changes, out: &mut Vec<u8>) {
    let mut header = page.header.clone();
    let is_plain = header.kind == 3 && (header.is_compressed == Some(false) || page.body.is_empty());
    let mut stored = page.levels.clone();
    if is_plain {
        stored.extend(&page.body);
    } else {
        stored.extend(compress(base.codec, &page.body));
    }
    for (place, value) in &changes.stored {
        set(&mut stored, *place, *value);
    }
    let size = |bytes: usize| i64::try_from(bytes).expect("small");
    header.whole = size(page.levels.len() + page.body.len());
    header.stored = size(stored.len());
    header.whole = changes.whole.map_or(header.whole, |byte| number(header.whole, byte.to_le_bytes()[0]));
    header.stored = changes.size.map_or(header.stored, |byte| number(header.stored, byte.to_le_bytes()[0]));
    header.crc = changes.checksum.map(|value| {
        let crc = i64::from(crc32fast::hash(&stored).cast_signed());
        if value < 160 { crc } else { crc ^ i64::from(value & 31) }
    });
    let mut head = header.bytes();
    for (place, value) in &changes.header {
        set(&mut head, *place, *value);
    }
    head.truncate(head.len() - changes.cut.min(head.len()));
    out.extend(head);
    out.extend(stored);
}

fn metadata(
    base: &Base,
    footer: [u8; 2],
    bytes: &[u8],
    data_at: Option<i64>,
    dictionary_at: Option<i64>,
) -> ParquetMetaData {
    let group = base.metadata.row_group(0);
    let rows = group.num_rows();
    let change = |byte: u8| if byte == 0 { rows } else { (rows + i64::from(byte) - 128).max(0) };
    let chunk = group.column(0).clone().into_builder();
    let chunk =
        chunk.set_data_page_offset(data_at.unwrap_or(START.cast_signed())).set_dictionary_page_offset(dictionary_at);
    let chunk =
        chunk.set_total_compressed_size(i64::try_from(bytes.len()).expect("small")).set_num_values(change(footer[0]));
    let chunk = chunk.set_column_index_offset(None).set_column_index_length(None);
    let chunk = chunk.set_offset_index_offset(None).set_offset_index_length(None);
    let chunk = chunk.build().expect("a column as it was");
    let group = group.clone().into_builder().set_num_rows(change(footer[1])).set_column_metadata(vec![chunk]);
    let groups = vec![group.build().expect("a row group as it was")];
    base.metadata.as_ref().clone().into_builder().set_row_groups(groups).set_page_index(None).build()
}

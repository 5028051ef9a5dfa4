//! Decodes a row group into rows of a few types: bool, integer (64 bits), float (64 bits), text (a dictionary).
//!
//! Rule: decoding any bytes gives rows or a finding, never a panic.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, new_null_array};
use arrow::compute::concat;
use arrow::datatypes::DataType;
use arrow::error::ArrowError;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, RowSelection, RowSelector};
use parquet::basic::Type as Physical;

use super::budget::check_names;
use super::flat::CheckedRows;
use super::footer::trace_file::{Readable, TraceFile};
use super::projection::{EPISODE_ID, Layout, LayoutColumn, T};
use super::statistics::{Chunk, Seen};
use super::verify::damaged;
use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use crate::schema::Kind;
use mirrorstats_parquet_pages::{
    Column, Cursor, FaultSlot, Form, INFLATED_PER_BYTE, Place, Refused, Runs, Store, Unsupported, normal_column,
    rows_of, text_type,
};

/// Rows decoded at a time: columns of this length stay in a core's cache.
const BATCH_ROWS: usize = 32 * 1024;

/// The approximate bytes of one column's texts decoded at a time. The decoder allocates several times that, and lengths
/// of texts differ.
const BATCH_TEXT: u64 = 64 << 20;

#[derive(Clone, Debug)]
pub(crate) struct Rows {
    pub(crate) columns: Vec<Column>,
    pub(crate) row_group: usize,
    pub(crate) first: usize,
    pub(crate) whole: bool,
}

impl Rows {
    pub(crate) fn len(&self) -> usize {
        self.columns[T].len()
    }

    pub(crate) fn slice(&self, start: usize, length: usize) -> Self {
        let columns = self.columns.iter().map(|column| column.slice(start, length)).collect();
        let whole = self.whole && start + length == self.len();
        Self { columns, row_group: self.row_group, first: self.first + start, whole }
    }

    pub(crate) fn episode(&self, row: usize) -> Option<&str> {
        self.columns[EPISODE_ID].text(row)
    }
}

pub(crate) struct Ids {
    pub(crate) runs: Runs,
    pub(crate) begins: bool,
    pub(crate) ends: bool,
}

pub(crate) struct RowGroup<'a> {
    file: &'a TraceFile,
    layout: &'a Layout,
    readable: Arc<Readable>,
    index: usize,
    ids: Option<Ids>,
    sources: Vec<ColumnSource>,
    first: usize,
    at_a_time: usize,
    over: bool,
    seen: Vec<Option<Seen>>,
}

enum ColumnSource {
    Absent,
    /// The ids of the episodes, which are decoded already.
    Ahead,
    Pages {
        root: usize,
        cursor: Box<Cursor>,
    },
    Library(Box<BufferedRows>),
}

/// The rows of the library's reader, whose batches are cut elsewhere than episodes.
struct BufferedRows {
    reader: CheckedRows,
    held: Vec<ArrayRef>,
}

impl BufferedRows {
    fn rows(&self) -> usize {
        self.held.iter().map(Array::len).sum()
    }

    fn take(&mut self, count: usize) -> Result<ArrayRef, ArrowError> {
        if let [values] = self.held.as_slice() {
            let (values, rest) = (values.slice(0, count), values.slice(count, values.len() - count));
            self.held.clear();
            self.held.extend((!rest.is_empty()).then_some(rest));
            return Ok(values);
        }
        let all: Vec<&dyn Array> = self.held.iter().map(AsRef::as_ref).collect();
        self.held = vec![concat(&all)?];
        self.take(count)
    }
}

impl<'a> RowGroup<'a> {
    pub(crate) fn open(
        file: &'a TraceFile,
        layout: &'a Layout,
        row_group: usize,
        ids: Option<Ids>,
    ) -> Result<Self, Box<Finding>> {
        let store = file.store()?;
        let readable = file.footer()?;
        let roots = (0..layout.columns.len()).filter_map(|at| root(file, layout, at));
        let text = roots.filter_map(|root| text_bytes(&readable.footer, root, row_group)).max().unwrap_or(0);
        let at_a_time = rows_at_a_time(file.row_group_rows(row_group), text);
        let (sources, seen) = (Vec::new(), Vec::new());
        let mut rows =
            Self { file, layout, readable, index: row_group, ids, sources, first: 0, at_a_time, over: false, seen };
        rows.seen = (0..layout.columns.len()).map(|at| rows.described(at).map(|_| Seen::default())).collect();
        for at in 0..layout.columns.len() {
            let source = match root(file, layout, at) {
                None => ColumnSource::Absent,
                Some(_) if at == EPISODE_ID && rows.ids.is_some() => ColumnSource::Ahead,
                Some(root) => match contained(|| cursor(&rows.readable, &store, root, row_group, form(layout, at))) {
                    Ok(Ok(cursor)) => ColumnSource::Pages { root, cursor: Box::new(cursor) },
                    Ok(Err(Unsupported)) | Err(_) => rows.library(at, root)?,
                },
            };
            rows.sources.push(source);
        }
        Ok(rows)
    }

    fn library(&self, at: usize, root: usize) -> Result<ColumnSource, Box<Finding>> {
        let reader = self.reader(root, self.first).map_err(|finding| self.placed(at, *finding))?;
        Ok(ColumnSource::Library(Box::new(BufferedRows { reader, held: Vec::new() })))
    }

    fn placed(&self, at: usize, finding: Finding) -> Box<Finding> {
        Box::new(finding.in_row_group(self.index).in_column(&self.layout.columns[at].name))
    }

    fn decode(&mut self) -> Result<Option<Rows>, Box<Finding>> {
        let left = self.file.row_group_rows(self.index) - self.first;
        // Whole episodes if their ends are known.
        let most = self.at_a_time.min(left);
        let count = self.ids.as_ref().filter(|_| left > 0).map_or(most, |ids| ids.runs.until(self.first, most));
        let columns =
            (0..self.sources.len()).map(|at| self.column(at, count).and_then(|column| self.within(at, column)));
        let columns: Vec<Column> = columns.collect::<Result<_, _>>()?;
        let contradicted = self.file.folders().iter().find_map(|folder| {
            let column = &columns[self.layout.position(&folder.column.name)?];
            folder.contradiction(self.file.name(), column)
        });
        if let Some(finding) = contradicted {
            return Err(Box::new(finding.in_row_group(self.index)));
        }
        if count == 0 {
            self.seen.iter_mut().flatten().for_each(Seen::finish);
            return self.check_statistics().map(|()| None);
        }
        for (seen, column) in self.seen.iter_mut().zip(&columns) {
            if let Some(seen) = seen {
                seen.add(column);
            }
        }
        let whole = self.ids.as_ref().is_some_and(|ids| match left - count {
            0 => ids.ends,
            _ => ids.runs.text(self.first + count - 1) != ids.runs.text(self.first + count),
        });
        let rows = Rows { columns, row_group: self.index, first: self.first, whole };
        self.first += count;
        Ok(Some(rows))
    }

    fn described(&self, at: usize) -> Option<&Chunk> {
        let leaf = leaf(&self.readable.footer, root(self.file, self.layout, at)?)?;
        self.file.statistics.chunk(self.index, leaf)
    }

    fn check_statistics(&self) -> Result<(), Box<Finding>> {
        for (at, seen) in self.seen.iter().enumerate() {
            let fault = seen.as_ref().zip(self.described(at)).and_then(|(seen, declared)| seen.fault(declared));
            if let Some((expected, found)) = fault {
                return Err(self.placed(at, Finding::new(Code::CorruptData, self.file.name(), expected, found)));
            }
        }
        Ok(())
    }

    fn within(&self, at: usize, column: Column) -> Result<Column, Box<Finding>> {
        let LayoutColumn { kind, known, .. } = &self.layout.columns[at];
        if *kind != Kind::String {
            return Ok(column);
        }
        let names = if known.is_some_and(|known| known.constant) { check_names(&column) } else { Ok(()) };
        let place = (self.index, root(self.file, self.layout, at).unwrap_or(usize::MAX));
        let checked = names.and_then(|()| self.file.expansion.rows(place, self.first, &column));
        let over = |exceeded| self.placed(at, Finding::over_budget(self.file.name(), &exceeded));
        checked.map(|()| column).map_err(over)
    }

    fn column(&mut self, at: usize, count: usize) -> Result<Column, Box<Finding>> {
        let kind = self.layout.columns[at].kind;
        if let ColumnSource::Pages { root, cursor } = &mut self.sources[at] {
            if let Ok(Ok(column)) = contained(|| cursor.read(count)) {
                return Ok(column);
            }
            let root = *root;
            self.sources[at] = self.library(at, root)?;
        }
        if let (ColumnSource::Ahead, Some(ids)) = (&self.sources[at], &self.ids) {
            return Ok(Column::Runs(ids.runs.slice(self.first, count)));
        }
        let ColumnSource::Library(library) = &mut self.sources[at] else {
            let folder = self.file.folder(&self.layout.columns[at].name);
            let values = folder.map_or_else(
                || Ok(new_null_array(&held_as(kind), count)),
                |folder| folder.repeated(&held_as(kind), count),
            );
            return values.map(Column::Flat).map_err(|error| corrupt(self.file, self.index, &error.to_string()));
        };
        loop {
            let held = library.rows();
            if count == 0 && held > 0 {
                return Err(self.other_rows(self.first + held));
            }
            if held >= count && count > 0 {
                let column = library.take(count);
                return column.map(Column::Flat).map_err(|error| corrupt(self.file, self.index, &error.to_string()));
            }
            let batch = match library.reader.next() {
                Some(Err(finding)) => return Err(self.placed(at, *finding)),
                batch => batch.and_then(Result::ok),
            };
            let Some(batch) = batch else {
                if count == 0 {
                    return Ok(Column::Flat(new_null_array(&held_as(kind), 0)));
                }
                return Err(self.other_rows(self.first + held));
            };
            if count == 0 {
                return Err(self.other_rows(self.first + held + batch.num_rows()));
            }
            let column = contained(|| normal_column(batch.column(0), &held_as(kind)))
                .unwrap_or_else(|panic| Err(Refused::Unreadable(panic)));
            match column {
                Ok(column) => library.held.push(column),
                Err(refused) => return Err(self.refusal(refused, at, self.first + held)),
            }
        }
    }

    fn other_rows(&self, found: usize) -> Box<Finding> {
        let expected = format!("{} rows", self.file.row_group_rows(self.index));
        let finding = Finding::new(Code::CorruptData, self.file.name(), expected, found.to_string());
        Box::new(finding.in_row_group(self.index))
    }

    fn refusal(&self, refused: Refused, column: usize, first: usize) -> Box<Finding> {
        match refused {
            Refused::Unreadable(why) => self.placed(column, *corrupt(self.file, self.index, &why)),
            Refused::TooLarge { row, value } => {
                let expected = format!("a number up to {}", i64::MAX);
                let finding = Finding::new(Code::OutOfRange, self.file.name(), expected, value.to_string());
                let mut finding = self.placed(column, finding);
                finding.episode = self.anew(EPISODE_ID, first).and_then(|ids| ids.text(row).map(str::to_owned));
                finding.t = self.anew(T, first).and_then(|t| t.int(row));
                finding
            }
        }
    }

    fn anew(&self, at: usize, first: usize) -> Option<Column> {
        let root = root(self.file, self.layout, at)?;
        let decoded = self.reader(root, first).ok()?.next()?.ok()?;
        normal_column(decoded.column(0), &held_as(self.layout.columns[at].kind)).ok().map(Column::Flat)
    }

    fn reader(&self, root: usize, first: usize) -> Result<CheckedRows, Box<Finding>> {
        let Readable { footer, chunks } = &*self.readable;
        let rows = rows_of(footer.metadata().row_group(self.index));
        let library = mirrorstats_parquet_pages::Library {
            store: self.file.store()?,
            metadata: Arc::clone(footer.metadata()),
            checksums: chunks.clone(),
            row_groups: vec![self.index],
            slot: FaultSlot::default(),
            writes_out: false,
        };
        let rest = vec![RowSelector::skip(first), RowSelector::select(rows.saturating_sub(first))];
        let selection = (first > 0).then(|| RowSelection::from(rest));
        let column = ProjectionMask::roots(footer.parquet_schema(), [root]);
        let batch = rows.clamp(1, self.at_a_time);
        CheckedRows::open(self.file.name(), &library, column, footer.schema().fields(), batch, selection)
    }
}

impl Iterator for RowGroup<'_> {
    type Item = Result<Rows, Box<Finding>>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let next = self.decode().transpose();
        self.over = !matches!(next, Some(Ok(_)));
        next
    }
}

pub(crate) fn ids(file: &TraceFile, layout: &Layout, row_group: usize) -> Option<Column> {
    let root = root(file, layout, EPISODE_ID)?;
    let (store, readable) = (file.store().ok()?, file.footer().ok()?);
    let read = || cursor(&readable, &store, root, row_group, Form::Runs)?.read(file.row_group_rows(row_group));
    // The reader of the other columns reports what is wrong with them.
    contained(read).ok()?.ok().filter(|ids| check_names(ids).is_ok())
}

fn root(file: &TraceFile, layout: &Layout, at: usize) -> Option<usize> {
    let LayoutColumn { name, left_out, .. } = &layout.columns[at];
    file.columns().iter().position(|column| !left_out && column.name == *name)
}

fn form(layout: &Layout, at: usize) -> Form {
    if at == EPISODE_ID || layout.columns[at].constant { Form::Runs } else { Form::Rows }
}

fn cursor(
    readable: &Readable,
    store: &Store,
    root: usize,
    row_group: usize,
    form: Form,
) -> Result<Cursor, Unsupported> {
    let Readable { footer, chunks } = readable;
    let leaf = leaf(footer, root).ok_or(Unsupported)?;
    let place = Place { metadata: footer.metadata(), checksums: chunks, row_group, column: leaf };
    Cursor::open(store, place, footer.schema().field(root).data_type(), form)
}

fn leaf(footer: &ArrowReaderMetadata, root: usize) -> Option<usize> {
    let schema = footer.parquet_schema();
    (0..schema.num_columns()).find(|leaf| schema.get_column_root_idx(*leaf) == root)
}

/// The bytes of a column's texts in a row group, written out if the file gives that; `None` for other columns.
fn text_bytes(footer: &ArrowReaderMetadata, root: usize, row_group: usize) -> Option<u64> {
    let column = footer.metadata().row_group(row_group).columns().get(leaf(footer, root)?)?;
    let written_out = column.unencoded_byte_array_data_bytes().unwrap_or_default();
    // The file may state too little. This is the most that the first MiB may inflate to; only small files get memory by
    // it.
    let most = column.compressed_size().saturating_mul(INFLATED_PER_BYTE.cast_signed());
    let bytes = u64::try_from(column.uncompressed_size().max(written_out).max(most)).unwrap_or_default();
    (column.column_type() == Physical::BYTE_ARRAY).then_some(bytes)
}

fn rows_at_a_time(rows: usize, text: u64) -> usize {
    let fitting = u64::try_from(rows).unwrap_or(u64::MAX).saturating_mul(BATCH_TEXT).checked_div(text);
    let fitting = fitting.and_then(|rows| usize::try_from(rows).ok()).unwrap_or(usize::MAX);
    fitting.clamp(1, BATCH_ROWS)
}

fn corrupt(file: &TraceFile, row_group: usize, found: &str) -> Box<Finding> {
    Box::new(damaged(file.name(), &FaultSlot::default(), found).in_row_group(row_group))
}

pub(crate) fn held_as(kind: Kind) -> DataType {
    if kind == Kind::String { text_type() } else { kind.data_type() }
}

#[cfg(test)]
mod tests {
    use super::{BATCH_ROWS, BATCH_TEXT, rows_at_a_time};

    #[test]
    fn long_texts_are_decoded_some_rows_at_a_time() {
        for (rows, text, expected) in [
            (0, 0, BATCH_ROWS),
            (100_000, 0, BATCH_ROWS),
            (100_000, 100_000 * 100, BATCH_ROWS),
            (100_000, 100_000 << 16, 1024),
            (10, 10 * BATCH_TEXT, 1),
            (10, u64::MAX, 1),
        ] {
            assert_eq!(rows_at_a_time(rows, text), expected, "{rows} rows, {text} bytes");
        }
    }
}

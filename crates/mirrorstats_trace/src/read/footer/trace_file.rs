//! One trace file: its footer, read and checked against the schema.
//!
//! Rows are not read here. A file is identified by its name and contents, without an open handle, so any number of
//! files can be open at once.

use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use arrow::datatypes::DataType;
use parquet::arrow::arrow_reader::ArrowReaderMetadata;
use parquet::arrow::parquet_to_arrow_schema;
use parquet::basic::ConvertedType;
use parquet::file::metadata::{KeyValue, ParquetMetaData};
use parquet::schema::types::SchemaDescriptor;
use serde_json::Value;

use super::columns::{FileColumn, FolderColumn, folder_columns};
use super::{Extent, Footer, bounds, footer, plain};
use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use crate::footers;
use crate::footers::declared_experiment::{self, DeclaredExperiment};
use crate::inputs::Input;
use crate::read::budget::MOST_COLUMNS;
use crate::read::statistics::DeclaredStatistics as Statistics;
use crate::schema::colors::palette::{DeclaredPalette, Palette};
use crate::schema::{self, COLUMNS, Column, DeclaredColumn, Domain, Kind};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::input;
use mirrorstats_exact::suggest::nearest;
use mirrorstats_parquet_pages::checksums::{Checksums, ChunkChecksums};
use mirrorstats_parquet_pages::{Expansion, Store, rows_of, with_texts_as_keys};

#[derive(Debug)]
pub struct TraceFile {
    input: Input,
    bytes: u64,
    domain: Domain,
    columns: Vec<FileColumn>,
    folders: Vec<FolderColumn>,
    rows: Vec<usize>,
    pub(crate) pairs: Vec<KeyValue>,
    pub(crate) colors: DeclaredPalette,
    experiments: Vec<DeclaredExperiment>,
    checksums: Checksums,
    pub(crate) statistics: Statistics,
    footer: Mutex<Weak<Readable>>,
    pub(crate) expansion: Arc<Expansion>,
}

#[derive(Debug)]
pub(crate) struct Readable {
    pub(crate) footer: ArrowReaderMetadata,
    pub(crate) chunks: ChunkChecksums,
}

impl TraceFile {
    pub fn open(input: &Input) -> Result<Self, Vec<Finding>> {
        let Footer { bytes, metadata, checksums, .. } = footer(input, Extent::Pages)?;
        check_version(&input.name, &metadata)?;
        let columns = columns_of(&input.name, metadata.file_metadata().schema_descr())?;
        let mut pairs = metadata.file_metadata().key_value_metadata().cloned().unwrap_or_default();
        let recording = footers::recording(value(&pairs, schema::RECORDING_KEY));
        let experiments = declared_experiment::of_recording(&input.name, &recording);
        let is_own = value(&pairs, schema::WRITER_KEY).is_some() || !recording.is_null();
        let folders = if is_own { Vec::new() } else { folder_columns(&input.name, &input.path)? };
        let all = with_folders(&columns, &folders);
        let domain = Domain::of_file(|name| all.iter().any(|column| column.name == name), &recording);
        let absent = declared_experiment::absent(experiments.as_deref().unwrap_or_default());
        let mut findings = check_columns(&input.name, &all, domain, &absent);
        findings.extend(bounds::fault(&input.name, bytes, &metadata));
        if !findings.is_empty() {
            return Err(findings);
        }
        let rows = metadata.row_groups().iter().map(rows_of).collect();
        // They are verified, long, and apply only to this file.
        pairs.retain(|pair| pair.key != schema::CHECKSUMS_KEY);
        let colors = DeclaredPalette::from_recording(&input.name, &recording)?;
        let experiments = experiments?;
        readable(&input.name, metadata, &columns)?;
        let statistics = match checksums {
            Checksums::Present => Statistics::default(),
            Checksums::None | Checksums::Stale => footer(input, Extent::Whole)
                .map_or_else(|_| Statistics::default(), |footer| Statistics::from_metadata(&footer.metadata)),
        };
        Ok(Self {
            input: input.clone(),
            bytes,
            domain,
            columns,
            folders,
            rows,
            pairs,
            colors,
            experiments,
            checksums,
            statistics,
            footer: Mutex::default(),
            expansion: Arc::new(Expansion::new(bytes)),
        })
    }

    pub fn name(&self) -> &str {
        &self.input.name
    }

    pub fn reader(&self) -> io::Result<File> {
        input::open(&self.input.path)
    }

    pub(crate) fn store(&self) -> Result<Store, Box<Finding>> {
        let file = self.reader().map_err(|error| Finding::unreadable(self.name(), &error))?;
        Ok(Store::new(file, Arc::clone(&self.expansion)))
    }

    pub fn path(&self) -> &Path {
        &self.input.path
    }

    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    pub const fn domain(&self) -> Domain {
        self.domain
    }

    pub(crate) fn faults_as_mirror(&self) -> Vec<Finding> {
        match self.domain {
            Domain::Mirror => Vec::new(),
            Domain::Own => {
                let all = with_folders(&self.columns, &self.folders);
                check_columns(self.name(), &all, Domain::Mirror, &[])
            }
        }
    }

    pub(crate) fn misdeclared(&self, declared: &[DeclaredColumn]) -> Vec<Finding> {
        let fault = |declared: &DeclaredColumn| {
            let kind = self.column(&declared.name)?.kind.filter(|kind| *kind != declared.kind)?;
            let expected = format!("{}, as the definitions declare it", declared.kind.name());
            Some(Finding::new(Code::WrongType, self.name(), expected, kind.name()).in_column(&declared.name))
        };
        declared.iter().filter_map(fault).collect()
    }

    pub fn columns(&self) -> &[FileColumn] {
        &self.columns
    }

    pub fn folders(&self) -> &[FolderColumn] {
        &self.folders
    }

    /// The column that only the name of a folder has.
    pub fn folder(&self, name: &str) -> Option<&FolderColumn> {
        let is_absent = || !self.columns.iter().any(|column| column.name == name);
        self.folders.iter().find(|folder| folder.column.name == name).filter(|_| is_absent())
    }

    /// A column of the file or, if it has none of the name, of its folders.
    pub fn column(&self, name: &str) -> Option<&FileColumn> {
        self.all_columns().find(|column| column.name == name)
    }

    pub(crate) fn all_columns(&self) -> impl Iterator<Item = &FileColumn> {
        self.columns.iter().chain(self.folders.iter().map(|folder| &folder.column))
    }

    pub fn declares(&self, name: &str) -> bool {
        let Some((column, known)) = self.column(name).zip(self.domain.column(name)) else { return false };
        let has_kind = || column.kind.is_none_or(|kind| kind == known.stored.kind());
        self.domain == Domain::Mirror || has_kind()
    }

    pub fn rows(&self) -> u64 {
        self.rows.iter().map(|rows| *rows as u64).sum()
    }

    pub fn row_groups(&self) -> usize {
        self.rows.len()
    }

    pub(crate) fn row_group_rows(&self, row_group: usize) -> usize {
        self.rows[row_group]
    }

    pub fn checksums(&self) -> Checksums {
        self.checksums
    }

    pub fn palette(&self) -> Option<&Palette> {
        self.colors.palette.as_ref()
    }

    pub fn experiments(&self) -> &[DeclaredExperiment] {
        &self.experiments
    }

    /// The footer's recording; null if missing or not JSON. Parsed on each call to save memory with many files.
    pub fn recording(&self) -> Value {
        footers::recording(self.metadata_value(schema::RECORDING_KEY))
    }

    pub fn metadata_value(&self, key: &str) -> Option<&str> {
        value(&self.pairs, key)
    }

    /// The parts for a reader; strings are read as dictionaries. Cached while a caller holds them.
    pub(crate) fn footer(&self) -> Result<Arc<Readable>, Box<Finding>> {
        let mut held = self.footer.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(footer) = held.upgrade() {
            return Ok(footer);
        }
        let Footer { metadata, chunks, .. } = self.footer_again(Extent::Pages)?;
        let footer = Arc::new(Readable { footer: readable(self.name(), metadata, &self.columns)?, chunks });
        *held = Arc::downgrade(&footer);
        Ok(footer)
    }

    pub(crate) fn footer_again(&self, extent: Extent) -> Result<Footer, Box<Finding>> {
        let again = footer(&self.input, extent)?;
        let columns = columns_of(self.name(), again.metadata.file_metadata().schema_descr()).ok();
        let has_rows = again.metadata.row_groups().iter().map(rows_of).eq(self.rows.iter().copied());
        if again.bytes == self.bytes && has_rows && columns.as_ref() == Some(&self.columns) {
            return Ok(again);
        }
        let expected = "the file as it was when it was opened";
        Err(Box::new(Finding::new(Code::Unreadable, self.name(), expected, "another one in its place")))
    }
}

fn with_folders(columns: &[FileColumn], folders: &[FolderColumn]) -> Vec<FileColumn> {
    let is_new = |folder: &&FolderColumn| columns.iter().all(|column| column.name != folder.column.name);
    columns.iter().chain(folders.iter().filter(is_new).map(|folder| &folder.column)).cloned().collect()
}

fn value<'a>(pairs: &'a [KeyValue], key: &str) -> Option<&'a str> {
    pairs.iter().find(|pair| pair.key == key)?.value.as_deref()
}

/// Files of other writers have no version; their columns are checked all the same.
fn check_version(file: &str, metadata: &ParquetMetaData) -> Result<(), Box<Finding>> {
    let pairs = metadata.file_metadata().key_value_metadata();
    let Some(text) = pairs.and_then(|pairs| value(pairs, schema::VERSION_KEY)) else { return Ok(()) };
    let expected = format!("schema version {}", schema::SCHEMA_VERSION);
    let (code, found) = match text.parse::<u32>() {
        Ok(schema::SCHEMA_VERSION) => return Ok(()),
        Ok(version) if version > schema::SCHEMA_VERSION => (Code::NewerSchema, format!("version {version}")),
        _ => (Code::InvalidMetadata, format!("`{}`", visible(text))),
    };
    Err(Box::new(Finding::new(code, file, expected, found)))
}

pub(crate) fn columns_of(file: &str, descriptor: &SchemaDescriptor) -> Result<Vec<FileColumn>, Vec<Finding>> {
    let corrupt = |found| vec![Finding::new(Code::CorruptFooter, file, "a schema of known types", found)];
    let fields = contained(|| parquet_to_arrow_schema(descriptor, None))
        .map_err(corrupt)?
        .map_err(|error| corrupt(plain(&error)))?;
    let roots = descriptor.root_schema().get_fields();
    let nested: Vec<Finding> =
        roots.iter().filter(|root| root.is_group()).map(|root| is_nested(file, root.name())).collect();
    if !nested.is_empty() {
        return Err(nested);
    }
    let columns = fields.fields().iter().zip(roots).map(|(field, root)| {
        let text = root.get_basic_info().converted_type() == ConvertedType::UTF8;
        let is_single = matches!(field.data_type(), DataType::Float32);
        FileColumn { name: field.name().clone(), kind: kind_of(field.data_type(), text), is_single }
    });
    Ok(columns.collect())
}

/// Lists, structs and maps are refused even if they are not read: their levels declare the number of values, which no
/// count in the file bounds.
pub(crate) fn is_nested(file: &str, column: &str) -> Finding {
    let expected = "a column with one value per row; leave it out, or write its parts as columns of their own";
    Finding::new(Code::WrongType, file, expected, "a list, a struct or a map").in_column(column)
}

fn kind_of(stored: &DataType, text: bool) -> Option<Kind> {
    match stored {
        DataType::Null => None,
        DataType::Boolean => Some(Kind::Bool),
        integer if integer.is_integer() => Some(Kind::Int),
        float if float.is_floating() => Some(Kind::Float),
        // The decoder does not check that text with only a JSON annotation is UTF-8.
        DataType::Utf8 if text => Some(Kind::String),
        _ => Some(Kind::Unsupported),
    }
}

fn check_columns(file: &str, columns: &[FileColumn], domain: Domain, absent: &[&str]) -> Vec<Finding> {
    if let Err(exceeded) = MOST_COLUMNS.check(columns.len() as u64) {
        return vec![Finding::over_budget(file, &exceeded)];
    }
    let (mut findings, mut counts) = (Vec::new(), HashMap::new());
    for column in columns {
        let count = counts.entry(column.name.as_str()).or_insert(0);
        *count += 1;
        if *count == 2 {
            let finding = Finding::new(Code::RepeatedColumn, file, "one column of that name", "more than one");
            findings.push(finding.in_column(&column.name));
        }
    }
    let holds = |known: &&Column| domain == Domain::Mirror || known.required && domain.has(known);
    for known in COLUMNS.iter().filter(holds) {
        let wanted = known.stored.kind();
        match columns.iter().find(|column| column.name == known.name) {
            None if known.required && !absent.contains(&known.name) => {
                let strangers = columns.iter().map(|column| column.name.as_str());
                let like = nearest(known.name, strangers.filter(|name| schema::column(name).is_none()));
                let found = like.map_or("none".to_owned(), |name| format!("none, though there is `{name}`"));
                let expected = format!("a column `{}` of type {}", known.name, wanted.name());
                findings.push(Finding::new(Code::MissingColumn, file, expected, found).in_column(known.name));
            }
            Some(column)
                if column.kind.is_some_and(|kind| kind != wanted) || column.kind.is_none() && !known.nullable =>
            {
                let found = column.kind.map_or("nothing but nulls", Kind::name);
                let finding = Finding::new(Code::WrongType, file, wanted.name(), found);
                findings.push(finding.in_column(known.name));
            }
            None | Some(_) => {}
        }
    }
    findings
}

fn readable(
    file: &str,
    metadata: ParquetMetaData,
    columns: &[FileColumn],
) -> Result<ArrowReaderMetadata, Box<Finding>> {
    let is_text: Vec<bool> = columns.iter().map(|column| column.kind == Some(Kind::String)).collect();
    contained(|| with_texts_as_keys(metadata, &is_text))
        .and_then(|footer| footer.map_err(|error| plain(&error)))
        .map_err(|error| Box::new(Finding::new(Code::CorruptFooter, file, "a readable schema", error)))
}

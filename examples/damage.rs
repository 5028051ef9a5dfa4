//! Makes `fixtures/damaged/`: one tiny trace for each kind of damage, and the README that lists them.
//!
//! `cargo run --example damage` writes the folder again; the bytes are always the same. A test compares them with the
//! committed ones and checks that each file is refused with its code.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Int32Array, Int64Array, RecordBatch, StringArray};
use arrow::compute::{concat_batches, take_record_batch};
use arrow::datatypes::{Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

/// The folder of the files.
const FOLDER: &str = "fixtures/damaged";

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(FOLDER);
    fs::create_dir_all(&folder)?;
    let files = damaged_files()?;
    for file in &files {
        fs::write(folder.join(file.name), &file.bytes)?;
    }
    fs::write(folder.join("README.md"), readme(&files))?;
    println!("wrote {} files to {FOLDER}", files.len() + 1);
    Ok(())
}

/// One damaged trace.
pub struct DamagedFile {
    /// Its name in the folder.
    pub name: &'static str,
    /// The code of the expected finding.
    pub code: &'static str,
    /// The damage.
    pub damage: &'static str,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// All damaged files, in the order of the README.
///
/// # Errors
/// If Arrow or Parquet refuse the rows, which does not happen.
pub fn damaged_files() -> Result<Vec<DamagedFile>, Box<dyn Error>> {
    let mut files = broken_files()?;
    files.extend(broken_schemas()?);
    files.extend(broken_values()?);
    files.extend(broken_episodes()?);
    Ok(files)
}

/// The README: the table of files, and how they are made.
pub fn readme(files: &[DamagedFile]) -> String {
    let mut text = String::from(
        "# Damaged traces\n\nOne tiny file for each kind of damage, the finding that `mirrorstats trace validate` must give \
         for it, and what is wrong.\nMade by `cargo run --example damage`; not recordings of anything.\n\n\
         | file | code | damage |\n|---|---|---|\n",
    );
    for file in files {
        text.extend(["| `", file.name, "` | `", file.code, "` | ", file.damage, " |\n"]);
    }
    text.push_str(
        "\nThe two files of `episode-in-two-files` are sound alone; given together, the second one is refused.\n",
    );
    text
}

/// Files that cannot be read to their end.
fn broken_files() -> Result<Vec<DamagedFile>, Box<dyn Error>> {
    let sound = parquet(&[&sound()], None)?;
    let cut = sound[..sound.len() - 100].to_vec();
    let mut footer = sound.clone();
    let end = footer.len() - 8;
    footer[end - 200..end].fill(0xA5);
    let mut data = sound.clone();
    // The first page starts right after the magic number; its header stays.
    data[40..72].fill(0xA5);
    Ok(vec![
        file("empty.parquet", "empty-file", "0 bytes", Vec::new()),
        file("not-parquet.parquet", "not-parquet", "a line of CSV", b"episode_id,model\nx,y\n".to_vec()),
        file("truncated.parquet", "truncated", "the last 100 bytes are missing", cut),
        file("corrupt-footer.parquet", "corrupt-footer", "200 bytes of the footer are overwritten", footer),
        file("corrupt-data.parquet", "corrupt-data", "32 bytes of a page are overwritten, the footer is sound", data),
    ])
}

/// Files whose footer breaks a rule.
fn broken_schemas() -> Result<Vec<DamagedFile>, Box<dyn Error>> {
    let sound = sound();
    let place = sound.schema().index_of("self_color")?;
    let without: Vec<usize> = (0..sound.num_columns()).filter(|i| *i != place).collect();
    let seeds = StringArray::from(vec!["one"; sound.num_rows()]);
    Ok(vec![
        file("no-rows.parquet", "no-episodes", "all columns and no row", parquet(&[&sound.slice(0, 0)], None)?),
        file(
            "missing-column.parquet",
            "missing-column",
            "`self_color` is not there",
            parquet(&[&sound.project(&without)?], None)?,
        ),
        file("repeated-column.parquet", "repeated-column", "`action` twice", parquet(&[&repeated(&sound)?], None)?),
        file(
            "wrong-type.parquet",
            "wrong-type",
            "`seed` is text",
            parquet(&[&with(&sound, "seed", Arc::new(seeds))?], None)?,
        ),
        file("newer-schema.parquet", "newer-schema", "schema version 99", parquet(&[&sound], Some("99"))?),
        file("invalid-version.parquet", "invalid-metadata", "schema version `one`", parquet(&[&sound], Some("one"))?),
    ])
}

/// Files with an invalid value: at `t = 3` of the first episode, unless stated otherwise.
fn broken_values() -> Result<Vec<DamagedFile>, Box<dyn Error>> {
    let text = |name, code, damage, column: &str, value: Option<&str>| -> Result<DamagedFile, Box<dyn Error>> {
        let sound = sound();
        let kept = sound.column_by_name(column).ok_or("no such column")?;
        let kept = kept.as_any().downcast_ref::<StringArray>().ok_or("no text")?;
        let changed: StringArray = kept.iter().enumerate().map(|(i, v)| if i == 2 { value } else { v }).collect();
        Ok(file(name, code, damage, parquet(&[&with(&sound, column, Arc::new(changed))?], None)?))
    };
    let whole = |name, code, damage, column: &str, values: ArrayRef| -> Result<DamagedFile, Box<dyn Error>> {
        Ok(file(name, code, damage, parquet(&[&with(&sound(), column, values)?], None)?))
    };
    let rows = sound().num_rows();
    let seeds = Int64Array::from(vec![3_000_000_000; rows]);
    let pixels = Int32Array::from_iter_values((0..rows).map(|i| if i == 2 { -1 } else { 5 }));
    let names = StringArray::from(vec!["m".repeat(1025); rows]);
    let experiments = StringArray::from(vec!["E9"; rows]);
    let statuses = StringArray::from_iter_values((0..rows).map(|i| if i == 2 { "fine" } else { "ok" }));
    Ok(vec![
        text("null-in-required.parquet", "null-in-required", "`body_color` is null", "body_color", None)?,
        text("empty-string.parquet", "empty-string", "`self_color` is empty", "self_color", Some(""))?,
        text("invalid-color.parquet", "invalid-color", "`self_color` is `Red`", "self_color", Some("Red"))?,
        text("unknown-action.parquet", "unknown-action", "the action is `jump`", "action", Some("jump"))?,
        text("inconsistent-constant.parquet", "inconsistent-constant", "another `model`", "model", Some("other"))?,
        whole("seed-out-of-range.parquet", "out-of-range", "the seed is 3000000000", "seed", Arc::new(seeds))?,
        whole("over-budget.parquet", "over-budget", "a `model` of 1025 letters", "model", Arc::new(names))?,
        whole("negative-count.parquet", "negative-count", "`mirror_px` is -1", "mirror_px", Arc::new(pixels))?,
        whole(
            "unknown-experiment.parquet",
            "unknown-experiment",
            "the experiment is `E9`, which the paper does not have",
            "experiment",
            Arc::new(experiments),
        )?,
        whole(
            "unknown-reply-status.parquet",
            "unknown-reply-status",
            "a reply status `fine`",
            "reply_status",
            Arc::new(statuses),
        )?,
    ])
}

/// Files whose rows do not form episodes.
fn broken_episodes() -> Result<Vec<DamagedFile>, Box<dyn Error>> {
    let steps = |name, code, damage, t: [i32; 4]| -> Result<DamagedFile, Box<dyn Error>> {
        let t = Int32Array::from_iter_values(t.into_iter().chain(1..=4));
        Ok(file(name, code, damage, parquet(&[&with(&sound(), "t", Arc::new(t))?], None)?))
    };
    let sound = sound();
    let (first, second) = (sound.slice(0, 4), sound.slice(4, 4));
    let again = concat_batches(&sound.schema(), [&first, &second, &first])?;
    let apart = take_record_batch(&sound, &Int32Array::from(vec![0, 1, 4, 5, 6, 7, 2, 3]))?;
    Ok(vec![
        steps("t-gap.parquet", "t-gap", "t = 3 is missing", [1, 2, 4, 5])?,
        steps("t-duplicate.parquet", "t-duplicate", "t = 2 is there twice", [1, 2, 2, 3])?,
        steps("t-from-zero.parquet", "t-start", "t starts at 0", [0, 1, 2, 3])?,
        steps("t-order.parquet", "t-order", "t goes back from 3 to 2", [1, 2, 3, 2])?,
        file("episode-twice.parquet", "episode-twice", "the first episode again at the end", parquet(&[&again], None)?),
        file(
            "episode-apart.parquet",
            "episode-twice",
            "another episode in the midst of one",
            parquet(&[&apart], None)?,
        ),
        file(
            "episode-in-two-files-1.parquet",
            "episode-in-two-files",
            "an episode that the other one has too",
            parquet(&[&first, &second], None)?,
        ),
        file(
            "episode-in-two-files-2.parquet",
            "episode-in-two-files",
            "an episode that the other one has too",
            parquet(&[&second], None)?,
        ),
    ])
}

fn file(name: &'static str, code: &'static str, damage: &'static str, bytes: Vec<u8>) -> DamagedFile {
    DamagedFile { name, code, damage, bytes }
}

/// Two sound episodes of four steps.
fn sound() -> RecordBatch {
    let text = |values: [&str; 8]| Arc::new(StringArray::from(values.to_vec())) as ArrayRef;
    let ints = |values: [i32; 8]| Arc::new(Int32Array::from(values.to_vec())) as ArrayRef;
    let (a, b) = ("E1-m-1-1", "E1-m-1-2");
    let columns = [
        ("episode_id", text([a, a, a, a, b, b, b, b])),
        ("model", text(["m"; 8])),
        ("experiment", text(["E1"; 8])),
        ("seed", ints([1; 8])),
        ("run", ints([1, 1, 1, 1, 2, 2, 2, 2])),
        ("body_color", text(["red"; 8])),
        ("t", ints([1, 2, 3, 4, 1, 2, 3, 4])),
        (
            "action",
            text(["turn_left", "turn_left", "move_forward", "done"].repeat(2).try_into().unwrap_or(["done"; 8])),
        ),
        ("self_color", text(["unknown", "unknown", "red", "red", "unknown", "red", "red", "red"])),
        ("selected_cube", text(["none", "none", "none", "red", "none", "none", "red", "red"])),
        ("mirror_visible", Arc::new(BooleanArray::from([false, true, true, false].repeat(2))) as ArrayRef),
    ];
    RecordBatch::try_from_iter_with_nullable(columns.map(|(name, values)| (name, values, true)))
        .expect("eight rows in every column")
}

/// The rows with one column replaced, or added at the end.
fn with(rows: &RecordBatch, name: &str, values: ArrayRef) -> Result<RecordBatch, Box<dyn Error>> {
    let schema = rows.schema();
    let mut columns: Vec<(&str, ArrayRef)> =
        schema.fields().iter().map(|field| field.name().as_str()).zip(rows.columns().iter().cloned()).collect();
    match columns.iter_mut().find(|(known, _)| *known == name) {
        Some((_, kept)) => *kept = values,
        None => columns.push((name, values)),
    }
    Ok(RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, values)| (name, values, true)))?)
}

fn repeated(rows: &RecordBatch) -> Result<RecordBatch, Box<dyn Error>> {
    let place = rows.schema().index_of("action")?;
    let mut fields: Vec<Arc<Field>> = rows.schema().fields().iter().cloned().collect();
    let mut columns = rows.columns().to_vec();
    fields.push(Arc::clone(&fields[place]));
    columns.push(Arc::clone(&columns[place]));
    Ok(RecordBatch::try_new(Arc::new(Schema::new(fields)), columns)?)
}

/// A Parquet file with these row groups.
fn parquet(row_groups: &[&RecordBatch], version: Option<&str>) -> Result<Vec<u8>, Box<dyn Error>> {
    let version = KeyValue::new("mirrorstats.schema_version".to_owned(), version.unwrap_or("2").to_owned());
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by("examples/damage.rs".to_owned())
        .set_key_value_metadata(Some(vec![version]))
        .build();
    let options = ArrowWriterOptions::new().with_properties(properties).with_skip_arrow_metadata(true);
    let mut writer = ArrowWriter::try_new_with_options(Vec::new(), row_groups[0].schema(), options)?;
    for rows in row_groups {
        writer.write(rows)?;
        writer.flush()?;
    }
    Ok(writer.into_inner()?)
}

//! Small files that ask for much work, such as traces whose rows take less than a byte each.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Cursor, Write as _};
use std::ops::Range;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use arrow::array::{ArrayRef, BooleanArray, DictionaryArray, Int32Array, RecordBatch, StringArray};
use arrow::datatypes::Int32Type;
use mcap::WriteOptions;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::properties::WriterProperties;

use serde_json::json;

use super::program::{Answer, limited, stderr, stdout};

/// The program's limits for an input of 1 MB: memory in KiB and processor time in seconds. An unoptimised build takes
/// ten times as long as an optimised one.
pub const MEMORY: u64 = 512 << 10;
const SECONDS: u32 = 100;

/// The same text in every row.
fn same(text: &str, rows: usize) -> ArrayRef {
    let keys = Int32Array::from(vec![0; rows]);
    Arc::new(DictionaryArray::<Int32Type>::new(keys, Arc::new(StringArray::from(vec![text]))))
}

fn numbered(numbers: Range<usize>) -> ArrayRef {
    Arc::new(StringArray::from_iter_values(numbers.map(|at| format!("{at:07}"))))
}

fn integers(values: impl Iterator<Item = usize>) -> ArrayRef {
    Arc::new(Int32Array::from_iter_values(values.map(|value| i32::try_from(value).unwrap())))
}

/// Writes a trace of less than 1 MiB.
fn write(path: &Path, rows: usize, columns: Vec<(&str, ArrayRef)>) {
    let mut all: Vec<(&str, ArrayRef)> = vec![
        ("episode_id", same("e", rows)),
        ("model", same("m", rows)),
        ("experiment", same("E1", rows)),
        ("seed", integers(std::iter::repeat_n(1, rows))),
        ("run", integers(std::iter::repeat_n(1, rows))),
        ("body_color", same("red", rows)),
        ("t", integers(std::iter::repeat_n(1, rows))),
        ("action", same("done", rows)),
        ("self_color", same("blue", rows)),
        ("selected_cube", same("red", rows)),
        ("mirror_visible", Arc::new(BooleanArray::from(vec![true; rows]))),
    ];
    for (name, values) in columns {
        match all.iter_mut().find(|(known, _)| *known == name) {
            Some(column) => column.1 = values,
            None => all.push((name, values)),
        }
    }
    let (plain, delta) = (Encoding::DELTA_BINARY_PACKED, Encoding::DELTA_BYTE_ARRAY);
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(19).unwrap()))
        .set_max_row_group_row_count(None)
        .set_column_dictionary_enabled("t".into(), false)
        .set_column_encoding("t".into(), plain);
    for name in ["episode_id", "model"] {
        if all.iter().any(|(known, values)| *known == name && values.as_any().is::<StringArray>()) {
            properties = properties.set_column_dictionary_enabled(name.into(), false);
            properties = properties.set_column_encoding(name.into(), delta);
        }
    }
    let batch = RecordBatch::try_from_iter(all).unwrap();
    let mut writer =
        ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), Some(properties.build())).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    let bytes = fs::metadata(path).unwrap().len();
    assert!(bytes < 1 << 20, "{}: {bytes} bytes", path.display());
}

/// One episode with this number of steps.
pub fn long_episode(path: &Path, steps: usize) {
    write(path, steps, vec![("t", integers(1..=steps))]);
}

/// One episode with this number of steps and eight texts that are the same in each of them.
pub fn wide_episode(path: &Path, steps: usize) {
    let texts = ["condition", "fingerprint", "reasoning", "reply", "scene", "summary", "view_description", "word"];
    let texts = texts.map(|name| (name, same("the same", steps)));
    write(path, steps, [("t", integers(1..=steps))].into_iter().chain(texts).collect());
}

/// One episode with a text of 900 bytes in each step.
pub fn long_texts(path: &Path, steps: usize) {
    let text = format!("I am red. {}", "x".repeat(890));
    write(path, steps, vec![("t", integers(1..=steps)), ("identification", same(&text, steps))]);
}

/// Episodes of one step each, with these numbers in their ids.
pub fn many_episodes(path: &Path, numbers: Range<usize>) {
    write(path, numbers.len(), vec![("episode_id", numbered(numbers))]);
}

/// Episodes of one step each, every one of a different model.
pub fn many_models(path: &Path, count: usize) {
    write(path, count, vec![("episode_id", numbered(0..count)), ("model", numbered(0..count))]);
}

/// Writes a deflated log of Inspect, of less than 1 MiB, whose only sample has this JSON; `note` is in its header.
pub fn inspect_log(path: &Path, note: &str, sample: &str) {
    let eval = json!({ "eval_id": "e", "task": "t", "model": "m", "note": note });
    let header = json!({ "version": 2, "status": "success", "eval": eval }).to_string();
    let mut zip = zip::ZipWriter::new(File::create(path).unwrap());
    for (name, text) in [("header.json", header.as_str()), ("samples/1_epoch_1.json", sample)] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    }
    zip.finish().unwrap();
    let bytes = fs::metadata(path).unwrap().len();
    assert!(bytes < 1 << 20, "{}: {bytes} bytes", path.display());
}

/// Episodes of one step each, with as many bodies and claims of different colours.
pub fn many_colors(path: &Path, count: usize) {
    let named = |suffix: &str| -> ArrayRef {
        let letter = |at: usize| char::from(b'a' + u8::try_from(at % 26).unwrap());
        let name = |at: usize| [at / 17_576, at / 676, at / 26, at].map(letter).iter().collect::<String>() + suffix;
        Arc::new(StringArray::from_iter_values((0..count).map(name)))
    };
    let columns = vec![("episode_id", numbered(0..count)), ("body_color", named("x")), ("self_color", named("y"))];
    write(path, count, columns);
}

/// A log whose only chunk unpacks to 200 MiB.
pub fn large_log(path: &Path) {
    fs::write(path, log(1, 200 << 20)).unwrap();
}

/// A log with chunks that each unpack to this many bytes.
pub fn log(chunks: usize, bytes: usize) -> Vec<u8> {
    let options = WriteOptions::new().compression(Some(mcap::Compression::Zstd));
    let mut out = options.compression_threads(0).chunk_size(None).create(Cursor::new(Vec::new())).unwrap();
    let channel = out.add_channel(0, "/episode", "json", &std::collections::BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    for _ in 0..chunks {
        for _ in 0..bytes >> 20 {
            out.write_to_known_channel(&header, &vec![b' '; 1 << 20]).unwrap();
        }
        out.flush().unwrap();
    }
    out.finish().unwrap();
    out.into_inner().into_inner()
}

/// Definitions with `count` metrics.
pub fn definitions(path: &Path, count: usize, value: impl Fn(usize) -> String) {
    let text = (0..count).fold(String::new(), |mut text, at| {
        writeln!(text, "[metric.M{at}]\nvalue = \"{}\"", value(at)).unwrap();
        text
    });
    fs::write(path, text).unwrap();
}

/// The peak memory of a process so far, in KiB; 0 if it has ended.
pub fn peak(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse().ok()).unwrap_or_default()
}

/// The program's answer and its peak memory in KiB, sampled every few milliseconds.
pub fn measured(at: &Path, arguments: &[&str]) -> (Answer, u64) {
    let mut command = limited(at, &format!("ulimit -t {SECONDS}"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    let begun = Instant::now();
    let child = command.spawn().unwrap();
    let watched = watch(&child);
    let output = child.wait_with_output().unwrap();
    let most = watched.join().unwrap();
    let code = output.status.code();
    assert!(code.is_some(), "{arguments:?} was ended after {:?}: {}", begun.elapsed(), stderr(&output));
    let answer = Answer { code: code.unwrap(), stdout: stdout(&output), stderr: stderr(&output) };
    eprintln!("{:>6} MB {:>6.1} s  {}", most >> 10, begun.elapsed().as_secs_f64(), arguments.join(" "));
    (answer, most)
}

fn watch(child: &Child) -> std::thread::JoinHandle<u64> {
    let process = child.id();
    std::thread::spawn(move || {
        let mut most = 0;
        loop {
            match peak(process) {
                0 => return most,
                now => most = most.max(now),
            }
            sleep(Duration::from_millis(3));
        }
    })
}

//! Whatever happens to a trace's bytes, reading gives a finding or sound episodes, and never panics or hangs.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::datatypes::Schema;
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::Projection;
use mirrorstats_trace::validate::validate;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};
use parquet::arrow::ArrowWriter;
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder, WriterVersion};

use crate::harness::traces::{self, reader};

mod checksums;
mod flips;
#[cfg(unix)]
mod hostile;
mod levels;
mod oracle;
mod own_checksums;
mod pages;
mod statistics;
mod texts;

fn episodes() -> Vec<Episode> {
    let step = |t: usize| Step {
        action: Some(Action::ALL[t % 5]),
        self_color: (t > 2).then(|| "red".into()),
        selected_cube: Some("none".into()),
        mirror_visible: t.is_multiple_of(2),
        extra: Extra { mirror_px: i32::try_from(t).ok(), cost_usd: Some(0.5), ..Extra::default() },
    };
    let steps = |i| (0..5 + i).map(step).collect();
    let episode = |i: usize| Episode { run: 2, distractors: Some(1), ..traces::episode(&format!("e{i}"), steps(i)) };
    (0..3).map(episode).collect()
}

fn trace() -> Vec<u8> {
    trace_of(&episodes())
}

fn trace_of(episodes: &[Episode]) -> Vec<u8> {
    let columns = OptionalColumns::used_by(episodes);
    encoded(TraceWriter::new(Vec::new(), &TraceMetadata { recording: None, columns }).unwrap(), episodes)
}

fn encoded(mut encoder: TraceWriter<Vec<u8>>, episodes: &[Episode]) -> Vec<u8> {
    for episode in episodes {
        encoder.write(episode).unwrap();
    }
    encoder.finish().unwrap()
}

/// The same rows as another writer may store them: uncompressed, newer pages, no dictionaries, two row groups.
fn foreign(folder: &Path) -> Vec<u8> {
    let path = folder.join("whole.parquet");
    fs::write(&path, trace()).unwrap();
    let reader = reader(&path);
    let properties = WriterProperties::builder()
        .set_writer_version(WriterVersion::PARQUET_2_0)
        .set_dictionary_enabled(false)
        .set_max_row_group_row_count(Some(10))
        .build();
    let mut writer = ArrowWriter::try_new(Vec::new(), reader.schema().clone(), Some(properties)).unwrap();
    for batch in reader.build().unwrap() {
        writer.write(&batch.unwrap()).unwrap();
    }
    writer.into_inner().unwrap()
}

/// The same rows with these properties, and with all columns nullable.
fn stored(folder: &Path, properties: WriterPropertiesBuilder) -> Vec<u8> {
    stored_as(folder, &trace(), properties)
}

fn stored_as(folder: &Path, trace: &[u8], properties: WriterPropertiesBuilder) -> Vec<u8> {
    let path = folder.join("whole.parquet");
    fs::write(&path, trace).unwrap();
    let reader = reader(&path);
    let fields = reader.schema().fields().iter().map(|field| field.as_ref().clone().with_nullable(true));
    let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
    let mut writer = ArrowWriter::try_new(Vec::new(), Arc::clone(&schema), Some(properties.build())).unwrap();
    for batch in reader.build().unwrap() {
        let rows = RecordBatch::try_new(Arc::clone(&schema), batch.unwrap().columns().to_vec()).unwrap();
        writer.write(&rows).unwrap();
    }
    writer.into_inner().unwrap()
}

/// Validates and scans the bytes; returns the number of steps if the scan succeeds.
fn read(folder: &Path, bytes: &[u8]) -> Option<u64> {
    let input = Input::new(folder.join("damaged.parquet"));
    fs::write(&input.path, bytes).unwrap();
    let validation = validate(std::slice::from_ref(&input), None, NonZeroUsize::MIN).unwrap();
    let scanned = TraceSet::open(&[input]).and_then(|set| {
        let readable =
            set.column_names().into_iter().filter(|name| set.column(name).is_some_and(|c| c.conflict.is_none()));
        let projection = Projection { steps: readable.map(str::to_owned).collect(), ..Projection::default() };
        let mut steps = 0;
        let count = |n: u64| {
            steps += n;
            Ok(())
        };
        set.scan(&projection, NonZeroUsize::MIN, |batch| Ok::<_, TraceError>(batch.steps.num_rows() as u64), count)?;
        Ok(steps)
    });
    match scanned {
        // Validation accepts what a scan accepts.
        Ok(steps) => {
            assert_eq!(validation.count(Severity::Error), 0, "{:?}", validation.findings);
            Some(steps)
        }
        Err(_) => None,
    }
}

/// Changes every `stride`-th byte in some ways.
fn flip_bytes(folder: &Path, whole: &[u8], stride: usize) {
    let mut refused = 0;
    for at in (0..whole.len()).step_by(stride) {
        for mask in [0x01, 0x10, 0x80, 0xFF] {
            let mut bytes = whole.to_vec();
            bytes[at] ^= mask;
            refused += usize::from(read(folder, &bytes).is_none());
        }
    }
    assert!(refused > whole.len() / stride, "{refused} of {} changes are noticed", 4 * whole.len() / stride);
}

#[test]
fn a_changed_byte_gives_a_finding_or_sound_rows() {
    let folder = tempfile::tempdir().unwrap();
    let (own, foreign) = (trace(), foreign(folder.path()));
    assert_eq!((read(folder.path(), &own), read(folder.path(), &foreign)), (Some(18), Some(18)));
    flip_bytes(folder.path(), &own, 11);
    flip_bytes(folder.path(), &foreign, 11);
}

#[test]
fn a_cut_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = trace();
    for length in (0..whole.len()).step_by(5) {
        assert_eq!(read(folder.path(), &whole[..length]), None, "{length} bytes");
    }
}

//! The Arrow tables of a study: episodes as from `score`, steps as in the traces, and differences from another study.

use std::path::Path;

use arrow::array::{Array as _, AsArray as _, RecordBatch};
use arrow::compute::{cast, concat_batches};
use arrow::datatypes::DataType;
use mirrorstats::{DiffRequest, Side, Study, diff, episode_batch, resolve};
use mirrorstats_score::format::Format;
use mirrorstats_study::diff::diff_studies;
use mirrorstats_study::scores;
use mirrorstats_trace::episodes::episode::{Action, Extra, Step};
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::write::{OptionalColumns, write_episodes};

use crate::harness::traces::{episode, rows, write_trace};

#[test]
fn episodes_equal_the_output_of_score() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scores.parquet");
    for (traces, definitions) in [("fixtures/paper", "paper"), ("fixtures/recorded", "extended")] {
        let table = Study::open([traces]).unwrap().definitions(definitions).unwrap().score().unwrap().episodes;
        let mut bytes = Vec::new();
        scores::write(&table, Format::Parquet, &mut bytes, std::num::NonZeroUsize::MIN).unwrap();
        std::fs::write(&path, bytes).unwrap();
        let (batch, written) = (episode_batch(&table).unwrap(), rows(&path));
        assert_eq!(batch.columns(), written.columns(), "{traces}");
        assert_eq!(batch.schema().fields(), written.schema().fields(), "{traces}");
    }
}

/// `a.parquet` with episodes e1 and e2 and poses, `b.parquet` with e3 and without poses.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let step = |x| Step {
        action: Some(Action::TurnLeft),
        extra: Extra { pose_x: Some(x), ..Extra::default() },
        ..Step::default()
    };
    let done = || Step { action: Some(Action::Done), ..Step::default() };
    let posed = |id: &str| episode(id, vec![step(0.5), step(0.25)]);
    write_episodes(&folder.path().join("a.parquet"), None, &[posed("e1"), posed("e2")]).unwrap();
    write_trace(&folder.path().join("b.parquet"), &[episode("e3", vec![done()])], OptionalColumns::NONE);
    folder
}

fn study(folder: &Path) -> Study {
    Study::open([folder.to_str().unwrap()]).unwrap()
}

fn steps(study: &Study, columns: Option<&[String]>) -> RecordBatch {
    let steps = study.steps(columns).unwrap();
    let schema = steps.schema();
    concat_batches(&schema, &steps.collect::<Result<Vec<_>, _>>().unwrap()).unwrap()
}

#[test]
fn steps_have_the_columns_of_all_files_in_the_order_asked_for() {
    let folder = folder();
    let study = study(folder.path());
    let columns = ["pose_x", "t", "episode_id"].map(str::to_owned);
    let found = steps(&study, Some(&columns));
    assert_eq!(found.schema().fields().iter().map(|field| field.name().as_str()).collect::<Vec<_>>(), columns);
    assert_eq!(found.column(2).as_string::<i32>().iter().flatten().collect::<Vec<_>>(), ["e1", "e1", "e2", "e2", "e3"]);
    assert_eq!((found.column(0).null_count(), found.column(0).is_null(4)), (1, true));
    let all = steps(&study, None);
    assert_eq!((all.num_rows(), all.column_by_name("pose_x").unwrap()), (5, found.column(0)));
    let Err(error) = study.steps(Some(&["pose_z".to_owned()])) else { panic!("no trace has this column") };
    assert!(error.cause::<TraceError>().is_some(), "{error}");
}

#[test]
fn a_filter_keeps_the_steps_of_its_episodes() {
    let folder = folder();
    let study = study(folder.path()).filter("length() = 2 and episode_id <> 'e1'").unwrap();
    let found = steps(&study, Some(&["pose_x".to_owned()]));
    assert_eq!((found.num_rows(), found.num_columns()), (2, 1));
    assert_eq!(steps(&study, Some(&[])).num_rows(), 2);
}

#[test]
fn views_have_the_texts_of_the_files() {
    let filter = |study: Study| study.filter("TSA = 1").unwrap();
    let whole = |study: Study| study;
    for path in ["fixtures/paper", "fixtures/recorded"] {
        for study in [whole(Study::open([path]).unwrap()), filter(Study::open([path]).unwrap())] {
            let viewed = study.steps(None).unwrap().with_views();
            let schema = viewed.schema();
            let viewed = concat_batches(&schema, &viewed.collect::<Result<Vec<_>, _>>().unwrap()).unwrap();
            let expected = steps(&study, None);
            assert!(expected.num_rows() > 0);
            for (field, column) in expected.schema().fields().iter().zip(expected.columns()) {
                let found = viewed.column_by_name(field.name()).unwrap();
                assert_eq!(*field.data_type() == DataType::Utf8, *found.data_type() == DataType::Utf8View);
                assert_eq!(&cast(found, field.data_type()).unwrap(), column, "{path}, {}", field.name());
            }
        }
    }
}

#[test]
fn reading_stops_at_a_damaged_page() {
    let folder = folder();
    let path = folder.path().join("a.parquet");
    let study = study(folder.path());
    let mut bytes = std::fs::read(&path).unwrap();
    for byte in &mut bytes[40..80] {
        *byte ^= 0x55;
    }
    std::fs::write(&path, bytes).unwrap();
    let found: Vec<_> = study.steps(None).unwrap().collect();
    assert_eq!((found.len(), found[0].is_err()), (1, true));
}

#[test]
fn two_studies_of_the_same_traces_differ_as_their_definitions_do() {
    let folder = folder();
    let [early, late] = ["early", "late"].map(|name| folder.path().join(format!("{name}.toml")).display().to_string());
    std::fs::write(&early, "[metric.LONG]\nvalue = \"count(t >= 1)\"\n").unwrap();
    std::fs::write(&late, "[metric.LONG]\nvalue = \"count(t >= 2)\"\n").unwrap();
    let by = ["experiment".to_owned()];
    let [old, new] = [&early, &late].map(|name| study(folder.path()).definitions(name).unwrap());
    let [old, new] = [old, new].map(|study| study.by(by.clone()));
    let traces = resolve(&[folder.path().as_os_str().to_owned()], std::io::empty()).unwrap();
    let request = DiffRequest { by: by.to_vec(), ..DiffRequest::default() };
    let expected = diff(&Side::of(&early).unwrap(), &Side::of(&late).unwrap(), &traces, &request).unwrap();
    let found = diff_studies(&old, &new).unwrap();
    assert_eq!(found.changes, expected.changes);
    assert_eq!((found.changes.flips.len(), found.notes.len()), (3, 0));
    assert!(diff_studies(&old, &old).unwrap().changes.is_empty());
}

#[test]
fn studies_of_other_traces_differ_without_timesteps() {
    let folder = folder();
    let of = |file: &str| Study::open([folder.path().join(file).to_str().unwrap()]).unwrap();
    let found = diff_studies(&of("a.parquet"), &of("b.parquet")).unwrap();
    assert!(found.changes.flips.is_empty() && !found.changes.is_empty(), "no episode is on both sides");
    let filtered = study(folder.path()).filter("length() = 1").unwrap();
    assert!(!diff_studies(&study(folder.path()), &filtered).unwrap().changes.is_empty());
}

#[test]
fn an_unknown_table_is_refused_with_the_styles_tables() {
    let options = mirrorstats::ReportOptions { figures: false, ..Default::default() };
    let report = mirrorstats::report(&Study::open(["fixtures/paper"]).unwrap(), &options).unwrap();
    assert_eq!(report.table("main").unwrap().name, "main");
    let error = report.table("mian").unwrap_err().to_string();
    assert!(error.contains("`mian`; it has main") && error.ends_with("did you mean `main`?"), "{error}");
}

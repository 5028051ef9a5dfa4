//! The writer: its output, its refusals, and files that appear whole or not at all.

use std::fs;

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter, write_episodes};
use parquet::file::metadata::{KeyValue, RowGroupMetaData};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};

use crate::harness::traces;

fn episode(id: &str, steps: usize) -> Episode {
    traces::episode(id, vec![Step { action: Some(Action::TurnLeft), ..Step::default() }; steps])
}

fn with_extra(mut episode: Episode, extra: Extra) -> Episode {
    episode.steps[0].extra = extra;
    episode
}

fn encode(metadata: &TraceMetadata, episodes: &[Episode]) -> Vec<u8> {
    let mut encoder = TraceWriter::new(Vec::new(), metadata).unwrap();
    for episode in episodes {
        encoder.write(episode).unwrap();
    }
    encoder.finish().unwrap()
}

#[test]
fn the_same_episodes_give_the_same_bytes() {
    let metadata = TraceMetadata { recording: Some(serde_json::json!({"seed": 1})), ..TraceMetadata::default() };
    let episodes = [episode("a", 3), episode("b", 1)];
    assert_eq!(encode(&metadata, &episodes), encode(&metadata, &episodes));
}

#[test]
fn row_groups_end_where_episodes_do() {
    let episodes: Vec<_> = (0..401).map(|i| episode(&format!("e{i}"), 999)).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.parquet");
    write_episodes(&path, None, &episodes).unwrap();
    let reader = SerializedFileReader::new(fs::File::open(&path).unwrap()).unwrap();
    let rows: Vec<_> = reader.metadata().row_groups().iter().map(RowGroupMetaData::num_rows).collect();
    assert_eq!(rows, [132 * 999, 132 * 999, 132 * 999, 5 * 999]);
}

#[test]
fn only_declared_optional_columns_are_written() {
    let plain = episode("a", 2);
    let seen = with_extra(episode("b", 2), Extra { mirror_px: Some(7), ..Extra::default() });
    assert_eq!(OptionalColumns::used_by([&plain]), OptionalColumns::NONE);
    assert_eq!(OptionalColumns::used_by([&plain, &seen]), OptionalColumns::named(&["mirror_px"]).unwrap());
    assert_eq!(OptionalColumns::named(&["t"]), None);
    let mut encoder = TraceWriter::new(Vec::new(), &TraceMetadata::default()).unwrap();
    let error = encoder.write(&seen).unwrap_err().to_string();
    assert!(error.contains("`mirror_px`, which was not declared"), "{error}");
}

#[test]
fn forbidden_values_are_refused() {
    let nameless = Episode { model: String::new(), ..episode("a", 1) };
    let negative = with_extra(episode("a", 1), Extra { prompt_tokens: Some(-1), ..Extra::default() });
    let costless = with_extra(episode("a", 1), Extra { cost_usd: Some(f64::NAN), ..Extra::default() });
    let status = with_extra(episode("a", 1), Extra { reply_status: Some("fine".into()), ..Extra::default() });
    let mut blank = episode("a", 1);
    blank.steps[0].self_color = Some(String::new());
    let mut capital = episode("a", 1);
    capital.steps[0].self_color = Some("Red".into());
    for (refused, why) in [
        (episode("a", 0), "expected 1 to 2147483647 steps, found 0"),
        (nameless, "expected `model` not to be empty, found ``"),
        (negative, "expected `prompt_tokens` not to be below zero, found -1"),
        (costless, "expected `cost_usd` not to be below zero, found NaN"),
        (status, "expected `reply_status` to be one of ok, repaired"),
        (blank, "expected `self_color` not to be empty"),
        (capital, "expected `self_color` to be the lower-case name of a colour, `unknown`, or null, found `Red`"),
    ] {
        let metadata = TraceMetadata { columns: OptionalColumns::all(), ..TraceMetadata::default() };
        let mut encoder = TraceWriter::new(Vec::new(), &metadata).unwrap();
        let error = encoder.write(&refused).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
        assert_eq!(encoder.finish().unwrap(), encode(&metadata, &[]), "a refused episode leaves no row");
    }
}

#[test]
fn repairs_have_a_column_where_replies_are_read() {
    let repaired = with_extra(episode("a", 2), Extra { reply_repair: Some("code_fence".into()), ..Extra::default() });
    let columns = |agent: serde_json::Value| OptionalColumns::recorded(&serde_json::json!({ "agent": agent }));
    let scripted = columns(serde_json::json!({ "scripted": "oracle" }));
    assert_ne!(scripted, columns(serde_json::json!({ "id": "x" })), "a scripted agent's replies are not read");
    let mut encoder = TraceWriter::new(Vec::new(), &TraceMetadata { recording: None, columns: scripted }).unwrap();
    let error = encoder.write(&repaired).unwrap_err().to_string();
    assert!(error.contains("`reply_repair`, which was not declared"), "{error}");

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let columns = columns(serde_json::json!({ "id": "x" }));
    let mut writer = TraceWriter::create(&path, &TraceMetadata { recording: None, columns }).unwrap();
    writer.write(&repaired).unwrap();
    writer.write(&episode("b", 1)).unwrap();
    writer.commit().unwrap();
    let set = TraceSet::open(&[Input::new(&path)]).unwrap();
    assert!(set.column_names().contains(&"reply_repair") && !set.column_names().contains(&"mark_color"));
    let back: Vec<_> = episode_rows::read(&path).unwrap().iter().map(|rows| rows.episode().unwrap()).collect();
    assert_eq!(back, [repaired, episode("b", 1)]);
}

#[test]
fn a_palette_in_the_recording_applies_to_written_rows() {
    let metadata = |palette: serde_json::Value| TraceMetadata {
        recording: Some(serde_json::json!({ "palette": palette })),
        ..TraceMetadata::default()
    };
    let claiming = |id: &str, color: &str| {
        let mut episode = Episode { body_color: "teal".into(), ..episode(id, 1) };
        episode.steps[0].self_color = Some(color.into());
        episode
    };
    let mut encoder = TraceWriter::new(Vec::new(), &metadata(serde_json::json!(["teal", "magenta"]))).unwrap();
    for color in ["teal", "magenta", "unknown"] {
        encoder.write(&claiming(color, color)).unwrap();
    }
    for (color, help) in [
        ("magneta", "did you mean `magenta`?"),
        ("Teal", "did you mean `teal`?"),
        ("red", "use a name of the palette, or add the colour to the palette"),
        ("none", "`unknown`, or null where the reply gave none"),
    ] {
        let error = encoder.write(&claiming("x", color)).unwrap_err().to_string();
        let why = format!(
            "expected `self_color` to be a colour of the palette (teal, magenta), `unknown`, or null, found `{color}` ({help})"
        );
        assert!(error.contains(&why), "{error}");
    }
    let error = TraceWriter::new(Vec::new(), &metadata(serde_json::json!(["Teal"]))).err().unwrap().to_string();
    assert!(error.contains("`palette` in `mirrorstats.recording` to be a list of lower-case names"), "{error}");
}

#[test]
fn a_repeated_episode_id_is_refused() {
    let mut encoder = TraceWriter::new(Vec::new(), &TraceMetadata::default()).unwrap();
    encoder.write(&episode("a", 1)).unwrap();
    let error = encoder.write(&episode("a", 2)).unwrap_err().to_string();
    assert!(error.contains("expected an id of its own"), "{error}");
}

#[test]
fn a_file_appears_when_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let mut writer = TraceWriter::create(&path, &TraceMetadata::default()).unwrap();
    writer.write(&episode("a", 3)).unwrap();
    assert!(!path.exists());
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "an unfinished trace leaves nothing behind");
    write_episodes(&path, None, &[episode("a", 3)]).unwrap();
    assert!(path.exists());
    let missing = folder.path().join("no/such/folder/a.parquet");
    let error = write_episodes(&missing, None, &[]).unwrap_err().to_string();
    assert!(error.starts_with("cannot write the trace"), "{error}");
}

#[test]
fn another_schema_version_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plain = folder.path().join("plain.parquet");
    write_episodes(&plain, None, &[episode("a", 2)]).unwrap();
    let set = TraceSet::open(&[Input::new(&plain)]).unwrap();
    assert_eq!(set.files()[0].metadata_value("mirrorstats.schema_version"), Some("2"));
    for (version, code) in [("1", "invalid-metadata"), ("0", "invalid-metadata"), ("3", "newer-schema")] {
        let path = folder.path().join("other.parquet");
        let pair = KeyValue::new("mirrorstats.schema_version".to_owned(), version.to_owned());
        let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![pair])).build();
        traces::write_rows(&path, &[traces::rows(&plain)], Some(properties));
        let error = TraceSet::open(&[Input::new(&path)]).unwrap_err().to_string();
        assert!(error.contains(code) && error.contains("expected schema version 2"), "{error}");
    }
}

//! Logs written by Inspect's own package, in every form that it has used.

use std::fs;
use std::io::{Read as _, Write as _};
use std::path::Path;

use serde_json::Value;

use crate::harness::logs;
use crate::harness::program::{Answer, run};

const DEFINITIONS: &str =
    "domain = \"tools\"\n[column.score]\ntype = \"float\"\n[metric.SOLVED]\nvalue = \"first(score = 1) is not null\"\n";

fn import(at: &Path, file: &str, more: &[&str]) -> Answer {
    run(at, &[&["import", file, "-o", "x.parquet", "--definitions", "tools.toml"], more].concat())
}

/// The trace's rows with these columns, as CSV without the header.
fn queried(at: &Path, columns: &str) -> Vec<String> {
    let sql = format!("select {columns} from steps order by seed, run, t");
    let asked = ["query", &sql, "x.parquet", "--definitions", "tools.toml", "--format", "csv"];
    run(at, &asked).done().lines().skip(1).map(str::to_owned).collect()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tools.toml"), DEFINITIONS).unwrap();
    logs::inspect(&folder.path().join("logs"));
    folder
}

#[test]
fn a_log_of_inspect_has_a_step_per_event_in_every_form() {
    const COLUMNS: &str = "model, experiment, seed, run, scene, t, kind, tool, arguments, choice, stop_reason, error, \
        prompt_tokens, completion_tokens, cost_usd, score, score_includes, target, right, odd, asked";
    let folder = folder();
    let at = folder.path();
    let mapped = [
        "--map",
        "right=sample.metadata.right_tool",
        "--map",
        "odd=sample.metadata.odd",
        "--map",
        "asked=sample.input",
    ];
    let mut of_forms = Vec::new();
    for log in ["careful.eval", "careful.json", "chunked/careful.eval", "deflated.eval"] {
        let answer = import(at, &format!("logs/{log}"), &mapped).ends(0);
        assert!(answer.stdout.starts_with("imported 12 episodes, 44 steps"), "{log}: {}", answer.stdout);
        assert!(answer.stderr.contains("left out: 12 events of kind sample_init"), "{log}: {}", answer.stderr);
        #[cfg(feature = "polars")]
        of_forms.push(queried(at, COLUMNS));
    }
    assert!(of_forms.iter().all(|rows| *rows == of_forms[0]), "{of_forms:?}");
    #[cfg(feature = "polars")]
    {
        let first = &of_forms[0][..3];
        let model = |t: u8, choice: &str| {
            format!("mockllm/model,sums,1,1,1,{t},model,,,{choice},,120,7,0.002,1.0,1.0,3,add,,1 + 2?")
        };
        assert_eq!(first[0], model(1, "add,tool_calls"));
        assert_eq!(
            first[1],
            "mockllm/model,sums,1,1,1,2,tool,add,\"{\"\"x\"\":1,\"\"y\"\":2}\",,,,,,,1.0,1.0,3,add,,1 + 2?"
        );
        assert_eq!(first[2], model(3, ",stop"));
        let long = of_forms[0].iter().find(|row| row.contains(",two,")).unwrap();
        assert!(long.contains("1.5,3 + four? Think. Think."), "an attachment stands in for the text: {long}");
    }
}

#[cfg(feature = "polars")]
#[test]
fn errors_limits_and_pooled_messages_are_imported() {
    let folder = folder();
    let at = folder.path();
    let mapped = ["--map", "last=event.input.2.content", "--map", "sent=event.call.request.messages.0.content"];
    import(at, "logs/hasty.eval", &mapped).ends(0);
    let failed = queried(at, "case when error is null then '' else tool || ': ' || error end, score, t");
    assert!(failed.iter().any(|row| row.starts_with("look_up: locked") || row.contains("look_up: ")), "{failed:?}");
    let rows = queried(at, "seed, run, t, kind, last, sent");
    assert_eq!(rows[2], "1,1,3,model,unknown,1 + 2?");
}

/// Copies the archive with changed members.
fn rewritten(from: &Path, to: &Path, change: impl Fn(&str, Vec<u8>) -> Option<Vec<u8>>) {
    let mut source = zip::ZipArchive::new(fs::File::open(from).unwrap()).unwrap();
    let mut target = zip::ZipWriter::new(fs::File::create(to).unwrap());
    for index in 0..source.len() {
        let mut member = source.by_index(index).unwrap();
        let (name, mut bytes) = (member.name().to_owned(), Vec::new());
        member.read_to_end(&mut bytes).unwrap();
        if let Some(bytes) = change(&name, bytes) {
            target.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            target.write_all(&bytes).unwrap();
        }
    }
    target.finish().unwrap();
}

#[test]
fn damaged_logs_are_refused_with_the_member() {
    let folder = folder();
    let at = folder.path();
    let log = at.join("logs/deflated.eval");
    let sample = "samples/sky_epoch_2.json";
    let with = |change: &dyn Fn(&mut Value)| {
        rewritten(&log, &at.join("bad.eval"), |name, bytes| {
            if name != sample {
                return Some(bytes);
            }
            let text = String::from_utf8(bytes).unwrap().replace("NaN", "null");
            let mut value = serde_json::from_str(&text).unwrap();
            change(&mut value);
            Some(value.to_string().into_bytes())
        });
        import(at, "bad.eval", &[])
    };
    let told = with(&|sample| drop(sample.as_object_mut().unwrap().remove("epoch"))).refused();
    assert!(told.contains(&format!("bad.eval, {sample}\n  expected an `epoch` of the sample")), "{told}");
    let told = with(&|sample| *sample = Value::Null).refused();
    assert!(told.contains(&format!("bad.eval, {sample}\n  expected JSON of Inspect")), "{told}");
    with(&|sample| sample["events"] = Value::Null).done();
    let told = with(&|sample| sample["events"][0]["output"] = serde_json::json!([1])).done();
    assert!(told.contains("12 episodes"), "{told}");
    rewritten(&log, &at.join("bad.eval"), |name, bytes| (name != "header.json").then_some(bytes));
    import(at, "bad.eval", &[]).done();
    rewritten(&log, &at.join("bad.eval"), |name, bytes| name.starts_with("samples/").then_some(bytes));
    let told = import(at, "bad.eval", &[]).refused();
    assert!(told.contains("found neither `header.json` nor a journal"), "{told}");
    let whole = fs::read(&log).unwrap();
    fs::write(at.join("bad.eval"), &whole[..whole.len() / 2]).unwrap();
    let told = import(at, "bad.eval", &[]).refused();
    assert!(told.contains("inspect log recover"), "{told}");
    let whole = fs::read(at.join("logs/careful.eval")).unwrap();
    for byte in (0..whole.len()).step_by(499) {
        let mut bytes = whole.clone();
        bytes[byte] ^= 0x55;
        fs::write(at.join("bad.eval"), bytes).unwrap();
        let answer = import(at, "bad.eval", &[]);
        assert!(
            answer.code == 0 || answer.code == 2 && answer.stderr.contains("bad.eval"),
            "{byte}: {}",
            answer.stderr
        );
        assert!(!answer.stderr.contains("panicked"), "{byte}: {}", answer.stderr);
    }
    let json = fs::read_to_string(at.join("logs/careful.json")).unwrap();
    fs::write(at.join("bad.json"), &json[..json.len() / 2]).unwrap();
    let told = import(at, "bad.json", &[]).refused();
    assert!(told.contains("bad.json\n  expected a log of Inspect") && told.contains("EOF"), "{told}");
    fs::write(at.join("bad.json"), json.replace("\"epoch\"", "\"time\"")).unwrap();
    let told = import(at, "bad.json", &[]).refused();
    assert!(told.contains("bad.json, sample 1\n  expected an `epoch`"), "{told}");
}

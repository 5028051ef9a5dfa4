//! Tables keep their values: what Parquet and CSV hold is in the trace, unchanged, or is refused by row and column.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, BinaryArray, BooleanArray, Decimal128Array, DurationMillisecondArray, Float32Array, Float64Array,
    Int64Array, NullArray, RecordBatch, StringArray, TimestampMicrosecondArray, UInt64Array,
};
use arrow::datatypes::Float16Type;

use crate::harness::program::{run, run_with_input};
use crate::harness::traces::{rows, write_rows};

const DEFINITIONS: &str = r#"
domain = "arms"
[column.reward]
type = "float"
[column.count]
type = "int"
[metric.OVER]
value = "count(reward > 0.3)"
[metric.GIVEN]
value = "count(reward is not null)"
[metric.SUM]
value = "sum(count)"
"#;

const WITH: [&str; 4] = ["-o", "x.parquet", "--definitions", "arms.toml"];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arms.toml"), DEFINITIONS).unwrap();
    folder
}

/// A table with the identity of one episode of two steps, and these columns.
fn table(columns: Vec<(&str, ArrayRef)>) -> RecordBatch {
    let texts = |text: &str| Arc::new(StringArray::from(vec![text; 2])) as ArrayRef;
    let ones = || Arc::new(Int64Array::from(vec![1, 1])) as ArrayRef;
    let identity = [
        ("episode_id", texts("e")),
        ("model", texts("act")),
        ("experiment", texts("reach")),
        ("seed", ones()),
        ("run", ones()),
        ("t", Arc::new(Int64Array::from(vec![1, 2])) as ArrayRef),
    ];
    let given = |name: &str| columns.iter().any(|(own, _)| *own == name);
    let identity: Vec<_> = identity.into_iter().filter(|(name, _)| !given(name)).collect();
    let all = identity.into_iter().chain(columns).map(|(name, values)| (name, values, true));
    RecordBatch::try_from_iter_with_nullable(all).unwrap()
}

fn imported(at: &Path, columns: Vec<(&str, ArrayRef)>) -> RecordBatch {
    write_rows(&at.join("in.parquet"), &[table(columns)], None);
    run(at, &[&["import", "in.parquet"], &WITH[..]].concat()).done();
    rows(&at.join("x.parquet"))
}

fn scores(at: &Path, trace: &str) -> String {
    let told = run(at, &["score", trace, "--definitions", "arms.toml"]).done();
    told.lines().nth(1).unwrap().split(',').skip(5).take(3).collect::<Vec<_>>().join(",")
}

#[test]
fn numbers_of_any_width_keep_their_value() {
    let folder = folder();
    let at = folder.path();
    let half = arrow::array::PrimitiveArray::<Float16Type>::from_iter_values(
        [0.1_f32, 2.0].map(<Float16Type as arrow::array::ArrowPrimitiveType>::Native::from_f32),
    );
    let found = imported(
        at,
        vec![
            ("reward", Arc::new(Float32Array::from(vec![0.3, f32::INFINITY]))),
            ("half", Arc::new(half)),
            ("odd", Arc::new(Float64Array::from(vec![f64::NAN, f64::NEG_INFINITY]))),
            ("wide", Arc::new(Int64Array::from(vec![9_007_199_254_740_993, i64::MIN]))),
            ("count", Arc::new(Float64Array::from(vec![Some(3.0), None]))),
        ],
    );
    let floats =
        |name: &str| found.column_by_name(name).unwrap().as_any().downcast_ref::<Float64Array>().unwrap().clone();
    assert_eq!(floats("reward").values().as_ref(), [f64::from(0.3_f32), f64::INFINITY]);
    assert_eq!(floats("half").values()[0].to_bits(), 0.099_975_585_937_5_f64.to_bits());
    assert!(floats("odd").value(0).is_nan() && floats("odd").value(1) == f64::NEG_INFINITY);
    let integers =
        |name: &str| found.column_by_name(name).unwrap().as_any().downcast_ref::<Int64Array>().unwrap().clone();
    assert_eq!(integers("wide").values().as_ref(), [9_007_199_254_740_993, i64::MIN]);
    assert_eq!(integers("count").iter().collect::<Vec<_>>(), [Some(3), None]);
    write_rows(
        &at.join("in.parquet"),
        &[table(vec![
            ("reward", Arc::new(Float32Array::from(vec![0.3, f32::INFINITY]))),
            ("count", Arc::new(Int64Array::from(vec![Some(3), None]))),
        ])],
        None,
    );
    assert_eq!(scores(at, "in.parquet"), "2,2,3");
    assert_eq!(scores(at, "x.parquet"), "2,2,3");
}

#[test]
fn times_texts_and_decimal_numbers_are_taken() {
    let folder = folder();
    let times = TimestampMicrosecondArray::from(vec![Some(1_767_225_600_000_000), None]);
    let found = imported(
        folder.path(),
        vec![
            ("utc", Arc::new(times.clone().with_timezone("UTC"))),
            ("zone", Arc::new(times.clone().with_timezone("Europe/Berlin"))),
            ("local", Arc::new(times)),
            ("bytes", Arc::new(BinaryArray::from(vec![Some("é".as_bytes()), None]))),
            ("price", Arc::new(Decimal128Array::from(vec![125, 300]).with_precision_and_scale(10, 2).unwrap())),
        ],
    );
    let text = |name: &str| {
        let column = found.column_by_name(name).unwrap().as_any().downcast_ref::<StringArray>().unwrap().clone();
        column.value(0).to_owned()
    };
    assert_eq!(
        [text("utc"), text("zone"), text("local"), text("bytes")],
        ["2026-01-01T00:00:00Z", "2026-01-01T00:00:00Z", "2026-01-01T00:00:00", "é"]
    );
    let price = found.column_by_name("price").unwrap().as_any().downcast_ref::<Float64Array>().unwrap();
    assert_eq!(price.values().as_ref(), [1.25, 3.0]);
}

#[test]
fn values_that_do_not_fit_are_refused_by_row_and_column() {
    let folder = folder();
    let at = folder.path();
    let refused = |columns| {
        write_rows(&at.join("in.parquet"), &[table(columns)], None);
        run(at, &[&["import", "in.parquet"], &WITH[..]].concat()).refused()
    };
    let told = refused(vec![("big", Arc::new(UInt64Array::from(vec![1, u64::MAX])) as ArrayRef)]);
    assert!(told.contains("in.parquet, row 2, key `big`") && told.contains("found 18446744073709551615"), "{told}");
    let decimals = |first: i128| {
        let values = Decimal128Array::from(vec![first, 900_719_925_474_099_301]);
        vec![("own", Arc::new(values.with_precision_and_scale(38, 2).unwrap()) as ArrayRef)]
    };
    for (columns, words) in [
        (decimals(1), "row 2, key `own`\n  expected an integer of at most"),
        (decimals(1_234_567_890_123_456_789_012), "found 12345678901234567890.12"),
        (
            vec![("bytes", Arc::new(BinaryArray::from(vec![&b"red"[..], b"a\xff"])))],
            "row 2, key `bytes`\n  expected text",
        ),
        (
            vec![("time", Arc::new(TimestampMicrosecondArray::from(vec![0, i64::MAX])))],
            "row 2, key `time`\n  expected a value of the type Timestamp",
        ),
        (
            vec![("took", Arc::new(DurationMillisecondArray::from(vec![1, 2])))],
            "key `took`\n  expected a column without",
        ),
        (vec![("count", Arc::new(Float64Array::from(vec![1.0, 1.5])))], "row 2, key `count`\n  expected an integer of"),
    ] {
        let told = refused(columns);
        assert!(told.contains("in.parquet") && told.contains(words), "{told}");
    }
    let told = refused(vec![("reward", Arc::new(StringArray::from(vec!["1", "2"])))]);
    assert!(told.contains("row 1, key `reward`") && told.contains("found the text `1`"), "{told}");
    let told = refused(vec![("reward", Arc::new(Int64Array::from(vec![1, 9_007_199_254_740_993])))]);
    assert!(told.contains("row 2, key `reward`") && told.contains("found 9007199254740993"), "{told}");
    let twice = |value| ("reward", Arc::new(Float64Array::from(vec![value, value])) as ArrayRef);
    let told = refused(vec![twice(0.3), twice(99.0)]);
    assert!(told.contains("key `reward`\n  expected one column of that name"), "{told}");
    assert!(!at.join("x.parquet").exists());
}

#[test]
fn a_cell_of_csv_that_does_not_fit_is_named() {
    let folder = folder();
    let at = folder.path();
    let [declared, exact] = ["a number, as the definitions", "a number that 64-bit floats hold exactly"];
    for (cell, expected, found) in [
        ("NA", declared, "the text `NA`"),
        ("null", declared, "the text `null`"),
        ("007", declared, "the text `007`"),
        ("1e999", exact, "1e999"),
        ("9007199254740993.01", exact, "9007199254740993.01"),
        ("100000000000000000000000000001", exact, "100000000000000000000000000001"),
    ] {
        let text = format!("episode_id,model,experiment,seed,run,t,reward\ne,m,x,1,1,1,0.1\ne,m,x,1,1,2,{cell}\n");
        fs::write(at.join("rows.csv"), text).unwrap();
        let told = run(at, &[&["import", "rows.csv"], &WITH[..]].concat()).refused();
        let words = format!("rows.csv, row 2, key `reward`\n  expected {expected}");
        assert!(told.contains(&words) && told.contains(&format!("found {found}\n")), "{told}");
    }
    let text = "episode_id,model,experiment,seed,run,t,n,id\ne,m,x,1,1,1,9007199254740993,12345678901234567890\n";
    fs::write(at.join("rows.csv"), text).unwrap();
    run(at, &[&["import", "rows.csv"], &WITH[..]].concat()).done();
    let found = rows(&at.join("x.parquet"));
    let column =
        |name: &str| arrow::util::display::array_value_to_string(found.column_by_name(name).unwrap(), 0).unwrap();
    assert_eq!([column("n"), column("id")], ["9007199254740993", "12345678901234567890"]);
    fs::write(at.join("rows.csv"), text.replace("12345678901234567890\n", "x\ne,m,x,1,1,2,0.5,y\n")).unwrap();
    let told = run(at, &[&["import", "rows.csv"], &WITH[..]].concat()).refused();
    assert!(told.contains("row 1, key `n`") && told.contains("found 9007199254740993"), "{told}");
}

#[test]
fn cells_that_stand_for_no_number_are_floats_texts_or_refused() {
    let folder = folder();
    let at = folder.path();
    let table = |reward: [&str; 2], own: [&str; 2]| {
        let line = |t: usize| format!("e,m,x,1,1,{t},{},{}\n", reward[t - 1], own[t - 1]);
        let text = format!("episode_id,model,experiment,seed,run,t,reward,own\n{}{}", line(1), line(2));
        fs::write(at.join("rows.csv"), text).unwrap();
        run(at, &[&["import", "rows.csv"], &WITH[..]].concat())
    };
    let column = |name: &str| {
        let found = rows(&at.join("x.parquet"));
        let text = |row| arrow::util::display::array_value_to_string(found.column_by_name(name).unwrap(), row).unwrap();
        [text(0), text(1)]
    };
    table(["nan", "-Infinity"], ["inf", "0.5"]).done();
    assert_eq!((column("reward"), column("own")), (["NaN", "-inf"].map(Into::into), ["inf", "0.5"].map(Into::into)));
    for texts in [["NA", ""], ["NA", "x"], ["x", "9007199254740993.01"], ["None", "null"]] {
        table(["", "1"], texts).done();
        assert_eq!(column("own"), texts.map(String::from));
    }
    for (own, row, expected) in [
        (["NA", "1"], 1, "a number, as in other rows"),
        (["1.5", "null"], 2, "a number, as in other rows"),
        (["9007199254740993.01", "0.5"], 1, "a number, as in other rows"),
        (["true", "N/A"], 2, "true or false, as in other rows"),
    ] {
        let told = table(["", ""], own).refused();
        let found = own[row - 1];
        assert!(told.contains(&format!("rows.csv, row {row}, key `own`\n  expected {expected}")), "{told}");
        assert!(told.contains(&format!("found the text `{found}`\n")), "{told}");
    }
}

#[test]
fn the_format_is_that_of_the_contents() {
    let folder = folder();
    let at = folder.path();
    let reward = || vec![("reward", Arc::new(Float64Array::from(vec![0.5, 0.1])) as ArrayRef)];
    let expected = imported(at, reward());
    let csv = "episode_id,model,experiment,seed,run,t,reward\ne,act,reach,1,1,1,0.5\ne,act,reach,1,1,2,0.1\n";
    let step = |t: i64, reward: f64| {
        format!(
            "{{\"episode_id\":\"e\",\"model\":\"act\",\"experiment\":\"reach\",\n\"seed\":1,\"run\":1,\"t\":{t},\"reward\":{reward}}}"
        )
    };
    let list = format!("\u{feff}\n[{},\n{}]\n", step(1, 0.5), step(2, 0.1));
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(csv.as_bytes()).unwrap();
    for (name, bytes) in [
        ("a.pq", fs::read(at.join("in.parquet")).unwrap()),
        ("a.csv", fs::read(at.join("in.parquet")).unwrap()),
        ("A.CSV", csv.into()),
        ("a.tsv", csv.replace(',', "\t").into()),
        ("a.csv.gz", gzip.finish().unwrap()),
        ("a.csv.zst", zstd::encode_all(csv.as_bytes(), 1).unwrap()),
        ("a.json", list.clone().into()),
        ("a", list.into()),
    ] {
        fs::write(at.join(name), &bytes).unwrap();
        run(at, &[&["import", name], &WITH[..]].concat()).done();
        assert_eq!(rows(&at.join("x.parquet")), expected, "{name}");
        if bytes.starts_with(b"PAR1") {
            run_with_input(at, &[&["import", "-"], &WITH[..]].concat(), bytes).done();
            assert_eq!(rows(&at.join("x.parquet")), expected, "{name}, piped");
        }
    }
    fs::write(at.join("a.json"), "[{\"episode_id\": \"e\", \"t\": 1, \"t\": 2}]").unwrap();
    let told = run(at, &[&["import", "a.json"], &WITH[..]].concat()).refused();
    assert!(told.contains("the key \"t\" twice"), "{told}");
}

#[test]
fn folders_may_have_columns() {
    let folder = folder();
    let at = folder.path();
    let of = |columns: Vec<(&str, ArrayRef)>, without: &[&str]| {
        let table = table(columns);
        let kept: Vec<usize> = (0..table.num_columns())
            .filter(|at| !without.contains(&table.schema_ref().field(*at).name().as_str()))
            .collect();
        table.project(&kept).unwrap()
    };
    let reward = || vec![("reward", Arc::new(Float64Array::from(vec![0.5, 0.1])) as ArrayRef)];
    let expected = imported(at, reward());
    let part = at.join("runs/model=act/run=1");
    fs::create_dir_all(&part).unwrap();
    write_rows(&part.join("part-0.parquet"), &[of(reward(), &["model", "run"])], None);
    let name = "runs/model=act/run=1/part-0.parquet";
    run(at, &[&["import", name], &WITH[..]].concat()).done();
    let found = rows(&at.join("x.parquet"));
    assert_eq!(
        (found.num_columns(), found.column_by_name("model")),
        (expected.num_columns(), expected.column_by_name("model"))
    );
    let scored = |path: &str| {
        let told = run(at, &["score", path, "--definitions", "arms.toml", "--metrics", "OVER"]).done();
        told.lines().nth(1).unwrap().split(',').take(6).collect::<Vec<_>>().join(",")
    };
    assert_eq!(scored("runs"), "e,act,reach,1,1,1");
    #[cfg(feature = "polars")]
    {
        let sql = "select distinct model, run from steps";
        let told = run(at, &["query", sql, "runs", "--definitions", "arms.toml", "--format", "csv"]).done();
        assert_eq!(told, "model,run\nact,1\n");
    }
    write_rows(
        &part.join("part-0.parquet"),
        &[of(vec![("model", Arc::new(StringArray::from(vec!["act", "bee"])))], &["run"])],
        None,
    );
    let told = run(at, &[&["import", name], &WITH[..]].concat()).refused();
    assert!(told.contains("row 2, key `model`") && told.contains("found the text `bee`"), "{told}");
    let csv = "episode_id,experiment,seed,t\ne,x,1,1\n";
    for (name, words) in [
        ("model=a/run=1/reward=nan", "imported 1 episode"),
        ("model=%FF/run=1/reward=__HIVE_DEFAULT_PARTITION__", "imported 1 episode"),
        (
            "model=__HIVE_DEFAULT_PARTITION__/run=1",
            "key `model`\n  expected a text that is not empty\n  found null\n  help: the folder \
             `model=__HIVE_DEFAULT_PARTITION__` says null",
        ),
    ] {
        fs::create_dir_all(at.join(name)).unwrap();
        let file = format!("{name}/rows.csv");
        fs::write(at.join(&file), csv).unwrap();
        let answer = run(at, &[&["import", &file], &WITH[..]].concat());
        assert!(format!("{}{}", answer.stdout, answer.stderr).contains(words), "{}", answer.stderr);
    }
    fs::write(at.join("open.toml"), "domain = \"arms\"\n[metric.N]\nvalue = \"length()\"\n").unwrap();
    let told = run(at, &["score", "runs", "--definitions", "open.toml"]).refused();
    assert!(told.contains("expected `act`, as in the name of the folder\n  found `bee`"), "{told}");
    #[cfg(feature = "polars")]
    {
        let told = run(at, &["query", "select model from steps", "runs", "--definitions", "open.toml"]).refused();
        assert!(told.contains("expected `act`, as in the name of the folder\n  found `bee`"), "{told}");
    }
}

#[cfg(feature = "polars")]
#[test]
fn queries_of_other_types_answer_as_duckdb_or_are_refused() {
    let folder = folder();
    let at = folder.path();
    let columns = vec![
        ("f", Arc::new(Float32Array::from(vec![0.1, 0.5])) as ArrayRef),
        ("d", Arc::new(arrow::array::Date32Array::from(vec![1, 2]))),
    ];
    write_rows(&at.join("in.parquet"), &[table(columns)], None);
    let asked = |sql: &str| run(at, &["query", sql, "in.parquet", "--definitions", "arms.toml", "--format", "csv"]);
    for (sql, expected) in [
        ("select max(f) as m, avg(f) as a from steps where f > 0", "m,a\n0.5,0.30000000074505806\n"),
        ("select f from steps where f >= 0.5", "f\n0.5\n"),
        ("select count(*) as n from steps where f = cast(f as double)", "n\n2\n"),
        ("select * exclude (d, f, episode_id, experiment, seed, model) from steps where t = 1", "run,t\n1,1\n"),
    ] {
        assert_eq!(asked(sql).done(), expected, "{sql}");
    }
    for sql in ["select f = 0.1 from steps", "select f + 1 from steps", "select d from steps", "select * from steps"] {
        let told = asked(sql).refused();
        assert!(told.contains("`query` does not support") && told.contains("run it in DuckDB: duckdb -c"), "{told}");
    }
}

#[test]
fn a_column_of_nulls_fits_every_declared_type() {
    let folder = folder();
    let at = folder.path();
    let nulls = || vec![("reward", Arc::new(NullArray::new(2)) as ArrayRef), ("count", Arc::new(NullArray::new(2)))];
    let found = imported(at, nulls());
    let kind = |name: &str| found.column_by_name(name).unwrap().data_type().clone();
    assert_eq!(
        [kind("reward"), kind("count")],
        [arrow::datatypes::DataType::Float64, arrow::datatypes::DataType::Int64]
    );
    for trace in ["in.parquet", "x.parquet"] {
        assert_eq!(scores(at, trace), "0,0,", "{trace}");
        run(at, &["stats", trace, "--definitions", "arms.toml"]).done();
        run(at, &["report", trace, "--definitions", "arms.toml", "--out", "out"]).done();
        #[cfg(feature = "polars")]
        {
            let sql = "select max(count) as most, max(reward) as best from steps";
            run(at, &["query", sql, trace, "--definitions", "arms.toml"]).done();
        }
    }
    let truths = vec![("reward", Arc::new(BooleanArray::from(vec![true, false])) as ArrayRef)];
    write_rows(&at.join("in.parquet"), &[table(truths)], None);
    let told = run(at, &["score", "in.parquet", "--definitions", "arms.toml"]).refused();
    assert!(told.contains("`reward` is declared as a float, and is true or false"), "{told}");
}

#[test]
fn a_trace_carries_the_definitions_that_it_was_imported_with() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("study.toml"), "include = [\"arms.toml\"]\n[metric.STEPS]\nvalue = \"length()\"\n").unwrap();
    let reward = vec![
        ("reward", Arc::new(Float64Array::from(vec![0.5, 0.1])) as ArrayRef),
        ("count", Arc::new(NullArray::new(2))),
    ];
    write_rows(&at.join("in.parquet"), &[table(reward)], None);
    run(at, &["import", "in.parquet", "-o", "x.parquet", "--definitions", "study.toml"]).done();
    let expected = run(at, &["score", "x.parquet", "--definitions", "study.toml"]).done();
    let valid = run(at, &["trace", "validate", "x.parquet", "--definitions", "study.toml"]).done();
    fs::remove_file(at.join("arms.toml")).unwrap();
    assert_eq!(run(at, &["trace", "validate", "x.parquet"]).done(), valid);
    let answer = run(at, &["score", "x.parquet"]).ends(0);
    assert_eq!(answer.stdout, expected);
    let note = "note: the definitions `study` are those that the traces carry; --definitions names others\n";
    assert_eq!(answer.stderr, note);
    for command in [&["report", "x.parquet", "--out", "out"][..], &["stats", "x.parquet"]] {
        assert!(run(at, command).ends(0).stderr.contains(note), "{command:?}");
    }
    fs::write(at.join("other.toml"), "domain = \"arms\"\n[metric.N]\nvalue = \"length()\"\n").unwrap();
    let answer = run(at, &["score", "x.parquet", "--definitions", "other.toml"]).ends(0);
    assert!(answer.stdout.contains(",N") && answer.stderr.is_empty(), "{}", answer.stderr);
    run(at, &["import", "in.parquet", "-o", "y.parquet", "--definitions", "other.toml", "--set", "episode_id=f"])
        .done();
    let told = run(at, &["score", "x.parquet", "y.parquet"]).refused();
    assert!(told.contains("`study` in x.parquet and `other` in y.parquet") && told.contains("--definitions"), "{told}");
}

#[test]
fn small_tables_of_many_values_are_refused() {
    let folder = folder();
    let at = folder.path();
    let texts: ArrayRef = Arc::new(StringArray::from(vec!["x".repeat(500_000); 400]));
    let numbers = |values: Vec<i64>| Arc::new(Int64Array::from(values)) as ArrayRef;
    let lists = arrow::array::ListArray::from_iter_primitive::<arrow::datatypes::Float32Type, _, _>(
        (0..400).map(|_| Some(vec![Some(0.0); 50_000])),
    );
    let frames = RecordBatch::try_from_iter([
        ("episode_index", numbers(vec![0; 400])),
        ("frame_index", numbers((0..400).collect())),
        ("text", texts),
    ])
    .unwrap();
    write_rows(&at.join("text.parquet"), std::slice::from_ref(&frames), None);
    let told = run(at, &[&["import", "text.parquet"], &WITH[..]].concat()).refused();
    assert!(told.contains("bytes of texts in the rows of a file of its size"), "{told}");
    let columns = frames.project(&[0, 1]).unwrap();
    let fields = columns.schema().fields().iter().map(|field| field.name().clone()).collect::<Vec<_>>();
    let all = fields.iter().map(String::as_str).zip(columns.columns().iter().cloned());
    let frames = RecordBatch::try_from_iter(all.chain([("action", Arc::new(lists) as ArrayRef)])).unwrap();
    write_rows(&at.join("list.parquet"), &[frames], None);
    let told = run(at, &[&["import", "list.parquet", "--from", "lerobot"], &WITH[..]].concat()).refused();
    assert!(told.contains("bytes inflated from a file of its size"), "{told}");
}

#[test]
fn values_that_change_in_an_episode_are_named_by_their_line() {
    let folder = folder();
    let at = folder.path();
    let task = "[column.task]\ntype = \"float\"\nconstant = true\n";
    fs::write(at.join("arms.toml"), format!("{DEFINITIONS}{task}")).unwrap();
    let import = |second: &str| {
        let head = r#"{"episode_id":"e","model":"m","experiment":"x","seed":1,"run":1"#;
        fs::write(at.join("s.jsonl"), format!("{head},\"t\":1,\"task\":1}}\n{head},\"t\":2,\"task\":{second}}}\n"))
            .unwrap();
        run(at, &[&["import", "s.jsonl"], &WITH[..]].concat())
    };
    import("1.0").done();
    for second in ["2", "null"] {
        let told = import(second).refused();
        let words = format!(
            "s.jsonl, line 2, key `task`\n  expected 1, as in the episode's first line (s.jsonl, line 1)\n  found {second}\n"
        );
        assert!(told.contains(&words), "{told}");
    }
}

#[test]
fn whole_numbers_fit_a_declared_column_of_floats() {
    let folder = folder();
    let at = folder.path();
    let line = |t: i32, reward: i32| {
        format!(r#"{{"episode_id":"e","model":"m","experiment":"x","seed":1,"run":1,"t":{t},"reward":{reward}}}"#)
    };
    fs::write(at.join("rows.jsonl"), format!("{}\n{}\n", line(1, 0), line(2, 7))).unwrap();
    run(at, &[&["import", "rows.jsonl"], &WITH[..]].concat()).done();
    let found = run(at, &["score", "x.parquet", "--metrics", "OVER"]).done();
    assert!(found.contains("e,m,x,1,1,1"), "{found}");
}

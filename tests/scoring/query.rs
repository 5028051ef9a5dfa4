//! `query` at the process boundary.

use std::path::Path;
use std::process::Command;

use crate::harness::files::repository;
use crate::harness::need;
use crate::harness::program::{self, Answer};

const FIXTURE: &str = "fixtures/paper";

/// Exit code, standard output and standard error of the program.
fn run(arguments: &[&str]) -> (i32, String, String) {
    let Answer { code, stdout, stderr } = program::run(&repository(), arguments);
    (code, stdout, stderr)
}

fn rows(query: &str) -> String {
    let (code, out, err) = run(&["query", query, FIXTURE, "--format", "csv"]);
    assert_eq!((code, err.as_str()), (0, ""), "{query}");
    out
}

fn refusal(query: &str) -> String {
    let (code, out, err) = run(&["query", query, FIXTURE]);
    assert_eq!((code, out.as_str()), (2, ""), "{query}");
    err
}

#[test]
fn the_three_tables_agree_with_each_other() {
    let counted = rows("SELECT COUNT(*) AS n, COUNT(DISTINCT episode_id) AS episodes FROM steps");
    assert_eq!(counted, "n,episodes\n57314,840\n");
    assert_eq!(rows("SELECT COUNT(*) AS n FROM steps"), "n\n57314\n");
    assert_eq!(rows("SELECT COUNT(*) AS n FROM episodes"), "n\n840\n");
    let sums = "SELECT e.experiment, SUM(e.TSA) AS s FROM episodes e GROUP BY e.experiment ORDER BY e.experiment";
    let cells =
        "SELECT experiment, SUM(\"sum\") AS s FROM cells WHERE metric = 'TSA' GROUP BY experiment ORDER BY experiment";
    assert_eq!(rows(sums), rows(cells));
}

#[test]
fn undefined_is_null_in_every_format() {
    let query = "SELECT episode_id, TTD, MTATO FROM episodes WHERE MTATO IS NULL ORDER BY episode_id LIMIT 1";
    assert!(rows(query).ends_with(",\n"), "{}", rows(query));
    let (_, table, _) = run(&["query", query, FIXTURE]);
    assert!(table.contains("NULL") && table.ends_with("1 row\n"), "{table}");
    let (_, lines, _) = run(&["query", query, FIXTURE, "--format", "jsonl"]);
    assert!(lines.contains("\"MTATO\":null") && lines.lines().count() == 1, "{lines}");
}

#[test]
fn a_table_shows_both_ends_and_says_how_much_it_leaves_out() {
    let (_, table, _) = run(&["query", "SELECT t FROM steps ORDER BY t", FIXTURE, "--rows", "3"]);
    assert!(table.ends_with("57314 rows (3 shown)\n"), "{table}");
    assert!(table.contains(" 1") && table.contains(" 100"), "{table}");
}

#[test]
fn a_parquet_answer_reads_back_and_a_failed_one_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("answer.parquet");
    let name = path.to_str().unwrap();
    let (code, out, _) = run(&["query", "SELECT * FROM steps WHERE t = 1", FIXTURE, "-o", name]);
    assert_eq!((code, out.as_str()), (0, ""));
    let (_, counted, _) = run(&["query", "SELECT COUNT(*) AS n FROM steps", name, "--format", "csv"]);
    assert_eq!(counted, "n\n840\n");
    let none = folder.path().join("none.csv");
    let (code, _, _) = run(&["query", "SELECT nothing FROM steps", FIXTURE, "-o", none.to_str().unwrap()]);
    assert_eq!((code, none.exists()), (2, false));
}

#[test]
fn a_column_that_one_file_lacks_is_null_there() {
    let folder = tempfile::tempdir().unwrap();
    for (name, columns) in [("a", "episode_id, model"), ("b", "episode_id, model, t AS extra")] {
        let path = folder.path().join(format!("{name}.parquet"));
        let rest = "experiment, seed, run, body_color, t, action, self_color, selected_cube, mirror_visible";
        let query = format!("SELECT {columns}, {rest} FROM steps WHERE experiment = 'E1'");
        assert_eq!(run(&["query", &query, FIXTURE, "-o", path.to_str().unwrap()]).0, 0);
    }
    let query = "SELECT COUNT(*) AS n, COUNT(extra) AS extra FROM steps";
    let (_, out, err) = run(&["query", query, folder.path().to_str().unwrap(), "--format", "csv"]);
    let (n, extra) = out.lines().nth(1).unwrap_or_else(|| panic!("{err}")).split_once(',').unwrap();
    assert_eq!(n.parse::<u64>().unwrap(), 2 * extra.parse::<u64>().unwrap());
}

#[test]
fn a_query_reads_the_named_traces_alone() {
    for query in [
        "SELECT * FROM read_parquet('fixtures/paper/x.parquet')",
        "SELECT * FROM read_csv('Cargo.toml')",
        "CREATE TABLE a AS SELECT * FROM steps",
        "DROP TABLE steps",
        "SELECT 1; SELECT 2",
    ] {
        assert!(refusal(query).starts_with("error: "), "{query}");
    }
}

#[test]
fn a_bad_query_is_refused_with_its_location_and_the_nearest_name() {
    assert!(refusal("SELECT modell FROM steps").contains("did you mean `model`?"));
    assert!(refusal("SELECT s.modell FROM steps s").contains("did you mean `model`?"));
    assert!(refusal("SELECT model FROM step").contains("did you mean `steps`?"));
    assert!(refusal("SELECT model FROM").contains("not a query"));
    assert!(refusal("SELECT nosuch(model) FROM steps").contains("nosuch"));
}

/// A program `duckdb` and this program on PATH, in a folder with one trace whose path needs quotes.
fn beside_duckdb() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let script = format!(
        "#!/bin/sh\nPYTHONPATH='{}' exec python3 -c '\nimport duckdb, sys\nfor row in duckdb.sql(sys.argv[2]).fetchall(): print(*row, sep=\",\")\n' \"$@\"\n",
        need::duckdb().display()
    );
    std::fs::write(at.join("duckdb"), script).unwrap();
    let made = Command::new("chmod").arg("+x").arg(at.join("duckdb")).status().unwrap();
    assert!(made.success());
    std::fs::create_dir(at.join("it's $HOME")).unwrap();
    let first = ["E1", "E2"].map(|name| format!("SELECT * FROM steps WHERE experiment = '{name}'"));
    for (query, name) in first.iter().zip(["a", "b"]) {
        let path = at.join(format!("it's $HOME/{name}.parquet"));
        assert_eq!(run(&["query", query, FIXTURE, "-o", path.to_str().unwrap()]).0, 0);
    }
    let program = Path::new(env!("CARGO_BIN_EXE_mirrorstats")).parent().unwrap();
    let path = format!("{}:{}:{}", at.display(), program.display(), std::env::var("PATH").unwrap());
    (folder, path)
}

#[test]
fn a_refused_query_comes_with_a_command_line_for_duckdb() {
    let (folder, path) = beside_duckdb();
    for (query, expected) in [
        ("SELECT string_agg(DISTINCT experiment, ' ' ORDER BY experiment) AS e FROM steps", "E1 E2\n"),
        (
            "SELECT count(*) FILTER (WHERE x.t <> 'a''b') FROM (SELECT action AS t FROM steps\n-- all\nEXCEPT SELECT 'a''b') x WHERE 1 = 2",
            "0\n",
        ),
        ("SELECT list(DISTINCT e.seed)[1] > 0 FROM episodes e JOIN steps s USING (episode_id)", "True\n"),
        ("SELECT any_value(metric) FROM cells WHERE metric = 'TSA'", "TSA\n"),
    ] {
        let asked = ["query", query, "it's $HOME", "--where", "seed = seed and model <> 'x'"];
        let Answer { code, stdout, stderr } = program::run(folder.path(), &asked);
        assert_eq!((code, stdout.as_str()), (2, ""), "{query}");
        let line = stderr.split_once("run it in DuckDB: ").unwrap_or_else(|| panic!("{query}: {stderr}")).1;
        let answer = Command::new("sh")
            .args(["-c", line.lines().next().unwrap()])
            .env("PATH", &path)
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(answer.status.success(), "{line}: {}", String::from_utf8_lossy(&answer.stderr));
        assert_eq!(String::from_utf8_lossy(&answer.stdout), expected, "{query}");
    }
}

#[test]
fn evidence_is_refused_for_another_engine() {
    let (code, out, err) = run(&["score", FIXTURE, "--engine", "spark", "--explain", "E1/gpt-5-1/s1/r2"]);
    assert_eq!((code, out.as_str()), (2, ""));
    assert!(err.contains("--explain looks into the steps, which Spark keeps to itself"), "{err}");
}

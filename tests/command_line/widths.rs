//! Tables in terminals of any width.

use mirrorstats_trace::write::write_episodes;

use crate::episode;
use crate::harness::program::{answer, program};

/// The width of the widest line; every letter here takes one column.
fn widest(text: &str) -> usize {
    text.lines().map(|line| line.chars().count()).max().unwrap_or(0)
}

#[test]
fn no_line_is_wider_than_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let models: Vec<String> = (0..20).map(|at| format!("organisation/model-{at:02}-instruct-preview-x")).collect();
    let episodes: Vec<_> =
        models.iter().flat_map(|model| (0..3).map(move |run| episode(model, "E1", run, "red"))).collect();
    write_episodes(&folder.path().join("a.parquet"), None, &episodes).unwrap();
    for arguments in [
        ["report", "a.parquet", "--no-figures"].as_slice(),
        &["report", "a.parquet", "--no-figures", "--style", "paper"],
        &["stats", "a.parquet", "--metric", "all"],
        &["stats", "a.parquet", "--sequential", "--metric", "all"],
        &["trace", "info", "a.parquet"],
    ] {
        let run = |width: Option<usize>| {
            let mut command = program(folder.path());
            let width = width.map(|width| ("COLUMNS", width.to_string()));
            answer(command.args(arguments).envs(width)).done()
        };
        let whole = run(None);
        let numbers = |text: &str| text.chars().filter(char::is_ascii_digit).count();
        for width in [60, 80, 100, 140] {
            let text = run(Some(width));
            assert!(widest(&text) <= width, "{arguments:?} at {width}: {}\n{text}", widest(&text));
            assert!(numbers(&text) >= numbers(&whole), "{arguments:?} at {width} lacks numbers");
        }
        // By default, notes wrap at the width of the table.
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&run(Some(10_000))), words(&whole));
    }
}

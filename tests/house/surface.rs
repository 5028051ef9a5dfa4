//! The public surface: the names that the library promises, as listed in `src/lib.rs`.

fn lib() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/src/lib.rs")).unwrap()
}

/// The names that a text's `pub use` declarations re-export, sorted.
fn reexported(text: &str) -> Vec<String> {
    let declarations = text.split("\npub use ").skip(1).map(|rest| rest.split_once(';').unwrap().0);
    let mut names: Vec<String> = declarations.flat_map(names_of).collect();
    names.sort();
    names
}

/// The names of one declaration: `a::b`, `a::{b, c as d}`.
fn names_of(declaration: &str) -> Vec<String> {
    let listed = declaration.split_once('{').map_or(declaration, |(_, rest)| rest.trim_end().trim_end_matches('}'));
    let leaf = |item: &str| {
        let name = item.split_once(" as ").map_or_else(|| item.rsplit("::").next().unwrap(), |(_, new)| new);
        name.trim().to_owned()
    };
    listed.split(',').filter(|item| !item.trim().is_empty()).map(leaf).collect()
}

#[test]
fn names_are_read_from_every_form_of_a_declaration() {
    let text = "\npub use a::b;\npub use c::{\n    d, e as F,\n};\nuse g::h;\n";
    assert_eq!(reexported(text), ["F", "b", "d"]);
}

#[test]
fn the_public_names_of_the_library_are_listed() {
    insta::assert_snapshot!(reexported(&lib()).join("\n"), @r"
    CellChange
    Cells
    Changes
    Diff
    DiffRequest
    EpisodeKey
    EpisodeTable
    ErrorKind
    Evidence
    Figure
    FigureFormat
    FigureName
    FigureOptions
    FigureWidth
    Flip
    Group
    KeyValue
    Manifest
    MetricColumn
    MetricTable
    Moments
    Outputs
    Report
    ReportOptions
    RescoreRequest
    Rescored
    Results
    Side
    Statistics
    StatisticsOptions
    Study
    StudyError
    Table
    diff
    episode_batch
    explain
    figure
    gate
    record_batch
    report
    resolve
    statistics
    ");
}

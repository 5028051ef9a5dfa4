//! Answers that an experiment declares: their columns, their truths, and the checks of both.

use std::fs;

use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

use super::recordings::Bench;
use crate::harness::program::run;
use crate::harness::traces::{episodes, recording};

/// An experiment with one answer of each type; the first one is the decision.
const MINE: &str = "[experiment.mine]
title = \"Mine\"
prompt = \"answers\"
chance = { TSA = \"1/2\" }
cubes = { kind = \"none\" }
others = { least = 1, most = 1, color = \"own\" }
start = \"before_mirror\"
absent = [\"self_color\", \"selected_cube\"]
mirror = [{ width = 5.0 }]
answer = [
    { key = \"side\", type = \"one_of\", options = [\"left\", \"right\"], truth = \"mirror_place\", unknown = true, words = \"Which is yours?\" },
    { key = \"own\", type = \"color\", truth = \"body_color\", words = \"Your colour.\" },
    { key = \"count\", type = \"number\", truth = \"others\", words = \"How many others?\" },
    { key = \"crowded\", type = \"yes_no\", conditions = { crowd = \"yes\" }, words = \"Is it crowded?\" },
]
";

fn recorded(bench: &Bench) -> Vec<Episode> {
    fs::write(bench.path("mine.toml"), MINE).unwrap();
    bench.recorded("runs", "--agent random --experiment mine.toml --seeds 1 --runs 3 --condition crowd");
    episodes(&bench.path("runs/mine-random@crowd.parquet"))
}

fn text(text: &str) -> Answered {
    Answered::Text(text.to_owned())
}

#[test]
fn one_declaration_gives_columns_of_answer_and_truth() {
    let bench = Bench::new();
    let all = recorded(&bench);
    let steps = || all.iter().flat_map(|episode| episode.steps.iter().map(move |step| (episode, step)));
    for (episode, step) in steps() {
        let cell = |name: &str| step.extra.answers.get(name);
        assert_eq!(cell("truth_own"), Some(&text(&episode.body_color)));
        assert_eq!(cell("truth_count"), Some(&Answered::Number(1.0)));
        assert_eq!(cell("truth_crowded"), Some(&text("yes")));
        assert!([text("left"), text("right")].contains(cell("truth_side").unwrap()));
        assert!(matches!(cell("answer_count"), Some(Answered::Number(number)) if (0.0..10.0).contains(number)));
        // The first answer is the decision, and is also stored as text.
        assert_eq!(step.extra.answer.as_deref().map(text).as_ref(), cell("answer_side"));
        assert_eq!(step.extra.answer_truth.as_deref().map(text).as_ref(), cell("truth_side"));
    }
    let sides = |name: &str| {
        steps()
            .filter_map(|(_, step)| step.extra.answers.get(name).map(Answered::text))
            .collect::<std::collections::BTreeSet<_>>()
    };
    assert!(sides("answer_side").len() == 2 && sides("answer_crowded").len() == 2, "chance draws both");
    // Without custom definitions, an episode is right if the answer at `done` is the truth at that step.
    let right = |episode: &&Episode| {
        let last = episode.steps.last().unwrap();
        last.action == Some(mirrorstats_trace::episodes::episode::Action::Done)
            && last.extra.answer == last.extra.answer_truth
    };
    run(bench.folder.path(), &["report", "runs", "--out", "report", "--no-figures"]).done();
    let cells = fs::read_to_string(bench.path("report/cells.csv")).unwrap();
    let expected = format!("mine,random,crowd,TSA,3,{},", all.iter().filter(right).count());
    assert!(cells.contains(&expected), "{expected} in {cells}");
}

#[test]
fn answers_that_contradict_the_declaration_are_reported() {
    let bench = Bench::new();
    let mut all = recorded(&bench);
    let folder = bench.folder.path();
    run(folder, &["trace", "validate", "runs"]).done();
    run(folder, &["world", "replay", "runs"]).done();
    // The log alone gives the same rows.
    run(folder, &["trace", "recover", "runs/mine-random@crowd.mcap", "--out", "again.parquet"]).done();
    assert_eq!(episodes(&bench.path("again.parquet")), all);
    // A text that is not an option, and a truth that differs from the world's.
    let write = |name: &str, all: &[Episode]| {
        let recording = recording(&bench.path("runs/mine-random@crowd.parquet"));
        let columns = OptionalColumns::recorded(&recording);
        let metadata = TraceMetadata { recording: Some(recording), columns };
        let mut writer = TraceWriter::create(&bench.path(name), &metadata).unwrap();
        for episode in all {
            writer.write(episode).unwrap();
        }
        writer.commit().unwrap();
    };
    all[0].steps[0].extra.answers.insert("answer_side".to_owned(), text("above"));
    write("altered.parquet", &all);
    let said = run(folder, &["trace", "validate", "altered.parquet"]).ends(1);
    let said = said.stdout + &said.stderr;
    assert!(said.contains("left, right, unknown") && said.contains("`above`"), "{said}");
    all[0].steps[0].extra.answers.insert("answer_side".to_owned(), text("left"));
    all[0].steps[0].extra.answers.insert("truth_count".to_owned(), Answered::Number(2.0));
    write("altered.parquet", &all);
    let said = run(folder, &["world", "replay", "altered.parquet"]).ends(1);
    let said = said.stdout + &said.stderr;
    assert!(said.contains("truth_count"), "{said}");
    // A value for an undeclared answer is refused, not dropped.
    all[0].steps[0].extra.answers.insert("answer_other".to_owned(), text("left"));
    let recording = recording(&bench.path("runs/mine-random@crowd.parquet"));
    let columns = OptionalColumns::recorded(&recording);
    let mut writer =
        TraceWriter::create(&bench.path("other.parquet"), &TraceMetadata { recording: None, columns }).unwrap();
    assert!(writer.write(&all[0]).unwrap_err().to_string().contains("answer_other"));
}

//! Filters that keep no episode, and figures that limit the number of episodes.

use mirrorstats_trace::write::write_episodes;

use crate::{episode, run, two_files};

#[test]
fn a_filter_that_keeps_nothing_is_refused_with_the_present_values() {
    let folder = two_files();
    let at = folder.path();
    run(at, &["score", ".", "-o", "s.csv"]).done();
    for arguments in [
        ["report", "a.parquet", "b.parquet", "--out", "r"].as_slice(),
        &["stats", "a.parquet", "b.parquet"],
        &["stats", "s.csv"],
        &["figure", "heatmap", "a.parquet", "b.parquet"],
        &["diff", "paper", "paper", "a.parquet", "b.parquet"],
        &["diff", "s.csv", "s.csv"],
    ] {
        let said = run(at, &[arguments, &["--where", "model = 'cat' and run < 3 and TSA = 1"]].concat()).refused();
        assert!(
            said.contains("keeps none of 16 episodes\n  model: 'ant', 'bee'\n  run: 0, 1, 2, 3\n  TSA: 0, 1\n"),
            "{said}"
        );
    }
    assert!(!at.join("r").exists());
}

#[test]
fn a_filter_by_an_impossible_value_is_refused_at_the_value() {
    let folder = two_files();
    let said = run(folder.path(), &["score", ".", "--where", "any(action = 'turn_lft')"]).refused();
    let expected = "error: `action` never is 'turn_lft'\n --> --where:1:14\n";
    assert!(said.starts_with(expected) && said.contains("^^^^^^^^^^ not one of its values"), "{said}");
    assert!(said.contains("help: did you mean 'turn_left'?"), "{said}");
}

#[test]
fn an_empty_machine_readable_table_has_a_note() {
    let folder = two_files();
    let answer = run(folder.path(), &["score", "a.parquet", "--where", "seed = 9", "--metrics", "TSA"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (0, "episode_id,model,experiment,seed,run,TSA\n"));
    assert_eq!(answer.stderr, "note: the filter `seed = 9` keeps none of 8 episodes\n  seed: 1\n");
}

#[test]
fn many_episodes_have_their_outcomes_drawn_and_gaze_names_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let episodes: Vec<_> = (0..2001).map(|run| episode("ant", "E5", run, "red")).collect();
    write_episodes(&at.join("a.parquet"), None, &episodes).unwrap();
    let outcomes = run(at, &["figure", "e5-outcomes", "a.parquet"]).done();
    assert!(outcomes.contains("n = 2001"), "{outcomes}");
    let said = run(at, &["figure", "gaze", "a.parquet"]).refused();
    assert!(said.contains("at most 2000 of them, found 2001; choose some with --where"), "{said}");
    run(at, &["figure", "gaze", "a.parquet", "--where", "run < 2000"]).done();
}

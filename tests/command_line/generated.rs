//! The traces of benchmarks (`examples/generate`): both orders give valid traces and the same episodes.

use std::collections::BTreeSet;
use std::path::Path;

use mirrorstats_trace::schema::COLUMNS;

use crate::generation::{self, Files, OPTIONAL_COLUMNS, Order, Study, Values, Wild};
use crate::harness::traces::{score_values, texts};
use crate::{contents, run};

const STEPS: u64 = 10_000;
const FILES: usize = 3;

/// Writes a study into the folder `name` below `at`.
fn generate(at: &Path, name: &str, study: &Study, order: Order) {
    generation::write(study, order, &Files { folder: at.join(name), count: FILES, threads: 2 }).unwrap();
}

/// The models of a file in step order without consecutive duplicates, and the number of steps.
fn models(path: &Path) -> (Vec<String>, usize) {
    let mut models: Vec<String> = texts(path, "model").into_iter().flatten().collect();
    let steps = models.len();
    models.dedup();
    (models, steps)
}

#[test]
fn generated_traces_of_both_orders_keep_every_rule_and_score_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut scores = BTreeSet::new();
    for (name, order, values) in [
        ("study", Order::Study, Values::Required),
        ("shuffled", Order::Shuffled, Values::Required),
        ("optional", Order::Shuffled, Values::Optional),
    ] {
        let study = Study::new(7, STEPS, values);
        generate(at, name, &study, order);
        assert_eq!(contents(&at.join(name)).len(), FILES);
        let validated = run(at, &["trace", "validate", name, "--json"]).done();
        let validated: serde_json::Value = serde_json::from_str(&validated).unwrap();
        // With so few episodes, agents claim colours that no body has. That is a note, as are unreadable replies.
        let findings = validated["findings"].as_array().unwrap();
        assert!(findings.iter().all(|finding| finding["severity"] == "note"), "{name}: {findings:?}");
        let info: serde_json::Value =
            serde_json::from_str(&run(at, &["trace", "info", name, "--json"]).done()).unwrap();
        assert_eq!((info["steps"].as_u64(), info["episodes"].as_u64()), (Some(STEPS), Some(study.episodes())));
        let required = COLUMNS.iter().filter(|column| column.required).count();
        let columns = info["columns"].as_array().unwrap().len();
        assert_eq!(
            columns,
            if values == Values::Optional { required + OPTIONAL_COLUMNS.len() } else { required },
            "{name}"
        );
        scores.insert(score_values(&run(at, &["score", name]).done()));
    }
    assert_eq!(scores.len(), 1, "the order, or an optional column, changes a score");
}

#[test]
fn wild_traces_are_those_of_another_program_and_sealed_ones_score_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let study = Study::new(7, STEPS, Values::Wild(Wild { longest: 20, models: 4, columns: 5 }));
    generate(at, "wild", &study, Order::Study);
    generate(at, "again", &study, Order::Study);
    assert_eq!(contents(&at.join("wild")), contents(&at.join("again")));
    let validated = run(at, &["trace", "validate", "wild"]).done();
    assert!(validated.contains("0 errors, 0 notes"), "{validated}");
    let info: serde_json::Value = serde_json::from_str(&run(at, &["trace", "info", "wild", "--json"]).done()).unwrap();
    assert_eq!((info["steps"].as_u64(), info["episodes"].as_u64()), (Some(STEPS), Some(study.episodes())));
    let keys = 4 * 5 * 3 * 7;
    assert!(study.episodes() > keys, "so that most keys repeat");
    std::fs::create_dir(at.join("sealed")).unwrap();
    for file in 0..FILES {
        let [from, to] = ["wild", "sealed"].map(|folder| format!("{folder}/steps-{file:03}.parquet"));
        let text = String::from_utf8_lossy(&std::fs::read(at.join(&from)).unwrap()).into_owned();
        assert!(!text.contains("mirrorstats"), "a foreign file names us in its footer");
        run(at, &["trace", "seal", &from, &to]).done();
    }
    assert_eq!(run(at, &["score", "wild"]).done(), run(at, &["score", "sealed"]).done());
}

#[test]
fn generated_traces_depend_on_the_seed_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, seed) in [("first", 7), ("again", 7), ("other", 8)] {
        generate(at, name, &Study::new(seed, STEPS, Values::Required), Order::Shuffled);
    }
    assert_eq!(contents(&at.join("first")), contents(&at.join("again")));
    assert_ne!(run(at, &["score", "first"]).done(), run(at, &["score", "other"]).done());
    assert_ne!(Order::Shuffled.numbers(7, 1000), Order::Shuffled.numbers(8, 1000));
}

#[test]
fn the_shuffled_order_has_every_model_in_every_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // More than 735 episodes, so that every model occurs.
    let study = Study::new(7, 60_000, Values::Required);
    for (name, order) in [("study", Order::Study), ("shuffled", Order::Shuffled)] {
        generate(at, name, &study, order);
        for file in 0..FILES {
            let (models, steps) = models(&at.join(format!("{name}/steps-{file:03}.parquet")));
            // A file ends with an episode, at most 99 steps past its share.
            assert!(
                steps.abs_diff(usize::try_from(study.steps).unwrap() / FILES) < 100,
                "{name} {file}: {steps} steps"
            );
            let distinct = models.iter().collect::<BTreeSet<_>>().len();
            match order {
                // A model's 105 episodes are consecutive.
                Order::Study => assert!(models.len() == distinct && distinct <= 4, "{file}: {models:?}"),
                Order::Shuffled => assert!(models.len() > 90 && distinct == 8, "{file}: {models:?}"),
            }
        }
    }
}

#[test]
fn an_order_has_every_episode_once() {
    for order in [Order::Study, Order::Shuffled] {
        for episodes in [1, 2, 1000] {
            let mut numbers = order.numbers(0, episodes);
            numbers.sort_unstable();
            assert!(numbers.iter().copied().eq(0..episodes), "{order:?} of {episodes}");
        }
    }
    assert!(Order::Study.numbers(0, 1000).is_sorted() && !Order::Shuffled.numbers(0, 1000).is_sorted());
}

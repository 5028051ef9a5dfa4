//! The traces of benchmarks (`examples/generate`): both orders give valid traces and the same episodes.

use std::collections::BTreeSet;
use std::path::Path;

use mirrorstats_trace::schema::COLUMNS;

use crate::generation::{self, Files, OPTIONAL_COLUMNS, Order, Study};
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
    for (name, order, optional) in
        [("study", Order::Study, false), ("shuffled", Order::Shuffled, false), ("optional", Order::Shuffled, true)]
    {
        let study = Study::new(7, STEPS, optional);
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
        assert_eq!(columns, if optional { required + OPTIONAL_COLUMNS.len() } else { required }, "{name}");
        scores.insert(score_values(&run(at, &["score", name]).done()));
    }
    assert_eq!(scores.len(), 1, "the order, or an optional column, changes a score");
}

#[test]
fn generated_traces_depend_on_the_seed_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, seed) in [("first", 7), ("again", 7), ("other", 8)] {
        generate(at, name, &Study::new(seed, STEPS, false), Order::Shuffled);
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
    let study = Study::new(7, 60_000, false);
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

//! Every verb on small files that ask for much work: its peak memory, or a refusal that names the limit.

use std::path::Path;

use crate::harness::bombs::{MEMORY, definitions, long_episode, long_texts, many_episodes, many_models, measured};

/// The option that raises every limit.
const SETTING: &str = "MIRRORSTATS_BUDGET";

/// Succeeds, or is a failed check, within the memory limit.
#[track_caller]
fn within(at: &Path, words: &str) {
    let arguments: Vec<&str> = words.split_whitespace().collect();
    let (answer, most) = measured(at, &arguments);
    assert!(most < MEMORY, "{words}: {} MB", most >> 10);
    assert!([0, 1].contains(&answer.code), "{words}: {}", answer.stderr);
}

/// Is refused within the memory limit; the message names the exceeded limit and how to raise it.
#[track_caller]
fn refused(at: &Path, words: &str, limit: &str) {
    let arguments: Vec<&str> = words.split_whitespace().collect();
    let (answer, most) = measured(at, &arguments);
    assert!(most < MEMORY, "{words}: {} MB", most >> 10);
    let told = answer.refused();
    assert!(told.contains(limit) && told.contains(SETTING), "{words}: {told}");
}

#[test]
fn an_episode_of_millions_of_steps_stays_within_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    long_episode(&at.join("a.parquet"), 4_000_000);
    within(at, "info a.parquet");
    within(at, "score a.parquet -o scores.csv");
    within(at, "validate a.parquet");
    #[cfg(feature = "view")]
    refused(at, "view a.parquet --export page", "steps times columns of an episode");
    assert!(!at.join("page").exists());
    definitions(&at.join("d.toml"), 20, |at| format!("sum(t * {})", at + 2));
    refused(at, "score a.parquet --definitions d.toml -o scores.csv", "bytes of values of the definitions");
    definitions(&at.join("d.toml"), 500, |at| format!("sum(t * {})", at + 2));
    refused(at, "score a.parquet --definitions d.toml -o scores.csv", "rows times values of the definitions");
}

#[test]
fn texts_of_a_million_steps_stay_within_the_limits_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    long_texts(&at.join("a.parquet"), 1_000_000);
    within(at, "info a.parquet");
    within(at, "validate a.parquet");
    within(at, "score a.parquet -o scores.csv");
    refused(at, "renormalize a.parquet -o new", "bytes of changed attributions");
    refused(at, "renormalize a.parquet --dry-run --json", "bytes of changed attributions");
    assert!(!at.join("new").exists());
    #[cfg(feature = "view")]
    refused(at, "view a.parquet --export page", "steps times columns of an episode");
}

#[test]
fn hundreds_of_thousands_of_episodes_stay_within_the_limits_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    many_episodes(&at.join("all.parquet"), 0..900_000);
    for verb in ["info", "info --episodes", "validate", "score -o s.csv", "report --by episode_id"] {
        let (verb, rest) = verb.split_once(' ').unwrap_or((verb, ""));
        if verb == "validate" {
            within(at, "validate all.parquet");
        } else {
            refused(at, &format!("{verb} all.parquet {rest}"), "episodes in");
        }
    }
    many_episodes(&at.join("some.parquet"), 0..290_000);
    within(at, "info some.parquet");
    refused(at, "info some.parquet --episodes", "episodes in a list");
    refused(at, "info some.parquet --episodes --json", "episodes in a list");
    within(at, "score some.parquet -o scores.csv");
    within(at, "report some.parquet -o report");
    refused(at, "report some.parquet --by episode_id -o other", "cells, groups times metrics");
    #[cfg(feature = "view")]
    refused(at, "view some.parquet --export page", "episodes of a page as files");
    many_episodes(&at.join("few.parquet"), 0..100_000);
    within(at, "info few.parquet --episodes");
    within(at, "info few.parquet --episodes --json");
    within(at, "validate some.parquet --json");
}

#[test]
fn many_small_files_have_one_budget() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let all: Vec<String> = (0..4).map(|at| format!("{at}.parquet")).collect();
    for (number, name) in all.iter().enumerate() {
        many_episodes(&at.join(name), number * 290_000..(number + 1) * 290_000);
    }
    refused(at, &format!("score {} -o scores.csv", all.join(" ")), "episodes in files of their size");
}

#[test]
fn hundreds_of_thousands_of_models_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    many_models(&at.join("a.parquet"), 290_000);
    for verb in ["info", "info --json"] {
        refused(at, &format!("{verb} a.parquet"), "bytes of models in experiments");
    }
    within(at, "validate a.parquet");
    within(at, "score a.parquet -o scores.csv");
    refused(at, "report a.parquet -o report", "whose replies are counted");
    refused(at, "stats a.parquet", "comparisons of two models");
    refused(at, "gate a.parquet a.parquet", "cells of a gate");
    many_models(&at.join("c.parquet"), 20_000);
    within(at, "score c.parquet -o c.csv");
    let gate = measured(at, &["gate", "c.csv", "c.parquet"]);
    assert!(gate.1 < MEMORY && gate.0.code == 4, "{} MB, {}", gate.1 >> 10, gate.0.stderr);
    many_models(&at.join("b.parquet"), 90_000);
    within(at, "info b.parquet");
    within(at, "info b.parquet --json");
    refused(at, "report b.parquet -o report", "comparisons of two models");
}

#[test]
fn definitions_and_rows_are_limited_together() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    many_episodes(&at.join("episodes.parquet"), 0..290_000);
    long_texts(&at.join("steps.parquet"), 1_000_000);
    definitions(&at.join("sums.toml"), 500, |at| format!("sum(t * {} + length() % {})", at + 2, at + 3));
    let branches = |at: usize| {
        let one = |branch: usize| format!("when t = {} then {branch}", at * 7 + branch);
        format!("sum(case {} else t end)", (0..60).map(one).collect::<Vec<_>>().join(" "))
    };
    definitions(&at.join("branches.toml"), 100, branches);
    for name in ["sums", "branches"] {
        for trace in ["episodes", "steps"] {
            let words = format!("score {trace}.parquet --definitions {name}.toml -o scores.csv");
            refused(at, &words, "values of the definitions");
        }
    }
    definitions(&at.join("few.toml"), 5, |at| format!("sum(t * {})", at + 2));
    within(at, "score steps.parquet --definitions few.toml -o scores.csv");
}

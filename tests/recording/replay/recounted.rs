//! Ground truth with another threshold or grid.

use mirrorstats_trace::episodes::episode_hash;

use super::traces::{WITH_SIGHT, copy, replay};
use crate::harness::program::{program, stderr, stdout, succeeds};
use crate::harness::traces::{episodes, recording};

/// Replays with a new threshold or grid; returns the folder and the new trace.
fn recounted(words: &[&str]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("anew.parquet");
    let mut command = program(folder.path());
    command
        .args(["world", "replay"])
        .arg(WITH_SIGHT.as_path())
        .args(["--recompute-visibility", "--out", "anew.parquet"])
        .args(words);
    succeeds(&mut command);
    (folder, out)
}

#[test]
fn another_threshold_agrees_with_the_recorded_counts() {
    let before = episodes(&WITH_SIGHT);
    let mut seen = std::collections::BTreeSet::new();
    for threshold in [1, 2, 6, 19, 20, 100_000] {
        let (_folder, out) = recounted(&["--threshold", &threshold.to_string()]);
        let after = episodes(&out);
        assert_eq!(recording(&out)["visibility_threshold_px"], threshold);
        let mut visible = 0;
        for (old, new) in before.iter().zip(&after) {
            let mut expected = old.clone();
            for step in &mut expected.steps {
                step.mirror_visible = step.extra.mirror_self_px.unwrap() >= threshold;
                visible += usize::from(step.mirror_visible);
            }
            // Changed rows have another hash, which `validate` checks.
            expected.episode_hash = Some(episode_hash::hash_of(&expected));
            assert_eq!(*new, expected, "the threshold {threshold}");
        }
        seen.insert(visible);
    }
    assert!(seen.len() >= 3, "thresholds that tell nothing apart: {seen:?}");
}

#[test]
fn a_replay_has_a_limit_of_rays() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = program(folder.path());
    command.args(["world", "replay", "--recompute-visibility", "--grid", "4000x4000", "--out", "anew.parquet"]);
    let output = command.arg(WITH_SIGHT.as_path()).output().unwrap();
    let told = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(told.contains("at most 3500000000 rays in a replay") && told.contains("MIRRORSTATS_BUDGET"), "{told}");
    assert!(!folder.path().join("anew.parquet").exists());
}

#[test]
fn changed_steps_are_counted() {
    let (folder, out) = recounted(&["--threshold", "100000"]);
    let was_visible = episodes(&WITH_SIGHT).iter().flat_map(|e| &e.steps).filter(|s| s.mirror_visible).count();
    assert!(was_visible > 0);
    let mut command = program(folder.path());
    command.args(["world", "replay", "--recompute-visibility", "--threshold", "100000", "--out", "x.parquet"]);
    let output = succeeds(command.arg(WITH_SIGHT.as_path()));
    let expected = format!("mirror_visible differs at {was_visible} step");
    assert!(stdout(&output).contains(&expected), "{}", stdout(&output));
    succeeds(program(folder.path()).args(["trace", "validate"]).arg(&out));
}

#[test]
fn another_grid_counts_anew_and_scales_the_threshold() {
    let (_folder, out) = recounted(&["--grid", "128x96"]);
    // Four rays in place of each one.
    assert_eq!(recording(&out)["visibility_threshold_px"], 8);
    assert_eq!(recording(&out)["visibility_grid"], serde_json::json!({ "width": 128, "height": 96 }));
    let (before, after) = (episodes(&WITH_SIGHT), episodes(&out));
    let mut counted = 0;
    for (old, new) in before.iter().zip(&after).flat_map(|(old, new)| old.steps.iter().zip(&new.steps)) {
        let (own, mirror) = (new.extra.mirror_self_px.unwrap(), new.extra.mirror_px.unwrap());
        assert_eq!(new.mirror_visible, own >= 8);
        let before = old.extra.mirror_px.unwrap();
        // An area has four times the rays, except along its edges.
        assert!((mirror - 4 * before).abs() <= 8 * (64 + 48), "{before} pixels of the mirror, then {mirror}");
        counted += usize::from(own > 0);
        assert_eq!((old.action, old.extra.pose_x), (new.action, new.extra.pose_x));
    }
    assert!(counted > 0);
}

#[test]
fn recounted_traces_can_be_replayed() {
    let (_folder, out) = recounted(&["--grid", "128x96", "--threshold", "5"]);
    let output = replay(&out, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    // Back to the recorded grid and threshold: the recorded bytes, except for the footer.
    let words = ["--recompute-visibility", "--grid", "64x48", "--threshold", "2", "--out", "back.parquet"];
    assert!(replay(&out, &words).status.success());
    assert_eq!(episodes(&out.with_file_name("back.parquet")), episodes(&WITH_SIGHT));
}

#[test]
fn invalid_options_are_refused_and_nothing_is_written() {
    let (_folder, path) = copy("E1", |_, _| ());
    let before = std::fs::read(&path).unwrap();
    for (words, expected) in [
        (&["--recompute-visibility", "--out", "copy.parquet"][..], "--out is the trace itself"),
        (&["--recompute-visibility"], "--out"),
        (&["--threshold", "3"], "--recompute-visibility"),
        (&["--recompute-visibility", "--out", "x.parquet", "--grid", "0x48"], "expected a grid such as 320x240"),
        (&["--recompute-visibility", "--out", "x.parquet", "--grid", "64"], "expected a grid such as 320x240"),
        (&["--recompute-visibility", "--out", "none/x.parquet"], "none/x.parquet"),
        (&["--recompute-visibility", "--out", "x.parquet", "."], "take a single trace"),
    ] {
        std::fs::copy(&path, path.with_file_name("other.parquet")).unwrap();
        let output = replay(&path, words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert!(stderr(&output).contains(expected), "{words:?}: {}", stderr(&output));
        assert!(std::fs::read(&path).unwrap() == before && !path.with_file_name("x.parquet").exists(), "{words:?}");
    }
}

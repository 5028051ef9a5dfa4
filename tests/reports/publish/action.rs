//! The steps of `action.yml`, run as the script that they are.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::harness::files::{fixture, repository};
use crate::harness::program::{Answer, PROGRAM, answer, clean};
use crate::publish::published;

/// Runs the step in a folder; returns its answer, outputs, comment and summary.
fn step(folder: &Path, command: &str, arguments: &str, accept: &str) -> (Answer, [String; 3]) {
    let of = |name: &str| folder.join(name);
    let mut script = clean(Command::new("sh"), folder);
    script.arg(repository().join("scripts/action.sh"));
    script.env("MIRRORSTATS", PROGRAM).env("COMMAND", command).env("ARGUMENTS", arguments).env("ACCEPT", accept);
    script.env("GITHUB_OUTPUT", of("outputs")).env("GITHUB_STEP_SUMMARY", of("summary.md"));
    for name in ["outputs", "summary.md"] {
        let _ = fs::remove_file(of(name));
    }
    let answer = answer(&mut script);
    let texts = ["outputs", "mirrorstats-comment.md", "summary.md"]
        .map(|name| fs::read_to_string(of(name)).unwrap_or_default());
    (answer, texts)
}

#[test]
fn a_gate_names_flipped_episodes_and_their_deciding_steps() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let of = |name: &str| fixture("recorded").join(name).display().to_string();
    let both = format!("{}\n{}\n", of("E1-oracle.parquet"), of("E1-random.parquet"));
    let (answer, [outputs, comment, summary]) = step(at, "gate", &both, "0");
    assert_eq!(outputs, "verdict=cannot say\nexit-code=4\ncomment=mirrorstats-comment.md\n");
    assert!(comment.contains("E1/oracle/s1/r1 1 (step 34)") && comment == summary, "{comment}");
    let told = answer.ends(4).stdout;
    assert!(told.starts_with("::warning title=E1 random (was oracle) TSA%3A cannot say::"), "{told}");
    let (answer, _) = step(at, "gate", &both, "0 4");
    answer.ends(0);
    let (answer, [outputs, ..]) = step(at, "gate", &format!("{both}--metric\nNONE"), "0");
    let told = answer.ends(2).stdout;
    assert!(
        outputs.starts_with("verdict=error\nexit-code=2\n") && told.starts_with("::error title=mirrorstats gate::"),
        "{told}"
    );
    let (answer, [outputs, ..]) = step(at, "score", "a", "0");
    assert!(answer.ends(2).stderr.contains("expected the command gate or verify") && outputs.is_empty());
}

#[test]
fn a_verification_annotates_each_difference() {
    let folder = published("none");
    let at = folder.path();
    let (answer, [outputs, ..]) = step(at, "verify", "out", "0");
    assert!(answer.ends(0).stdout.is_empty());
    assert!(outputs.starts_with("verdict=equal\nexit-code=0\n"), "{outputs}");
    fs::write(at.join("out/prompts/cube-selection/user.txt"), "100 %\n").unwrap();
    let (answer, [outputs, comment, _]) = step(at, "verify", "out", "0");
    assert!(outputs.starts_with("verdict=different\nexit-code=1\n"), "{outputs}");
    let told = answer.ends(1).stdout;
    assert!(told.lines().all(|line| line.starts_with("::error title=mirrorstats verify::")), "{told}");
    assert!(told.contains("prompts/cube-selection/user.txt: line 1") && told.contains("published 100 %25"), "{told}");
    assert!(comment.contains("    prompts/cube-selection/user.txt"), "{comment}");
}

/// The metadata names each input and output that the script reads or writes.
#[test]
fn the_action_and_its_script_agree() {
    let action = fs::read_to_string(repository().join("action.yml")).unwrap();
    let script = fs::read_to_string(repository().join("scripts/action.sh")).unwrap();
    for name in ["COMMAND", "ARGUMENTS", "ACCEPT", "COMMENT"] {
        assert!(action.contains(&format!("{name}: ${{{{ inputs.{} }}}}", name.to_lowercase())), "{name}");
        assert!(script.contains(name), "{name}");
    }
    for name in ["verdict", "exit-code", "comment"] {
        assert!(action.contains(&format!("value: ${{{{ steps.run.outputs.{name} }}}}")), "{name}");
        assert!(script.contains(&format!("echo \"{name}=")), "{name}");
    }
}

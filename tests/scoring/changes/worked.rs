//! The worked example of the README, as printed there.

use crate::changes::{repository, run};

#[test]
fn the_mirror_may_be_consulted_at_the_decision_itself() {
    let diff = ["diff", "paper", "examples/definitions/inclusive.toml", "fixtures/paper"];
    insta::assert_snapshot!(run(&repository(), &[&diff[..], &["--limit", "5"]].concat()).ends(0).stdout);
}

#[test]
fn visibility_may_need_more_pixels() {
    let diff = ["diff", "paper", "examples/definitions/threshold.toml", "fixtures/glimpses.parquet"];
    insta::assert_snapshot!(run(&repository(), &diff).ends(0).stdout);
}

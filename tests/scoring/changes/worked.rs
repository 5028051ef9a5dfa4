//! The worked examples of docs/how-to/definitions.md.

use crate::assert_shown;
use crate::changes::run;
use crate::harness::files::repository;

fn shown(words: &str) -> String {
    run(&repository(), &words.split(' ').skip(1).collect::<Vec<_>>()).done()
}

#[test]
fn the_mirror_may_be_consulted_at_the_decision_itself() {
    let words = "mirrorstats diff paper examples/definitions/inclusive.toml fixtures/paper --limit 5";
    assert_shown!(words, shown(words));
}

#[test]
fn visibility_may_need_more_pixels() {
    let words = "mirrorstats diff paper examples/definitions/threshold.toml fixtures/glimpses.parquet";
    assert_shown!(words, shown(words));
}

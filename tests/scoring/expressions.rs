//! Random well-typed definitions on random traces: engine and interpreter must agree on every value.

use proptest::prelude::*;

use crate::author::{Vocabulary, definitions};
use crate::interpreter::Reading;
use crate::language::toml;
use crate::random::episodes;
use crate::traces::{score_toml, values};

/// Columns of the schema, and numbers too small to overflow.
const SMALL: Vocabulary = Vocabulary {
    bools: &["mirror_visible", "bumped"],
    ints: &["mirror_px", "mirror_self_px"],
    numbers: &["seed", "run", "distractors"],
    floats: &["pose_x", "pose_y"],
    texts: &["self_color", "selected_cube", "reasoning", "action"],
    names: &["body_color", "stated_color", "model", "experiment"],
    int_literals: &[1, 0, 2, -1, 3, -3, 9],
    float_literals: &[1.5, 0.0, -2.25],
    text_literals: &["red", "", "unknown", "Z", "é", "it's", "done"],
    patterns: &["e", "(?i)ME", "^$", "^[a-zé]+$"],
    products: false,
};

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn engine_and_interpreter_agree(definitions in definitions(&SMALL), episodes in episodes(1..5)) {
        let text = toml(&definitions);
        let table = score_toml(&episodes, &text);
        let metrics = definitions.iter().enumerate().filter(|(_, definition)| definition.is_metric);
        let metrics: Vec<usize> = metrics.map(|(at, _)| at).collect();
        for episode in &episodes {
            let reading = Reading { definitions: &definitions, episode };
            let expected: Vec<_> = metrics.iter().map(|at| reading.definition(*at, None).score()).collect();
            prop_assert_eq!(values(&table, &episode.episode_id), expected, "{}\n{:?}", text, episode);
        }
    }
}

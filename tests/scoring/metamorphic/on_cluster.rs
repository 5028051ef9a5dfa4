//! The same queries on Spark, in its own process on this machine.

use proptest::test_runner::RngSeed;

use super::engines::Engine;
use super::{check_definitions, check_parts, soak};

#[test]
fn parts_and_filters_fit_together_on_spark() {
    check_parts(Engine::Spark, 2, RngSeed::Fixed(20));
}

#[test]
#[ignore = "soak: 30 cases of parts and 100 of definitions"]
fn soak_parts_and_definitions_on_spark() {
    soak(100, |count, seed| {
        check_parts(Engine::Spark, count * 3 / 10, seed);
        check_definitions(Engine::Spark, count, seed);
    });
}

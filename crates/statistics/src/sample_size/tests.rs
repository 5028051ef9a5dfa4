//! Reference values: scipy 1.17.1, every outcome weighed by `binom.pmf`, the tests being `2 * binom.cdf` at 1/2,
//! `fisher_exact` and `binomtest`; sizes by trying each, smallest differences by `brentq`.
#![expect(clippy::unreadable_literal, reason = "reference values as their source prints them")]

use super::{Clusters, Fisher, McNemar, OneRate, Power, Rates, smallest};
use exact::ratio::Ratio;

const HOLM: f64 = 0.05 / 28.0;

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "found {found}, expected {expected}");
}

fn pairs(level: f64, rates: Rates) -> McNemar {
    McNemar::new(level, rates.difference(), rates.independent_discordance())
}

fn rates(lower: f64, higher: f64) -> Rates {
    Rates { lower, higher }
}

#[test]
fn the_power_over_pairs_is_the_known_one() {
    for (n, level, of, expected) in [
        (21, 0.05, rates(0.35, 0.65), 0.3573349060535207),
        (21, HOLM, rates(0.2, 0.9), 0.8660932225112565),
        (40, HOLM, rates(0.3, 0.7), 0.5798132303080298),
        (60, 0.01, rates(0.1, 0.3), 0.46885627425653903),
    ] {
        close(pairs(level, of).power(n), expected);
    }
    close(McNemar::new(0.05, 0.3, 0.4).power(30), 0.713146990445221);
    // All discordant pairs favour one model.
    close(McNemar::new(0.05, 0.3, 0.3).power(30), 0.9234052479924492);
}

#[test]
fn the_power_without_pairs_is_the_known_one() {
    for (n, level, of, expected) in [
        (21, 0.05, rates(0.35, 0.65), 0.3569567112674831),
        (21, HOLM, rates(0.2, 0.9), 0.9607203914437078),
        (30, HOLM, rates(0.3, 0.7), 0.4516049706906783),
        (17, 0.01, rates(0.1, 0.6), 0.5882535136464697),
    ] {
        close(Fisher { level, rates: of }.power(n), expected);
    }
}

#[test]
fn the_power_against_chance_is_the_known_one() {
    let ratio = |above, below| Ratio::new(above, below).unwrap();
    for (n, level, chance, rate, expected) in [
        (21, 0.05, ratio(1, 3), 0.6, 0.6914440331282141),
        (21, 0.05 / 8.0, ratio(1, 3), 0.7, 0.7229932023760066),
        (50, 0.05, ratio(1, 10), 0.25, 0.8363166660715647),
    ] {
        close(OneRate { level, chance, rate }.power(n), expected);
    }
}

#[test]
fn sizes_are_the_first_that_have_the_power() {
    let seeds = |seeds| Clusters { seeds, icc: 0.0 };
    let around = |difference| Rates::apart(difference, None).unwrap();
    assert_eq!(seeds(3).runs_for(0.8, &mut pairs(0.05, around(0.3))), Some(17));
    assert_eq!(seeds(1).runs_for(0.8, &mut pairs(HOLM, around(0.5))), Some(36));
    assert_eq!(seeds(3).runs_for(0.8, &mut Fisher { level: 0.05, rates: around(0.5) }), Some(6));
    let chance = Ratio::new(1, 3).unwrap();
    assert_eq!(seeds(3).runs_for(0.8, &mut OneRate { level: 0.05, chance, rate: 1.0 / 3.0 + 0.3 }), Some(8));
    // No difference is never found with more than the level.
    assert_eq!(seeds(200).runs_for(0.8, &mut pairs(0.05, around(0.0))), None);
}

#[test]
fn smallest_differences_are_the_known_ones() {
    let around = |difference| Rates::apart(difference, None).unwrap();
    let paired = |level| smallest(0.8, 1.0, |difference| pairs(level, around(difference)).power(21)).unwrap();
    close(paired(0.05), 0.4744232099584026);
    close(paired(HOLM), 0.675283428012498);
    let unpaired = smallest(0.8, 1.0, |difference| Fisher { level: 0.05, rates: around(difference) }.power(21));
    close(unpaired.unwrap(), 0.4697993119695569);
    assert_eq!(smallest(0.8, 1.0, |difference| pairs(0.05, around(difference)).power(5)), None);
}

#[test]
fn episodes_that_resemble_each_other_are_worth_less() {
    let effective = |icc, runs| Clusters { seeds: 3, icc }.effective(runs);
    assert_eq!([effective(0.0, 7), effective(0.1, 7), effective(1.0, 7), effective(0.1, 1)], [21, 13, 3, 3]);
    // However many runs: 3 seeds at 0.1 are worth no more than 30 episodes.
    assert_eq!(effective(0.1, 100_000), 29);
    let mut test = pairs(0.05, rates(0.35, 0.65));
    assert_eq!(Clusters { seeds: 3, icc: 0.1 }.runs_for(0.8, &mut test), None);
}

#[test]
fn rates_stay_within_zero_and_one() {
    assert_eq!(Rates::apart(0.3, Some(0.8)), None);
    assert_eq!(Rates::apart(1.2, None), None);
    assert_eq!(Rates::apart(0.5, Some(0.5)), Some(rates(0.5, 1.0)));
    let (least, most) = rates(0.35, 0.65).possible_discordance();
    close(least, 0.3);
    close(most, 1.0);
}

/// The search skips no size that the power has before the one it gives.
#[test]
fn no_smaller_size_has_the_power() {
    for difference in [0.2, 0.25, 0.35, 0.45, 0.6] {
        let rates = Rates::apart(difference, None).unwrap();
        let clusters = Clusters { seeds: 1, icc: 0.0 };
        let found = clusters.runs_for(0.8, &mut pairs(0.05, rates)).unwrap();
        let mut test = pairs(0.05, rates);
        assert_eq!((1..=found).find(|n| test.power(*n) >= 0.8), Some(found), "{difference}");
    }
}

//! Comparisons that follow from the declared design: pairs, clusters, conditions, strata.

use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{Method, Options, OverallMethod, OverallRow, Sign, Statistics};
use mirrorstats_metric::catalogs::catalog::Control;
use mirrorstats_statistics::design::{Cluster, Design, DesignKind};

use super::{
    CLUSTERED, RECORDED, Row, block, by_place, cells, contrast, labelled, recorded, statistics, study, with_scenes,
};

#[test]
fn models_are_paired_by_scene_and_tied_rather_than_ranked() {
    let found = recorded(&study());
    let family = found.models.iter().find(|family| family.experiment == "E1" && family.metric == "TSA").unwrap();
    assert_eq!(family.models, ["strong", "middle", "weak"]);
    assert!(family.tests.iter().all(|test| test.comparison.method == Method::Mcnemar && test.matching.pairs == 21));
    // strong - middle 7:0, p = 2/2^7, times 2 as the third but held up by 9:0; middle - weak 9:0; strong - weak 16:0
    let p: Vec<f64> = family.tests.iter().map(|test| test.comparison.p.unwrap()).collect();
    assert_eq!(p, [2.0 / 128.0, 2.0 / 65536.0, 2.0 / 512.0]);
    let adjusted: Vec<f64> = family.tests.iter().map(|test| test.comparison.p_adjusted.unwrap()).collect();
    assert_eq!(adjusted, [2.0 / 128.0, 6.0 / 65536.0, 4.0 / 512.0]);
    assert_eq!(family.tied, [["strong"], ["middle"], ["weak"]]);
    let other = found.models.iter().find(|family| family.experiment == "E2" && family.metric == "TSA").unwrap();
    assert_eq!(other.tied, [["strong", "middle", "weak"]]);
    let reach = family.detectable.unwrap();
    assert_eq!((reach.n, reach.tests, reach.single.unwrap().pairs, reach.family.unwrap().pairs), (21, 3, 6, 7));
    assert!(found.models.iter().all(|family| family.experiment != "E5"), "one model has no rival");
}

/// Equal seeds and runs do not make pairs, because the bodies differ.
#[test]
fn different_scenes_with_equal_seed_and_run_are_not_paired() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let found = with_scenes(&rows, RECORDED, |row| Some(format!("{} {} {}", row.1, row.2, row.3)));
    let test = &found.models[0].tests[0];
    assert_eq!((test.comparison.method, test.comparison.pairs, test.matching.alone), (Method::Fisher, None, 42));
    // scipy 1.17.1: fisher_exact([[21, 0], [7, 14]]).pvalue
    assert!((test.comparison.p.unwrap() / 4.399_526_904_206_901_5e-6 - 1.0).abs() < 1e-9, "{test:?}");
    assert!(found.design_note.contains("none of 1 comparison has pairs"), "{}", found.design_note);
}

/// Episodes with the same scene are a pair, whatever their seeds and runs.
#[test]
fn equal_scenes_are_pairs_under_other_seeds_and_runs() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let place = |row: &Row| row.2 * 7 + row.3;
    // The scenes of b come in the opposite order.
    let found =
        with_scenes(&rows, RECORDED, |row| Some((if row.1 == "a" { place(row) } else { 20 - place(row) }).to_string()));
    let test = &found.models[0].tests[0];
    assert_eq!((test.comparison.method, test.matching.pairs), (Method::Mcnemar, 21));
    let shuffled = with_scenes(&rows, RECORDED, |row| {
        Some(if row.1 == "a" || place(row) < 4 { place(row) } else { 100 + place(row) }.to_string())
    });
    let test = &shuffled.models[0].tests[0];
    assert_eq!((test.comparison.method, test.matching.pairs, test.matching.alone), (Method::Units, 4, 34), "{test:?}");
}

#[test]
fn reconstructions_and_undeclared_traces_have_neither_pairs_nor_clusters() {
    let made_up = Design { kind: Some(DesignKind::Reconstruction), cluster: Some(Cluster::Seed) };
    for (found, note) in [
        (with_scenes(&study(), made_up, by_place), "reconstructed episodes"),
        (statistics(&study()), "declare no design"),
    ] {
        assert!(found.models.iter().all(|family| family.tests.iter().all(|test| test.comparison.pairs.is_none())));
        assert!(found.conditions.iter().all(|contrast| contrast.comparison.pairs.is_none()));
        assert_eq!((found.clusters.len(), found.gaps.len()), (0, 0));
        assert!(found.warnings[0].contains(note), "{:?}", found.warnings);
        let text = found.render(&found.headline, Length::Tables, None);
        assert!(text.contains("Fisher") && !text.contains("pairs of equal") && text.contains(note), "{text}");
    }
}

#[test]
fn episodes_without_a_scene_are_counted_and_left_out_of_pairs() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let found = with_scenes(&rows, RECORDED, |row| if row.2 < 2 { by_place(row) } else { None });
    let test = &found.models[0].tests[0];
    assert_eq!((test.matching.pairs, test.matching.undeclared, test.matching.alone), (14, 14, 0));
    assert_eq!((test.comparison.method, test.comparison.n), (Method::Units, [21, 21]));
}

#[test]
fn repeats_of_a_scene_are_counted_but_not_paired() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let found = with_scenes(&rows, RECORDED, |row| Some(row.2.to_string()));
    let test = &found.models[0].tests[0];
    assert_eq!((test.matching.pairs, test.matching.repeated, test.comparison.method), (0, 42, Method::Units));
    assert!(found.warnings.iter().any(|line| line.contains("counts each scene once")), "{:?}", found.warnings);
}

#[test]
fn episodes_without_a_partner_are_counted_and_named() {
    let mut rows = [block("E1", "a", 21, 9), block("E1", "b", 0, 9)].concat();
    rows.retain(|row| !(row.1 == "b" && row.2 == 2 && row.3 == 6));
    rows.push(("E1", "b", 0, 0, false, -100));
    let found = recorded(&rows);
    let gaps: Vec<_> =
        found.gaps.iter().map(|gap| (gap.key.model.as_str(), gap.scene.as_str(), gap.episodes)).collect();
    assert_eq!(gaps, [("b", "room 0 body 0", 2), ("b", "room 2 body 6", 0)]);
    let test = &found.models[0].tests[0];
    assert_eq!((test.matching.pairs, test.matching.alone, test.matching.repeated), (19, 1, 3));
    assert_eq!(test.comparison.undefined, 0);
    let undefined = &found.models.iter().find(|family| family.metric == "TSA-C").unwrap().tests[0].comparison;
    assert_eq!((undefined.n, undefined.undefined, undefined.p), ([0, 0], 19, None));
    assert!(
        found.warnings.iter().any(|warning| warning.contains("E1 b scene room 2 body 6 (missing)")),
        "{:?}",
        found.warnings
    );
}

#[test]
fn experiments_with_the_same_scenes_are_compared_by_pairs() {
    let found = recorded(&study());
    let rate = &contrast(&found, "strong", "TSA", "E2").comparison;
    // 21/21 and 7/21 with the same first seven: 14:0, p = 2/2^14; Holm over three models: 3 p
    assert_eq!((rate.method, rate.difference), (Method::Mcnemar, Some(14.0 / 21.0)));
    assert_eq!((rate.p, rate.p_adjusted), (Some(2.0 / 16384.0), Some(6.0 / 16384.0)));
    assert_eq!(rate.sign(), Some(Sign::Higher));
    // Python: Newcombe's method 10 over the Wilson limits of statsmodels 0.15.0
    let interval = rate.interval.unwrap();
    assert!(
        (interval.low - 0.403_506_401_110_196_8).abs() < 1e-9 && (interval.high - 0.828_052_473_949_165_4).abs() < 1e-9,
        "{interval:?}"
    );
    let steps = &contrast(&found, "strong", "TTD", "E2").comparison;
    assert_eq!((steps.method, steps.horizon), (Method::RestrictedMeanPaired, Some(100)));
    assert!((steps.difference.unwrap() - (12.0 - (7.0 * 20.0 + 14.0 * 100.0) / 21.0)).abs() < 1e-9);
    assert!(
        found.answers.iter().any(|answer| answer.answer.starts_with("E1 - E2 higher for middle, strong")),
        "{:?}",
        found.answers
    );
}

#[test]
fn experiments_with_other_scenes_are_compared_as_independent() {
    let found = with_scenes(&study(), RECORDED, |row| Some(format!("{} {} {}", row.0, row.2, row.3)));
    let rate = &contrast(&found, "strong", "TSA", "E2").comparison;
    assert_eq!((rate.method, rate.successes, rate.n), (Method::Fisher, Some([21, 7]), [21, 21]));
    assert_eq!(contrast(&found, "strong", "TTD", "E2").comparison.method, Method::RestrictedMean);
    assert_eq!(contrast(&found, "strong", "MTATO", "E2").comparison.n, [21, 7]);
}

/// Pairs are pooled over all experiments; for independent episodes the experiments are strata.
#[test]
fn models_are_compared_over_all_experiments() {
    let overall = |found: &Statistics| {
        let is_it = |row: &&OverallRow| {
            (row.metric.as_str(), row.first.as_str(), row.second.as_str()) == ("TSA", "strong", "weak")
        };
        found.overall.iter().find(is_it).unwrap().clone()
    };
    // E1 16:0 and E2 2:0, with two scenes in common: 16:0 by scene, p = 2/2^16; Holm over three pairs
    let paired = overall(&recorded(&study()));
    assert_eq!(
        (paired.method, paired.p, paired.p_adjusted),
        (OverallMethod::Units, Some(2.0 / 65_536.0), Some(6.0 / 65_536.0))
    );
    assert_eq!(paired.experiments, ["E1", "E2"]);
    let apart = overall(&statistics(&study()));
    assert_eq!(apart.method, OverallMethod::MantelHaenszel);
    // Strata of 21 and 21: the mean of 16/21 and 2/21.
    assert!((apart.difference.unwrap() - 9.0 / 21.0).abs() < 1e-12, "{apart:?}");
    // Python, fractions: the sums of two hypergeometric counts at most as probable as 28
    assert!((apart.p.unwrap() / 5.576_486_641_926_384e-5 - 1.0).abs() < 1e-9, "{apart:?}");
}

#[test]
fn three_seeds_are_not_enough_for_a_claim_about_seeds_and_six_are() {
    let warns = |found: &Statistics| {
        found.warnings.iter().any(|warning| warning.contains("too few for a claim about new seeds"))
    };
    let clustered = |rows: &[Row]| with_scenes(rows, CLUSTERED, by_place);
    let three = clustered(&block("E1", "a", 10, 9));
    assert_eq!(three.clusters[0].by_seed.unwrap().clusters, 3);
    assert!(warns(&three));
    let six: Vec<Row> = (0..12).map(|at| ("E1", "a", at / 2, at % 2, at % 3 == 0, 9)).collect();
    assert!(!warns(&clustered(&six)));
    let one: Vec<Row> = (0..3).map(|run| ("E1", "a", 0, run, true, 9)).collect();
    assert_eq!(clustered(&one).clusters[0].by_seed, None);
    let undeclared = with_scenes(&block("E1", "a", 10, 9), Design { cluster: None, ..RECORDED }, by_place);
    assert!(undeclared.clusters.is_empty() && !warns(&undeclared));
}

#[test]
fn the_level_of_a_warning_follows_the_confidence() {
    let table = labelled(&block("E1", "a", 10, 9), "scene", by_place);
    let options = Options { confidence: 0.8, design: CLUSTERED, ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    let said = found.warnings.iter().find(|warning| warning.contains("new seeds")).unwrap();
    assert!(said.contains("no test over fewer than 4 can reach p = 0.2."), "{said}");
}

#[test]
fn conditions_of_one_model_are_compared_like_models() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 21, 9), block("E2", "a", 3, 9)].concat();
    let mut table = labelled(&rows, "condition", |row| (row.2 < 2).then(|| "pocket mirror".to_owned()));
    let text = {
        let found = Statistics::from_table(&table, &cells(&table), &Options::default()).unwrap();
        let family = found.models.iter().find(|family| family.experiment == "E1" && family.metric == "TSA").unwrap();
        assert_eq!(family.models, ["a [default]", "a [pocket mirror]", "b [default]", "b [pocket mirror]"]);
        assert_eq!(found.durations[0].key.condition.as_deref(), Some("default"));
        let both = found.conditions.iter().filter(|contrast| contrast.metric == "TSA");
        let names: Vec<_> =
            both.map(|contrast| (contrast.condition.as_deref().unwrap(), contrast.comparison.n)).collect();
        assert_eq!(names, [("default", [7, 7]), ("pocket mirror", [14, 14])]);
        found.render(&found.headline, Length::Full, None)
    };
    assert!(text.contains("a [pocket mirror]"), "{text}");
    table.labels[0].values = rows.iter().map(|_| Some("default")).collect();
    let found = Statistics::from_table(&table, &cells(&table), &Options::default()).unwrap();
    assert!(!serde_json::to_string(&found).unwrap().contains("\"condition\":"), "one condition is none");
}

/// E1 is the control of E2 for TSA only: E2 minus E1, and no other metric.
#[test]
fn declared_controls_decide_which_experiments_and_metrics_are_contrasted() {
    let rows = [block("E1", "a", 7, 9), block("E2", "a", 21, 9), block("E5", "a", 7, 9)].concat();
    let of = |found: &Statistics| -> Vec<[String; 3]> {
        let names =
            |it: &mirrorstats_analysis::statistics::Contrast| [&it.baseline, &it.against, &it.metric].map(Clone::clone);
        found.conditions.iter().map(names).collect()
    };
    let mut table = labelled(&rows, "scene", by_place);
    let options = Options { design: RECORDED, ..Options::default() };
    let undeclared = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    assert_eq!(of(&undeclared).len(), 4, "E1 minus E2 on each metric");
    assert!(undeclared.warnings.iter().any(|words| words.starts_with("E5 is not contrasted with E1:")));
    let control = Control { of: "E2".into(), on: vec!["TSA".into()] };
    table.catalog.experiment["E1"].control = Some(control);
    let declared = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    assert_eq!(of(&declared), [["E2", "E1", "TSA"].map(str::to_owned)]);
    assert!(!declared.warnings.iter().any(|words| words.contains("is not contrasted")), "{:?}", declared.warnings);
    let (before, after) = (contrast(&undeclared, "a", "TSA", "E2"), &declared.conditions[0]);
    assert_eq!(after.comparison.difference.map(|it| -it), before.comparison.difference);
    assert_eq!(after.comparison.p, before.comparison.p);
}

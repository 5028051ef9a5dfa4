use super::register::{NamedHash, RegisteredPlan};
use super::{Given, PlanRequest, TestName, plan};
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_statistics::sample_size::Clusters;

const PAPER: PlanRequest = PlanRequest {
    given: Given::Runs(7),
    baseline: None,
    power: 0.8,
    confidence: 0.95,
    models: 8,
    clusters: Clusters { seeds: 3, icc: 0.0, people: false },
    discordance: None,
    chance: None,
    sequential: false,
};

#[test]
fn the_answer_comes_first() {
    let chance = Ratio::new(1, 3);
    let requests = [
        PlanRequest { given: Given::Difference(0.3), chance, ..PAPER },
        PlanRequest { chance, ..PAPER },
        PlanRequest {
            given: Given::Difference(0.3),
            clusters: Clusters { seeds: 3, icc: 0.1, people: false },
            ..PAPER
        },
        PlanRequest {
            given: Given::Runs(3),
            clusters: Clusters { seeds: 7, icc: 0.1, people: false },
            models: 2,
            chance,
            ..PAPER
        },
        PlanRequest { given: Given::Difference(0.5), models: 2, sequential: true, chance, ..PAPER },
        PlanRequest { given: Given::Runs(1), models: 2, ..PAPER },
        PlanRequest { given: Given::Difference(0.4), baseline: Some(0.5), discordance: Some(0.5), ..PAPER },
    ];
    let told: Vec<String> = requests.map(|request| plan(request).unwrap().render(None)).into();
    insta::assert_snapshot!(told.join("\n\n"));
}

// scipy 1.17.1: every outcome weighted by `binom.pmf`, `2 * binom.cdf` at 1/2, `brentq` at power 0.8.
#[test]
fn the_papers_episodes_show_what_the_reference_says() {
    let found = plan(PAPER).unwrap();
    let difference = |test, family| {
        let of = |planned: &&super::PlannedTest| planned.test == test && planned.family == family;
        found.tests.iter().find(of).unwrap().difference.unwrap()
    };
    for (test, family, expected) in [
        (TestName::Paired, 1, 0.474_423_209_958_402_6),
        (TestName::Paired, 28, 0.675_283_428_012_498),
        (TestName::Unpaired, 1, 0.469_799_311_969_556_9),
    ] {
        assert!((difference(test, family) - expected).abs() < 1e-9, "{test:?} {family}");
    }
}

#[test]
fn impossible_plans_are_refused() {
    let message = |request: PlanRequest| plan(request).unwrap_err().to_string();
    let told = [
        message(PlanRequest { given: Given::Difference(0.6), baseline: Some(0.5), ..PAPER }),
        message(PlanRequest { given: Given::Difference(0.4), discordance: Some(0.3), ..PAPER }),
        message(PlanRequest { given: Given::Runs(1000), ..PAPER }),
        message(PlanRequest { given: Given::Runs(300), sequential: true, ..PAPER }),
    ];
    insta::assert_snapshot!(told.join("\n"));
}

#[test]
fn a_registered_plan_shows_a_change() {
    let definitions = NamedHash { name: "paper".to_owned(), sha256: "0".repeat(64) };
    let register = || RegisteredPlan::new(plan(PAPER).unwrap(), definitions.clone(), Vec::new(), Vec::new());
    assert_eq!(register().to_json(), register().to_json());
    let mut read: RegisteredPlan = serde_json::from_str(&register().to_json()).unwrap();
    assert_eq!(read, register());
    assert!(read.is_unchanged());
    read.plan.request.power = 0.7;
    assert!(!read.is_unchanged());
}

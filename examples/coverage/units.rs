//! Error rates of tests with repeated scenes: by scene, and as if episodes were independent.

use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_statistics::chance;
use mirrorstats_statistics::comparisons::holm::holm;
use mirrorstats_statistics::comparisons::units::{Sides, difference_test, rate_test};
use mirrorstats_statistics::comparisons::unpaired::fisher;
use mirrorstats_statistics::intervals::clustered::fewest_clusters;
use mirrorstats_statistics::intervals::random::SplitMix64;

use crate::{LEVEL, SEED, happens, heading, row, share};

const STUDIES: usize = 1000;
const MODELS: usize = 8;

/// The successes of each model in each scene.
type Study = Vec<Vec<Moments>>;

/// The number of scenes, the repeats of each, and the chance that a repeat copies the scene's verdict.
#[derive(Clone, Copy)]
struct Design {
    scenes: usize,
    repeats: usize,
    copied: f64,
}

fn draw(random: &mut SplitMix64, Design { scenes, repeats, copied }: Design, rates: [f64; MODELS]) -> Study {
    let mut scene = |rate: f64| {
        let verdict = happens(random, rate);
        let mut episode = || if happens(random, copied) { verdict } else { happens(random, rate) };
        let ones = (0..repeats).filter(|_| episode()).count();
        Moments::default().with_truths(repeats - ones, ones).expect("few episodes")
    };
    rates.map(|rate| (0..scenes).map(|_| scene(rate)).collect()).to_vec()
}

fn counts(model: &[Moments]) -> (u64, u64) {
    let add = |(successes, n): (u64, u64), unit: &Moments| {
        let (more, episodes) = unit.counts().expect("truths");
        (successes + more, n + episodes)
    };
    model.iter().fold((0, 0), add)
}

/// The adjusted p values of each model against 1/3: by scene, by episode.
fn against_chance(study: &Study) -> [Vec<f64>; 2] {
    let third = Ratio::new(1, 3).expect("a fraction");
    let by_scene = study.iter().map(|model| rate_test(model, third).expect("there are scenes").0.p);
    let by_episode = study.iter().map(|model| {
        let (successes, n) = counts(model);
        chance::two_sided(successes, n, third).expect("there are episodes")
    });
    [holm(&by_scene.collect::<Vec<_>>()), holm(&by_episode.collect::<Vec<_>>())]
}

/// The adjusted p values of each pair of models: by scene, by episode.
fn between_models(study: &Study) -> [Vec<f64>; 2] {
    let pairs = || (0..MODELS).flat_map(|a| (a + 1..MODELS).map(move |b| (a, b)));
    let by_scene = pairs().map(|(a, b)| {
        let shared: Vec<_> = study[a].iter().copied().zip(study[b].iter().copied()).collect();
        difference_test(&Sides { shared, ..Sides::default() }).expect("few outcomes").p
    });
    let by_episode = pairs().map(|(a, b)| fisher(counts(&study[a]), counts(&study[b])).expect("there are episodes").p);
    [holm(&by_scene.collect::<Vec<_>>()), holm(&by_episode.collect::<Vec<_>>())]
}

/// The shares of studies in which each family claims anything. Too few scenes claim nothing, as in `stats`.
fn claims(random: &mut SplitMix64, design: Design, rates: [f64; MODELS]) -> [f64; 4] {
    let mut found = [0; 4];
    for _ in 0..STUDIES {
        let study = draw(random, design, rates);
        let families = against_chance(&study).into_iter().chain(between_models(&study));
        for (at, (count, family)) in found.iter_mut().zip(families).enumerate() {
            let too_few = at % 2 == 0 && design.scenes < fewest_clusters(LEVEL);
            *count += usize::from(!too_few && family.iter().any(|p| *p <= LEVEL));
        }
    }
    found.map(|count| share(count, STUDIES))
}

pub fn repeats() {
    let note = "1,000 studies of 8 models each: shares with any claim after Holm. If all rates are 1/3, each claim is false. A repeat\n\
                copies its scene's verdict always (1), in 0.45 of cases (correlation 0.2), or never (0).";
    let columns = [
        "scenes x repeats, copied",
        "chance, by scene",
        "chance, by episode",
        "models, by scene",
        "models, by episode",
    ];
    let mut random = SplitMix64::seeded(SEED + 20);
    let third = 1.0 / 3.0;
    for (title, rates) in [
        ("Repeats of a scene, no difference", [third; MODELS]),
        ("Repeats of a scene, half of the models at 0.9", [third, third, third, third, 0.9, 0.9, 0.9, 0.9]),
    ] {
        heading(title, note, &columns);
        for (scenes, repeats) in [(3, 3), (3, 7), (5, 3), (7, 3), (12, 3), (21, 2), (60, 2)] {
            for copied in [1.0, 0.45, 0.0] {
                let design = Design { scenes, repeats, copied };
                row(&format!("{scenes} x {repeats}, {copied}"), &claims(&mut random, design, rates));
            }
        }
    }
}

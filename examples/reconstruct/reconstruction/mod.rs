//! The paper's 840 episodes, rebuilt from its publication.
//!
//! Steps: [`published`] cells, under the rules of [`printing`], give the integers of each model in each experiment
//! ([`counts`], [`belief`], [`durations`]). These become 21 [`outline`]s, and each outline becomes an [`episode`]: what
//! the agent saw ([`gaze`]), said ([`attribution`]) and did. [`files`] writes them.
//!
//! Rule: the only source is the published cells, and a seeded [`generator`] decides what they leave open. So the result
//! is the same on every machine, and it is a reconstruction, not a recording.

pub mod attribution;
pub mod belief;
pub mod contradiction;
pub mod counts;
pub mod durations;
pub mod episode;
pub mod errata;
pub mod files;
pub mod gaze;
pub mod generator;
pub mod outline;
pub mod printing;
pub mod published;
pub mod scene;

use mirrorstats_trace::episodes::episode::Episode;

use contradiction::Contradiction;
use errata::Erratum;
use published::{Pair, Reading};

/// Three seeds of seven runs.
pub const SEEDS: i32 = 3;
/// The runs of a seed.
pub const RUNS: i32 = 7;
/// The episodes of a model in an experiment.
pub const EPISODES: usize = 21;
/// The most steps that an episode may take.
pub const BUDGET: usize = 100;

/// The 21 episodes of one model in one experiment, ordered by seed and run.
///
/// # Errors
/// If the pair's published cells contradict each other.
pub fn episodes(pair: &Pair) -> Result<Vec<Episode>, Contradiction> {
    let outlines = outline::solve(pair)?;
    let places = (1..=SEEDS).flat_map(|seed| (1..=RUNS).map(move |run| (seed, run)));
    Ok(places.zip(&outlines).map(|((seed, run), outline)| episode::build(pair, seed, run, outline)).collect())
}

/// The published cells that no episodes can explain as printed, each with its erratum.
pub fn contradictions() -> Vec<(Contradiction, Option<&'static Erratum>)> {
    let found = published::pairs(Reading::AsPrinted).into_iter().filter_map(|pair| outline::solve(&pair).err());
    found
        .map(|cell| {
            let erratum = errata::of(&cell.experiment, &cell.model, &cell.metric);
            (cell, erratum)
        })
        .collect()
}

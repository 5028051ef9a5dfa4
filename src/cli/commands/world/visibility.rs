//! `mirrorstats world visibility`: a row per experiment.

use crate::cli::Failure;
use mirrorstats_experiment::Experiment;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::placement::Ways;
use mirrorstats_sim::visibility::SelfVisibility;

pub(super) const HEAD: &str = "\
| experiment | places | evidence from, % | median px | most px | farthest, m | unoccluded, % | shortest way |
|---|---|---|---|---|---|---|---|
";

/// A share in per cent with one decimal; `None` of nothing.
fn percent(part: u64, whole: u64) -> Option<String> {
    let tenths = (1000 * part + whole / 2).checked_div(whole)?;
    Some(format!("{}.{}", tenths / 10, tenths % 10))
}

pub(super) fn row(config: &WorldConfig, experiment: &Experiment) -> Result<String, Failure> {
    let seen = SelfVisibility::measured(config, experiment)?;
    let px = |at: usize| seen.px.get(at).map(u32::to_string);
    let cells = [
        Some(experiment.name().to_owned()),
        Some(seen.places.to_string()),
        percent(seen.px.len() as u64, seen.places as u64),
        px(seen.px.len() / 2),
        px(seen.px.len().wrapping_sub(1)),
        (!seen.px.is_empty()).then(|| format!("{:.1}", seen.farthest)),
        percent(seen.unoccluded[0], seen.unoccluded[1]),
        Ways::measured(config, experiment).map(|ways| ways.described()),
    ];
    let cells = cells.map(|cell| cell.unwrap_or_else(|| "-".to_owned()));
    Ok(format!("| {} |\n", cells.join(" | ")))
}

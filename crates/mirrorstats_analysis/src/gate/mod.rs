//! Compares later episodes with earlier ones, cell by cell: improved, held, regressed, or why there is no verdict.
//!
//! Rule: a loss within the margin is accepted, so `held` comes before `regressed`. Every verdict is Holm-adjusted over
//! the cells, based on the unit of analysis, and valid for every outcome of the lost episodes.

#![expect(clippy::cast_precision_loss, reason = "counts of tests are far below 2^53")]

mod sides;
mod text;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use sides::{FlippedPair, Played};
pub use text::GateFormat;

use self::sides::{GateSides, LossFill, joined};
use crate::comparable::Varied;
use crate::statistics::comparisons::compare::{Compared, Comparison};
use crate::statistics::comparisons::matching::{Matched, Scenes, Units};
use crate::statistics::{DesignAudit, Options, Replies};
use crate::study::{Block, Study};
use mirrorstats_exact::format::{fixed, p_value};
use mirrorstats_exact::moments::MomentOverflow;
use mirrorstats_metric::catalogs::catalog::{Better, Kind, Metric};
use mirrorstats_score::quality::CellKey;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};
use mirrorstats_statistics::comparisons::holm::{holm, level};
use mirrorstats_statistics::comparisons::margin;
use mirrorstats_statistics::design::Design;
use mirrorstats_statistics::intervals::interval::Interval;

#[derive(Clone, Debug, PartialEq)]
pub struct GateOptions {
    /// The metric, which both sides need, with a better direction.
    pub metric: String,
    /// The largest accepted loss, in the unit of the metric.
    pub margin: f64,
    /// One minus the level of every verdict.
    pub confidence: f64,
    /// True to ignore differing settings.
    pub pool: bool,
}

/// The verdict on the later episodes of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GateVerdict {
    /// Shown to be better.
    Improved,
    /// Shown not to be worse by the margin or more.
    Held,
    /// None of the others is shown.
    CannotSay,
    /// Recorded differently, or on one side alone.
    #[default]
    NotComparable,
    /// Shown to be worse, and not shown to be within the margin.
    Regressed,
}

/// All cells of two sets of episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Gate {
    /// The metric.
    pub metric: String,
    /// The largest loss that is accepted, in the unit of the metric.
    pub margin: f64,
    /// One minus the level of every verdict.
    pub confidence: f64,
    /// The gravest verdict: regressed, not comparable, cannot say, held, improved.
    pub verdict: GateVerdict,
    /// Settings that differ and were declared not to matter, the filter, and replies without a decision: a sentence each.
    pub caveats: Vec<String>,
    /// The cells, in the order of the experiments, then by model and condition.
    pub cells: Vec<GateCell>,
}

/// One experiment and model, later against earlier.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GateCell {
    /// The experiment.
    pub experiment: String,
    /// The model, by its later name.
    pub model: String,
    /// Its earlier name, where that is another one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_model: Option<String>,
    /// The condition, where it is not the default one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The verdict.
    pub verdict: GateVerdict,
    /// The reason for the verdict, or the obstacle.
    pub why: String,
    /// The earlier episodes.
    pub base: GateSide,
    /// The later episodes.
    pub new: GateSide,
    /// The later mean minus the earlier one: over the units, where each counts once, else over the episodes compared.
    pub difference: Option<f64>,
    /// Its interval, not adjusted.
    pub interval: Option<Interval>,
    /// The two-sided p value of the difference, adjusted by Holm's method over the cells; null for quantities.
    pub p_adjusted: Option<f64>,
    /// The one-sided p value of a loss of the margin or more, adjusted likewise; null for quantities.
    pub(crate) p_held: Option<f64>,
    /// The units of analysis where some have several episodes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
    /// The units on each side with which a verdict would be likely, if the rates stay unchanged; null with a verdict.
    pub settled_by: Option<u64>,
    /// The scenes in which the value changed.
    pub flips: Vec<FlippedPair>,
}

/// The episodes of one side of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GateSide {
    /// The episodes in which the metric is defined.
    pub n: u64,
    /// The successes among them; null for quantities.
    pub successes: Option<u64>,
    /// The mean.
    pub mean: Option<f64>,
    /// The mean over units, each counted once as the verdict does; null where each episode is its own unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_mean: Option<f64>,
    /// The episodes that were lost, which are not counted.
    pub lost: u64,
}

/// A study of both sides, and the question to it.
struct Judge<'s, 'a> {
    study: &'s Study<'a>,
    column: &'s MetricColumn,
    options: &'s GateOptions,
    /// The number of cells that are compared.
    tests: usize,
}

struct Tried<'s, 'a> {
    blocks: [&'s Block<'a>; 2],
    comparison: Comparison,
    spread: Option<margin::Spread>,
    held: Option<f64>,
}

impl Gate {
    pub fn between(
        [base, new]: [&EpisodeTable; 2],
        design: Design,
        options: &GateOptions,
    ) -> Result<Self, MomentOverflow> {
        let sides = GateSides::of(base, new);
        let barrier = sides.barrier().filter(|_| !options.pool);
        let counted = joined(&sides, options, LossFill::Out);
        let study = sides::study(&counted, design, options.confidence)?;
        let mut cells = judged(&study, options, barrier.as_deref());
        let lost = [base, new].map(LostCounts::of_table);
        let all = sides.lost(&lost);
        let is_known = |cells: &[GateCell], key: &CellKey| {
            let key = (&*key.experiment, &*key.model, &*key.condition);
            cells.iter().any(|cell| cell.key() == key)
        };
        let unknown: Vec<&CellKey> = all.iter().map(|(key, _)| key).filter(|key| !is_known(&cells, key)).collect();
        cells.extend(unknown.into_iter().map(GateCell::lost));
        for cell in &mut cells {
            let base_model = sides.base_model(&cell.model);
            let (experiment, model, condition) = cell.key();
            let [earlier, later] = [(&lost[0], base_model.unwrap_or(model)), (&lost[1], model)]
                .map(|(lost, model)| lost.of(experiment, model, Some(condition)));
            (cell.base.lost, cell.new.lost) = (earlier, later);
            for (name, side) in [("BASE", cell.base), ("NEW", cell.new)] {
                if cell.verdict == GateVerdict::NotComparable && side.n == 0 && side.lost > 0 {
                    cell.verdict = GateVerdict::CannotSay;
                    cell.why = format!("all episodes of {name} were lost ({})", side.lost);
                }
            }
            cell.base_model = base_model.map(str::to_owned);
        }
        if cells.iter().any(|cell| cell.base.lost + cell.new.lost > 0) {
            for fill in [LossFill::Against, LossFill::For] {
                let filled = joined(&sides, options, fill);
                let bound = judged(&sides::study(&filled, design, options.confidence)?, options, barrier.as_deref());
                let verdicts: BTreeMap<_, _> = bound.iter().map(|cell| (cell.key(), cell.verdict)).collect();
                for cell in &mut cells {
                    cell.bounded_by(verdicts.get(&cell.key()).copied(), fill);
                }
            }
        }
        let verdict = cells.iter().map(|cell| cell.verdict).max().unwrap_or(GateVerdict::CannotSay);
        let GateOptions { metric, margin, confidence, .. } = options.clone();
        let mut caveats = Vec::new();
        for setting in sides.barrier().into_iter().chain(apart(&study)).filter(|_| options.pool) {
            let sentence = format!("Compared though they differ (--pool): {setting}.");
            if !caveats.contains(&sentence) {
                caveats.push(sentence);
            }
        }
        caveats.extend(DesignAudit::of(&study, &Options { lost: Some(all), ..Options::default() }).sentences());
        for (side, table) in [("BASE", base), ("NEW", new)] {
            let replies = Replies::from_table(table).and_then(|replies| replies.sentence());
            caveats.extend(replies.map(|sentence| format!("{side}: {sentence}")));
        }
        Ok(Self { metric, margin, confidence, verdict, caveats, cells })
    }
}

fn apart(study: &Study) -> Vec<String> {
    let couples = study.experiments.iter().flat_map(|experiment| sides::couples(&experiment.blocks));
    couples.filter_map(|[base, new]| study.setting_between(base?, new?, Varied::Model)).collect()
}

fn judged(study: &Study, options: &GateOptions, barrier: Option<&str>) -> Vec<GateCell> {
    let Some(column) = study.column(&options.metric) else { return Vec::new() };
    let couples: Vec<_> = study.experiments.iter().flat_map(|experiment| sides::couples(&experiment.blocks)).collect();
    let setting = |couple: &[Option<&Block>; 2]| match couple {
        [Some(base), Some(new)] if !options.pool => {
            barrier.map(str::to_owned).or_else(|| study.setting_between(base, new, Varied::Model))
        }
        [Some(_), Some(_)] => None,
        [None, _] => Some("BASE has no episode".to_owned()),
        [_, None] => Some("NEW has no episode".to_owned()),
    };
    let settings: Vec<Option<String>> = couples.iter().map(setting).collect();
    let tests = settings.iter().filter(|setting| setting.is_none()).count();
    let judge = Judge { study, column, options, tests };
    let tried = couples.iter().zip(&settings).map(|(&[base, new], setting)| {
        let blocks = [base?, new?];
        setting.is_none().then(|| judge.tried(blocks))
    });
    let tried: Vec<Option<Tried>> = tried.collect();
    let adjusted =
        |of: fn(&Tried) -> Option<f64>| holm(&tried.iter().flatten().filter_map(of).collect::<Vec<_>>()).into_iter();
    let (mut apart, mut held) = (adjusted(|tried| tried.comparison.p), adjusted(|tried| tried.held));
    let cells = couples.iter().zip(settings).zip(&tried).map(|((couple, setting), tried)| {
        let cell = judge.blank(*couple, setting);
        let Some(tried) = tried else { return cell };
        let adjusted = [tried.comparison.p.and_then(|_| apart.next()), tried.held.and_then(|_| held.next())];
        judge.decided(cell, tried, adjusted)
    });
    cells.collect()
}

impl<'s, 'a> Judge<'s, 'a> {
    fn metric(&self) -> &'a Metric {
        self.study.metric(&self.column.name)
    }

    fn tried(&self, blocks: [&'s Block<'a>; 2]) -> Tried<'s, 'a> {
        let ([base, new], study, options) = (blocks, self.study, self.options);
        let matched = Matched::of(&Scenes::of(study, new), &Scenes::of(study, base));
        let at = |confidence| {
            Compared { study, first: new, second: base, matched: &matched, horizon: None, confidence }
                .under(self.column)
        };
        let is_lower = self.metric().better == Better::Lower;
        let comparison = at(options.confidence);
        if self.metric().kind == Kind::Rate {
            let gained = if is_lower { comparison.counts.swapped() } else { comparison.counts };
            return Tried { blocks, held: gained.non_inferior(options.margin), spread: gained.spread(), comparison };
        }
        // Verdicts on a quantity use its interval, at the Bonferroni level.
        let share = (1.0 - options.confidence) / self.tests.max(1) as f64;
        let told_apart = at(1.0 - share);
        let within = told_apart.within(share, at);
        let bound = |interval: Interval| if is_lower { -interval.high } else { interval.low };
        let is_apart = told_apart.interval.is_some_and(|interval| interval.low > 0.0 || interval.high < 0.0);
        let is_within = within.is_some_and(|interval| bound(interval) > -options.margin);
        let shown = |is_shown: bool| Some(if is_shown { 0.0 } else { 1.0 });
        let units = comparison.n[0].min(comparison.n[1]);
        let spread = comparison.difference.zip(comparison.interval).map(|(difference, interval)| {
            let gain = if is_lower { -difference } else { difference };
            margin::Spread::of_interval(gain, interval, options.confidence, units)
        });
        let comparison = Comparison { p: shown(is_apart), ..comparison };
        Tried { blocks, comparison, spread, held: shown(is_within) }
    }

    fn blank(&self, [base, new]: [Option<&Block>; 2], setting: Option<String>) -> GateCell {
        let (model, experiment) = new.or(base).map_or(("", ""), |block| (block.model, block.experiment));
        let metric = self.metric();
        let side = |block: Option<&Block>| {
            let moments = block.map(|block| block.moments(self.column)).unwrap_or_default();
            let successes = moments.counts().filter(|_| metric.kind == Kind::Rate).map(|counts| counts.0);
            let unit_mean = block.filter(|block| block.repeats).and_then(|block| self.study.mean(block, self.column));
            let unit_mean = unit_mean.map(|mean| metric.in_unit(mean));
            GateSide { n: moments.n, successes, mean: metric.mean(&moments), unit_mean, lost: 0 }
        };
        GateCell {
            experiment: experiment.to_owned(),
            model: model.to_owned(),
            condition: new.or(base).and_then(sides::condition),
            why: setting.unwrap_or_default(),
            base: side(base),
            new: side(new),
            ..GateCell::default()
        }
    }

    fn decided(&self, cell: GateCell, tried: &Tried, [p_adjusted, p_held]: [Option<f64>; 2]) -> GateCell {
        let GateOptions { margin, confidence, .. } = *self.options;
        let study = self.study;
        let Tried { blocks: [base, new], comparison, spread, .. } = tried;
        let alpha = level(confidence).unwrap_or_default();
        let sign = if self.metric().better == Better::Lower { -1.0 } else { 1.0 };
        let gain = comparison.difference.map_or(0.0, |difference| sign * difference);
        // Units that no outcome could make significant, as `stats` has it. Lost episodes bound the verdict afterwards.
        let too_few = Comparison { losses: None, ..comparison.clone() }.unsaid(confidence);
        let is_mixed = study.unit_name(base) != study.unit_name(new);
        // Without any difference the exact test shows nothing at any number of units, but a margin may hold.
        let is_held = !is_mixed && !comparison.is_few(confidence) && p_held.is_some_and(|p| p <= alpha);
        let is_apart = too_few.is_none() && p_adjusted.is_some_and(|p| p <= alpha);
        let verdict = match () {
            () if comparison.selected.is_some() => GateVerdict::CannotSay,
            () if is_apart && gain > 0.0 => GateVerdict::Improved,
            () if is_held => GateVerdict::Held,
            () if is_apart && gain < 0.0 => GateVerdict::Regressed,
            () => GateVerdict::CannotSay,
        };
        let settled_by = (verdict == GateVerdict::CannotSay && !is_mixed && comparison.selected.is_none())
            .then(|| (*spread)?.settling(margin, alpha / self.tests.max(1) as f64))
            .flatten();
        let is_rate = self.metric().kind == Kind::Rate;
        let numbers = |p: Option<f64>| if is_rate { format!(", p {}", p_value(p)) } else { String::new() };
        let name = study.unit_name(new);
        let why = match (verdict, &comparison.selected, settled_by) {
            (GateVerdict::Improved, ..) => format!("better by {}{}", fixed(Some(gain), 3), numbers(p_adjusted)),
            (GateVerdict::Held, ..) => format!("not worse by {margin}{}", numbers(p_held)),
            (GateVerdict::Regressed, ..) => format!("worse by {}{}", fixed(Some(-gain), 3), numbers(p_adjusted)),
            (_, Some(selected), _) => format!("{selected}, which the outcome selects"),
            _ if is_mixed => {
                let counted = too_few.map_or_else(|| "units of two kinds".to_owned(), |units| units.counted());
                format!("{counted}: no test compares them")
            }
            (.., Some(n)) => format!("about {n} {name} on each side would settle it"),
            _ if comparison.interval.is_none() && !is_rate => {
                "the values have no interval: too few, too alike, or several per scene".to_owned()
            }
            _ => format!("too few {name} for any verdict"),
        };
        GateCell {
            verdict,
            why,
            difference: comparison.difference,
            interval: comparison.interval,
            p_adjusted: p_adjusted.filter(|_| is_rate),
            p_held: p_held.filter(|_| is_rate),
            units: comparison.units.clone(),
            settled_by,
            flips: sides::flips(study, self.column, tried.blocks),
            ..cell
        }
    }
}

impl GateCell {
    /// A cell whose episodes were all lost on each side that has it.
    fn lost(key: &CellKey) -> Self {
        let condition = Some(key.condition.clone()).filter(|text| text != sides::DEFAULT);
        Self { experiment: key.experiment.clone(), model: key.model.clone(), condition, ..Self::default() }
    }

    fn key(&self) -> (&str, &str, &str) {
        (&self.experiment, &self.model, self.condition.as_deref().unwrap_or(sides::DEFAULT))
    }

    fn bounded_by(&mut self, bound: Option<GateVerdict>, fill: LossFill) {
        let has_verdict = !matches!(self.verdict, GateVerdict::CannotSay | GateVerdict::NotComparable);
        let lost = self.base.lost + self.new.lost;
        if !has_verdict || lost == 0 || bound == Some(self.verdict) {
            return;
        }
        let (verdict, side) = (text::name(self.verdict), if fill == LossFill::Against { "against" } else { "for" });
        let other = bound.map_or("nothing", text::name);
        self.why = format!("{verdict} without the {lost} lost episodes, {other} if they count {side} NEW");
        self.verdict = GateVerdict::CannotSay;
    }
}

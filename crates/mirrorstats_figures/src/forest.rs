//! `forest`: differences between models in each experiment, and between experiments of each model, with their intervals
//! and verdicts.
//!
//! Rule: every number is one of the statistics. The side of zero is the sign of the estimate that the verdict is of.

use crate::kit::lettering::NAME_ROOM;
use crate::kit::panels::Panels;
use crate::kit::{
    Fill, Frame, Grid, MARGIN, Mark, PALETTE, Plot, ROOM_BELOW, Sheet, Stroke, Swatch, TextAnchor, Tick, label, legend,
    lettering, many, rate_ticks, whole_ticks,
};
use crate::{Drawn, FigureError, Scene};
use mirrorstats_analysis::statistics::{Comparison, Contrast, OverallRow, PairTest, Statistics};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_statistics::intervals::interval::Interval;

const ROW: f64 = 13.0;
const MOST_COLUMNS: usize = 6;
const LEAST_PANEL: f64 = 58.0;
const GAP: f64 = 12.0;
/// The most pairs of models with a row each; of more models, each is compared with the one that ranks first.
const MOST_PAIRS: usize = 45;
const OVERALL: &str = "over all";

pub fn draw(scene: Scene<'_>, statistics: &Statistics) -> Result<Drawn, FigureError> {
    let metric = scene.metrics[0].name;
    let (models, leader) = between_models(scene, statistics);
    let conditions = between_experiments(scene, statistics);
    let parts: Vec<Part> = [models, conditions].into_iter().filter(|part| !part.panels.is_empty()).collect();
    if parts.is_empty() {
        let found = format!("{} and {}", scene.roster.names().join(", "), scene.matrix.experiments.join(", "));
        return Err(FigureError::NoComparison { metric: metric.to_owned(), found });
    }
    let rooms = parts.iter().map(|part| lettering::label().widest(part.labels(scene)));
    let left = MARGIN + rooms.fold(0.0, f64::max) + 10.0;
    let grid = Grid { width: scene.width, left, gap: GAP, columns: MOST_COLUMNS }.at_least(LEAST_PANEL);
    let reach = parts.iter().flat_map(Part::found).filter_map(Found::reach).fold(0.0, f64::max);
    let axis = Axis::of(scene.metrics[0].metric.kind, reach);
    let mut sheet = Sheet::new(scene.width);
    let mut top = MARGIN;
    for part in &parts {
        top = part.draw(&mut sheet, scene, grid, top, &axis) + 12.0;
    }
    let bottom = legend::draw_signs(&mut sheet, (MARGIN, top), signs(&parts, leader));
    Ok((sheet, bottom + MARGIN))
}

/// Panels with the same rows.
struct Part<'a> {
    /// The two things that a row subtracts, or the one that it is about.
    rows: Vec<Vec<&'a str>>,
    panels: Vec<(String, Vec<Option<Found>>)>,
    /// The words below each axis.
    about: String,
}

/// One difference with its verdict.
struct Found {
    title: String,
    names: [String; 3],
    difference: Option<f64>,
    interval: Option<Interval>,
    simultaneous: Option<Interval>,
    p_adjusted: Option<f64>,
    verdict: &'static str,
}

const SHOWN: &str = "shown";
const NOT_SHOWN: &str = "not shown";
const CANNOT_SAY: &str = "cannot say";

fn between_models<'a>(scene: Scene<'a>, statistics: &'a Statistics) -> (Part<'a>, Option<&'a str>) {
    let (metric, names) = (scene.metrics[0].name, scene.roster.names());
    let families: Vec<_> = statistics.models.iter().filter(|family| family.metric == metric).collect();
    let place = |name: &str| -> usize {
        families.iter().map(|it| it.models.iter().position(|model| model == name).unwrap_or(it.models.len())).sum()
    };
    let all = (0..names.len()).flat_map(|at| names[at + 1..].iter().map(move |other| (at, *other)));
    let mut pairs: Vec<Vec<&str>> = all.map(|(at, other)| vec![names[at], other]).collect();
    let leader = names.iter().copied().min_by_key(|name| place(name)).filter(|_| pairs.len() > MOST_PAIRS);
    if let Some(leader) = leader {
        pairs = names.iter().filter(|name| **name != leader).map(|name| vec![leader, *name]).collect();
    }
    let is_pair = |pair: &[&str], first: &str, second: &str| pair == [first, second] || pair == [second, first];
    let mut panels = Vec::new();
    for experiment in &scene.matrix.experiments {
        let Some(family) = families.iter().find(|family| family.experiment == *experiment) else { continue };
        let of = |pair: &Vec<&str>| {
            let is_it = |test: &&PairTest| is_pair(pair, &test.first, &test.second);
            let test = family.tests.iter().find(is_it)?;
            let is_hopeless = family.cannot_say(statistics.confidence);
            let found = Found::of(experiment, pair, &test.comparison, statistics.confidence).unless(is_hopeless);
            Some(if test.first == pair[0] { found } else { found.turned() })
        };
        panels.push(((*experiment).to_owned(), pairs.iter().map(of).collect()));
    }
    let is_hopeless = families.iter().all(|family| family.cannot_say(statistics.confidence));
    let overall: Vec<&OverallRow> = statistics.overall.iter().filter(|row| row.metric == metric).collect();
    if !overall.is_empty() && !panels.is_empty() {
        let of = |pair: &Vec<&str>| {
            let row = overall.iter().find(|row| is_pair(pair, &row.first, &row.second))?;
            let found = Found::overall(pair, row).unless(is_hopeless);
            Some(if row.first == pair[0] { found } else { found.turned() })
        };
        panels.push((OVERALL.to_owned(), pairs.iter().map(of).collect()));
    }
    panels.retain(|(_, rows): &(_, Vec<Option<Found>>)| rows.iter().any(Option::is_some));
    (Part { rows: pairs, panels, about: metric.to_owned() }, leader)
}

fn between_experiments<'a>(scene: Scene<'a>, statistics: &'a Statistics) -> Part<'a> {
    let (metric, names) = (scene.metrics[0].name, scene.roster.names());
    let mut panels: Vec<(String, Vec<Option<Found>>)> = Vec::new();
    let contrasts: Vec<&Contrast> = statistics.conditions.iter().filter(|it| it.metric == metric).collect();
    for of_pair in contrasts.chunk_by(|a, b| (&a.baseline, &a.against) == (&b.baseline, &b.against)) {
        let heading = format!("{} − {}", of_pair[0].baseline, of_pair[0].against);
        let of = |name: &&str| {
            let is_it = |it: &&&Contrast| labelled(it) == *name;
            let it = of_pair.iter().find(is_it)?;
            Some(Found::of(&heading, &[name], &it.comparison, statistics.confidence))
        };
        let rows: Vec<Option<Found>> = names.iter().map(of).collect();
        panels.push((heading, rows));
    }
    panels.retain(|(_, rows)| rows.iter().any(Option::is_some));
    Part { rows: names.into_iter().map(|name| vec![name]).collect(), panels, about: metric.to_owned() }
}

fn labelled(contrast: &Contrast) -> String {
    let condition = contrast.condition.as_ref();
    condition.map_or_else(|| contrast.model.clone(), |condition| format!("{} [{condition}]", contrast.model))
}

impl Found {
    fn of(panel: &str, row: &[&str], comparison: &Comparison, confidence: f64) -> Self {
        let verdict = match comparison {
            it if it.separated => SHOWN,
            it if it.cannot_say(confidence) => CANNOT_SAY,
            _ => NOT_SHOWN,
        };
        let Comparison { difference, interval, simultaneous, p_adjusted, .. } = *comparison;
        Self { difference, interval, simultaneous, p_adjusted, ..Self::named(panel, row, verdict) }
    }

    fn overall(row: &[&str], found: &OverallRow) -> Self {
        let verdict = match found {
            it if it.is_crossed || it.p.is_none() => CANNOT_SAY,
            it if it.separated => SHOWN,
            _ => NOT_SHOWN,
        };
        let OverallRow { difference, interval, p_adjusted, .. } = *found;
        Self { difference, interval, p_adjusted, ..Self::named(OVERALL, row, verdict) }
    }

    fn named(panel: &str, row: &[&str], verdict: &'static str) -> Self {
        let second = row.get(1).copied().unwrap_or_default();
        Self {
            title: format!("{panel} · {}", row.join(" − ")),
            names: [panel, row[0], second].map(str::to_owned),
            difference: None,
            interval: None,
            simultaneous: None,
            p_adjusted: None,
            verdict,
        }
    }

    /// Without a verdict where the tests of the family could not have shown any difference.
    fn unless(self, is_hopeless: bool) -> Self {
        match self.verdict {
            NOT_SHOWN if is_hopeless => Self { verdict: CANNOT_SAY, ..self },
            _ => self,
        }
    }

    /// The second minus the first.
    fn turned(self) -> Self {
        let turned = |it: Interval| Interval { low: -it.high, high: -it.low };
        Self {
            difference: self.difference.map(|it| 0.0 - it),
            interval: self.interval.map(turned),
            simultaneous: self.simultaneous.map(turned),
            ..self
        }
    }

    fn reach(&self) -> Option<f64> {
        let bounds = [self.interval, self.simultaneous].into_iter().flatten();
        let ends = bounds.flat_map(|it| [it.low, it.high]).chain(self.difference);
        ends.map(f64::abs).reduce(f64::max)
    }

    fn mark(&self, metric: &str) -> Mark {
        let [panel, first, second] = &self.names;
        Mark::of_cell(format!("{}: {}", self.title, self.verdict), panel, first, metric)
            .with("against", second)
            .value(self.difference)
            .interval(self.interval)
            .number("simultaneous-low", self.simultaneous.map(|it| it.low))
            .number("simultaneous-high", self.simultaneous.map(|it| it.high))
            .number("p-adjusted", self.p_adjusted)
            .with("verdict", self.verdict)
    }

    fn draw(&self, sheet: &mut Sheet, plot: &Plot, middle: f64) {
        let ink = if self.verdict == SHOWN { PALETTE.surface.text } else { PALETTE.surface.axis };
        let widths = [(self.simultaneous, 0.9), (self.interval, 2.2)];
        for (bounds, width) in widths.into_iter().filter_map(|(bounds, width)| Some((bounds?, width))) {
            let ends = [bounds.low, bounds.high].map(|end| (plot.x(end), middle));
            sheet.line(&ends, Stroke::solid(ink, width));
        }
        if let Some(difference) = self.difference {
            sign(sheet, (plot.x(difference), middle), self.verdict);
        } else {
            let right = (plot.frame.right() - 2.0, middle);
            sheet.text(right, "--", lettering::tick().aligned(TextAnchor::End));
        }
    }
}

/// The sign of a verdict: a full dot, a ring, or a cross.
fn sign(sheet: &mut Sheet, center: (f64, f64), verdict: &str) {
    let surface = &PALETTE.surface;
    match verdict {
        SHOWN => sheet.circle(center, 2.6, Fill::plain(surface.text)),
        NOT_SHOWN => sheet.circle(center, 2.6, Fill::outlined(surface.paper, surface.quiet, 1.1)),
        _ => legend::cross(sheet, center),
    }
}

/// The range of differences, the same in all panels.
struct Axis {
    most: f64,
    ticks: Vec<Tick>,
}

impl Axis {
    fn of(kind: Kind, reach: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` clamps")]
        let (most, above): (f64, Vec<Tick>) = match kind {
            Kind::Rate => (1.0, rate_ticks().into_iter().step_by(2).collect()),
            Kind::Quantity => (reach.max(1.0), whole_ticks(reach.ceil() as u32, 2)),
        };
        let below = above.iter().filter(|tick| tick.at > 0.0);
        let below = below.map(|tick| Tick { at: -tick.at, text: format!("−{}", tick.text) });
        let mut ticks: Vec<Tick> = below.chain(above.iter().cloned()).collect();
        for tick in ticks.iter_mut().filter(|tick| tick.at.fract() != 0.0) {
            tick.text.clear();
        }
        Self { most: most * 1.06, ticks }
    }
}

impl Part<'_> {
    fn found(&self) -> impl Iterator<Item = &Found> {
        self.panels.iter().flat_map(|(_, rows)| rows.iter().flatten())
    }

    /// The names of the rows, in the room that the panels leave.
    fn labels(&self, scene: Scene<'_>) -> Vec<String> {
        let (room, names, lettering) = (NAME_ROOM.min(scene.width / 3.0), scene.roster.names(), lettering::label());
        let pair = self.rows.first().is_some_and(|row| row.len() == 2);
        let minus = " − ";
        let room = if pair { (room - lettering.width(minus)) / 2.0 } else { room };
        let fitted = label::fitted(&names, room, lettering);
        let of = |name: &&str| names.iter().position(|known| known == name).map_or("", |at| fitted[at].as_str());
        self.rows.iter().map(|row| row.iter().map(of).collect::<Vec<_>>().join(minus)).collect()
    }

    fn draw(&self, sheet: &mut Sheet, scene: Scene<'_>, grid: Grid, top: f64, axis: &Axis) -> f64 {
        let grid = grid.balanced(self.panels.len());
        let height = ROW * many(self.rows.len());
        let names: Vec<&str> = self.panels.iter().map(|(name, _)| name.as_str()).collect();
        let panels = grid.panels_below(sheet, top, &names, &[], height + ROOM_BELOW);
        let middle = |body: &Frame, row: usize| body.top + ROW * (many(row) + 0.5);
        for first in panels.bodies.iter().step_by(grid.columns) {
            for (row, label) in self.labels(scene).iter().enumerate() {
                sheet.text((MARGIN, middle(first, row)), label, lettering::label());
            }
        }
        for ((_, rows), body) in self.panels.iter().zip(&panels.bodies) {
            let plot = Plot::new(Frame { height, ..*body }, -axis.most..axis.most, 0.0..1.0);
            plot.x_axis(sheet, &axis.ticks, &self.about);
            let zero = plot.x(0.0);
            sheet.line(&[(zero, body.top), (zero, body.top + height)], Stroke::solid(PALETTE.surface.axis, 0.9));
            for (row, found) in rows.iter().enumerate() {
                let Some(found) = found else { continue };
                let mark = found.mark(scene.metrics[0].name);
                sheet.mark(&mark, |sheet| found.draw(sheet, &plot, middle(body, row)));
            }
        }
        let Panels { bottom, .. } = panels;
        bottom
    }
}

fn signs(parts: &[Part<'_>], leader: Option<&str>) -> Vec<(Swatch, String)> {
    let surface = &PALETTE.surface;
    let has = |verdict: &str| parts.iter().flat_map(Part::found).any(|found| found.verdict == verdict);
    let mut signs = Vec::new();
    for (verdict, swatch, words) in [
        (SHOWN, Swatch::Dot(Fill::plain(surface.text)), "difference shown (Holm)"),
        (NOT_SHOWN, Swatch::Ring(2.6), "no difference shown"),
        (CANNOT_SAY, Swatch::Cross, "cannot say"),
    ] {
        if has(verdict) {
            signs.push((swatch, words.to_owned()));
        }
    }
    let found = || parts.iter().flat_map(Part::found);
    if found().any(|it| it.interval.is_some()) {
        signs.push((Swatch::Rule(Stroke::solid(surface.axis, 2.2)), "95 % interval".to_owned()));
    }
    if found().any(|it| it.simultaneous.is_some()) {
        signs.push((Swatch::Rule(Stroke::solid(surface.axis, 0.9)), "the same, for all rows together".to_owned()));
    }
    if found().any(|it| it.difference.is_none()) {
        signs.push((Swatch::None, "--: not compared".to_owned()));
    }
    let leader = leader.map(|name| (Swatch::None, format!("each model against {name}, which has the best means")));
    signs.into_iter().chain(leader).collect()
}

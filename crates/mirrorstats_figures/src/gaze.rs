//! `gaze`: a raster of episodes by steps: the mirror in view, its first sight, claim and decision.

use crate::kit::{
    Fill, Frame, Grid, MARGIN, Mark, PALETTE, Plot, ROOM_BELOW, Sheet, Stroke, Swatch, leading, legend, lettering,
    many, tiles, whole_ticks,
};
use crate::{Drawn, Scene};
use mirrorstats_exact::format::counted;
use mirrorstats_score::timeline::Timeline;

/// The most episodes of the raster: with more, rows become too thin to read.
pub const MOST_EPISODES: usize = 2_000;
/// The target height of all rows of a column together, px.
const AIM: f64 = 420.0;
const THINNEST_ROW: f64 = 1.6;
const THICKEST_ROW: f64 = 7.0;
const BLOCK_GAP: f64 = 6.0;
const GAP: f64 = 18.0;
const MOST_COLUMNS: usize = 5;
const NAMES: f64 = 150.0;
const LEAST_PANEL: f64 = 70.0;

pub(crate) fn draw(scene: Scene<'_>, timelines: &[Timeline]) -> Drawn {
    let raster = Raster::new(scene, timelines);
    let matrix = scene.matrix;
    let (labels, label_width) = scene.row_labels(NAMES);
    let grid = Grid { width: scene.width, left: MARGIN + label_width + 10.0, gap: GAP, columns: MOST_COLUMNS };
    let grid = grid.at_least(LEAST_PANEL).balanced(matrix.experiments.len());
    let (mut sheet, panels) = grid.panels(&matrix.experiments, &[], raster.height() + ROOM_BELOW);
    for first in panels.bodies.iter().step_by(grid.columns) {
        for (block, text) in labels.iter().enumerate() {
            let (top, height) = raster.block(block);
            sheet.text((MARGIN, first.top + top + height / 2.0), text, lettering::label());
        }
    }
    for (experiment, body) in matrix.experiments.iter().zip(&panels.bodies) {
        raster.panel(&mut sheet, experiment, *body);
    }
    let height = legend::draw_signs(&mut sheet, (MARGIN, panels.bottom + 8.0), raster.signs()) + MARGIN;
    (sheet, height)
}

/// The rows of all panels: one block per model, with as many rows as its fullest experiment has episodes.
struct Raster<'a> {
    scene: Scene<'a>,
    timelines: &'a [Timeline],
    rows: Vec<usize>,
    row: f64,
    last: u32,
}

impl<'a> Raster<'a> {
    fn new(scene: Scene<'a>, timelines: &'a [Timeline]) -> Self {
        let mut raster = Self { scene, timelines, rows: Vec::new(), row: 0.0, last: 1 };
        let experiments = &scene.matrix.experiments;
        let fullest = |model: &str| experiments.iter().map(|e| raster.episodes(e, model).len()).max().unwrap_or(0);
        let rows: Vec<usize> = scene.roster.0.iter().map(|member| fullest(member.model)).collect();
        raster.row = (AIM / many(rows.iter().sum::<usize>().max(1))).clamp(THINNEST_ROW, THICKEST_ROW);
        raster.rows = rows;
        raster.last = timelines.iter().map(|timeline| timeline.length).max().unwrap_or(1).max(1);
        raster
    }

    fn episodes(&self, experiment: &str, model: &str) -> Vec<&'a Timeline> {
        let is_here = |t: &&Timeline| t.key.experiment == experiment && t.key.model == model;
        let mut episodes: Vec<_> = self.timelines.iter().filter(is_here).collect();
        episodes.sort_by(|a, b| (a.length, &a.key).cmp(&(b.length, &b.key)));
        episodes
    }

    /// The top of a block and its height, px; at least as high as the model's name.
    fn block(&self, block: usize) -> (f64, f64) {
        let height = |rows: usize| (self.row * many(rows)).max(leading(lettering::label()));
        let above: f64 = self.rows[..block].iter().map(|&rows| height(rows) + BLOCK_GAP).sum();
        (above, height(self.rows[block]))
    }

    fn height(&self) -> f64 {
        let (top, height) = self.block(self.rows.len().saturating_sub(1));
        top + height
    }

    fn signs(&self) -> Vec<(Swatch, String)> {
        let gaze = &PALETTE.gaze;
        let signs = [
            (Swatch::Tile(Fill::plain(gaze.episode)), "episode"),
            (Swatch::Tile(Fill::plain(gaze.visible)), "mirror in view"),
            (Swatch::Dot(Fill::plain(gaze.first_sight)), "first sight of the mirror"),
            (Swatch::Dot(Fill::plain(gaze.claim)), "first claim of a colour"),
            (Swatch::Tick(Stroke::solid(gaze.decision, 2.0)), "decision"),
        ];
        let has_empty = self.scene.matrix.pairs().any(|(e, m)| self.episodes(e, m).is_empty());
        let empty = has_empty.then_some((Swatch::Empty, "no episodes"));
        signs.into_iter().chain(empty).map(|(swatch, text)| (swatch, text.to_owned())).collect()
    }

    fn panel(&self, sheet: &mut Sheet, experiment: &str, body: Frame) {
        let frame = Frame { height: self.height(), ..body };
        let plot = Plot::new(frame, 0.0..f64::from(self.last), 0.0..1.0);
        plot.x_axis(sheet, &whole_ticks(self.last, 4), "step t");
        for (at, member) in self.scene.roster.0.iter().enumerate() {
            let (top, height) = self.block(at);
            let episodes = self.episodes(experiment, member.model);
            if episodes.is_empty() {
                let title = Mark::new(format!("{experiment} · {}: no episodes", member.model));
                let place = Frame::new(frame.left, frame.top + top, frame.width, height);
                sheet.mark(&title, |sheet| tiles::empty(sheet, place));
            }
            for (row, timeline) in episodes.into_iter().enumerate() {
                self.episode(sheet, &plot, timeline, frame.top + top + self.row * many(row));
            }
        }
    }

    fn episode(&self, sheet: &mut Sheet, plot: &Plot, timeline: &Timeline, top: f64) {
        let gaze = &PALETTE.gaze;
        let height = if self.row > 3.0 { self.row - 0.8 } else { self.row * 0.85 };
        let ends = |from: u32, to: u32| (plot.x(f64::from(from.saturating_sub(1))), plot.x(f64::from(to)));
        sheet.mark(&mark(timeline), |sheet| {
            sheet.bars(&[ends(1, timeline.length)], top, height, gaze.episode);
            let runs = timeline.visible.iter().map(|run| ends(*run.start(), (*run.end()).min(timeline.length)));
            sheet.bars(&runs.collect::<Vec<_>>(), top, height, gaze.visible);
            let middle = top + height / 2.0;
            let radius = (height * 0.62).clamp(1.1, 2.4);
            for (step, color) in [(timeline.first_sight, gaze.first_sight), (timeline.claim, gaze.claim)] {
                if let Some(step) = step {
                    let x = plot.x(f64::from(step) - 0.5);
                    sheet.circle((x, middle), radius, Fill::plain(color));
                }
            }
            if let Some(step) = timeline.decision {
                let x = plot.x(f64::from(step));
                sheet.rectangle(Frame::new(x - 1.6, top, 1.6, height), Fill::plain(gaze.decision));
            }
        });
    }
}

fn mark(timeline: &Timeline) -> Mark {
    let Timeline { key, length, first_sight, claim, decision, .. } = timeline;
    let step = |step: &Option<u32>| step.map(|step| step.to_string()).unwrap_or_default();
    let words = |step: &Option<u32>| step.map_or("none".to_owned(), |step| format!("t = {step}"));
    let [sight_words, claim_words, decision_words] = [first_sight, claim, decision].map(words);
    let words = format!("first sight {sight_words}, claim {claim_words}, decision {decision_words}");
    let in_view: usize = timeline.visible.iter().map(|run| run.clone().count()).sum();
    Mark::new(format!("{}: {}; {words}", key.episode_id, counted(*length, "step")))
        .with("experiment", &key.experiment)
        .with("model", &key.model)
        .with("episode", &key.episode_id)
        .with("length", length)
        .with("in-view", in_view)
        .with("first-sight", step(first_sight))
        .with("claim", step(claim))
        .with("decision", step(decision))
}

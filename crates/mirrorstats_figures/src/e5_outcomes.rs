//! `e5-outcomes`: the endings of the episodes of an open question, as one stacked bar per model.

use std::collections::BTreeMap;

use crate::kit::lettering::NAME_ROOM;
use crate::kit::{
    Fill, Frame, Lettering, MARGIN, Mark, PALETTE, Plot, Sheet, Swatch, TextAnchor, label, legend, lettering, many,
    plot, text_on, tiles,
};
use crate::{Drawn, Scene};
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};

const ROW: f64 = 22.0;
const BAR: f64 = 15.0;
const LEAST_WIDTH: f64 = 420.0;
const PLOT_WIDTH: f64 = 260.0;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcomes {
    pub experiment: String,
    /// One row per model; models without a row are shown as having no episodes.
    pub rows: Vec<OutcomeRow>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OutcomeRow {
    pub model: String,
    /// Episodes whose final self-attribution is the body's colour.
    pub correct: u64,
    /// Episodes whose final self-attribution is another colour.
    pub wrong: u64,
    /// Episodes whose final self-attribution is `unknown`, or that never gave one.
    pub uncommitted: u64,
}

impl Outcomes {
    /// The outcomes of the first experiment with episodes that has reference levels for a rate instead of a chance
    /// level, so that its question is open. `None` without one.
    ///
    /// An episode is correct if the rate is 1. Otherwise it is wrong if its decision committed to a colour: if
    /// `answered`, which has one value per episode of the table, is true.
    pub fn from_table(episodes: &EpisodeTable, answered: &[bool]) -> Option<Self> {
        let (experiment, success) = open_question(episodes)?;
        let mut rows: BTreeMap<&str, OutcomeRow> = BTreeMap::new();
        let all = episodes.keys.iter().zip(success.iter()).zip(answered);
        for ((key, value), answered) in all.filter(|((key, _), _)| key.experiment == experiment) {
            let empty = || OutcomeRow { model: key.model.to_owned(), ..OutcomeRow::default() };
            let row = rows.entry(key.model).or_insert_with(empty);
            match (value, answered) {
                (Some(1), _) => row.correct += 1,
                (_, true) => row.wrong += 1,
                (_, false) => row.uncommitted += 1,
            }
        }
        (!rows.is_empty()).then(|| Self { experiment: experiment.to_owned(), rows: rows.into_values().collect() })
    }

    /// Returns true if there is any episode that [`from_table`](Self::from_table) would count.
    pub fn are_there(episodes: &EpisodeTable) -> bool {
        open_question(episodes).is_some()
    }
}

/// The first experiment with episodes and reference levels instead of a chance level, and the rate that they apply to.
fn open_question(episodes: &EpisodeTable) -> Option<(&str, &MetricColumn)> {
    let has_episodes = |name: &str| episodes.keys.iter().any(|key| key.experiment == name);
    episodes.catalog.experiment.iter().find_map(|(name, experiment)| {
        let rate = episodes.metrics.iter().find(|metric| experiment.reference.contains_key(&metric.name))?;
        has_episodes(name).then_some((name.as_str(), rate))
    })
}

impl OutcomeRow {
    pub fn episodes(&self) -> u64 {
        self.correct + self.wrong + self.uncommitted
    }

    fn parts(&self) -> [(&'static str, u64, Fill); 3] {
        let outcome = &PALETTE.outcome;
        let fill = |color| Fill::outlined(color, PALETTE.surface.paper, 0.8);
        [
            ("correct", self.correct, fill(outcome.correct)),
            ("wrong", self.wrong, fill(outcome.wrong)),
            ("uncommitted", self.uncommitted, fill(outcome.uncommitted)),
        ]
    }
}

pub(crate) fn draw(scene: Scene<'_>, outcomes: &Outcomes) -> Drawn {
    let names = scene.roster.names();
    let (labels, label_width) = scene.row_labels(NAME_ROOM);
    let left = MARGIN + label_width + 8.0;
    let width = (left + PLOT_WIDTH + 40.0 + MARGIN).max(LEAST_WIDTH).min(scene.width);
    let mut sheet = Sheet::new(width);
    let frame = Frame::new(left, MARGIN, width - left - MARGIN - 40.0, ROW * many(names.len()));
    let plot = Plot::new(frame, 0.0..1.0, 0.0..1.0);
    let title = format!("episodes of {}", label::cut(&outcomes.experiment, 120.0, lettering::label()));
    plot.x_axis(&mut sheet, &plot::quarters("0", "50 %", "100 %"), &title);
    for (row, (model, label)) in names.iter().zip(&labels).enumerate() {
        let middle = MARGIN + ROW * (many(row) + 0.5);
        sheet.text((MARGIN, middle), label, lettering::label());
        if let Some(found) = episodes_of(outcomes, model) {
            bar(&mut sheet, &plot, &outcomes.experiment, found, middle);
        } else {
            empty_bar(&mut sheet, &plot, &outcomes.experiment, model, middle);
        }
    }
    let has_all = names.iter().all(|model| episodes_of(outcomes, model).is_some());
    let empty = (!has_all).then(|| (Swatch::Empty, "no episodes".to_owned()));
    let height = legend::draw_signs(&mut sheet, (MARGIN, frame.bottom() + 34.0), part_signs().chain(empty).collect());
    (sheet, height + MARGIN)
}

#[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
fn bar(sheet: &mut Sheet, plot: &Plot, experiment: &str, row: &OutcomeRow, middle: f64) {
    let episodes = row.episodes();
    let place = |count: u64| plot.x(count as f64 / episodes as f64);
    let mut before = 0;
    for (name, count, fill) in row.parts() {
        let (from, to) = (place(before), place(before + count));
        before += count;
        let title = format!("{experiment} · {} · {name}: {count} of {episodes}", row.model);
        let mark = Mark::of_cell(title, experiment, &row.model, name).with("value", count).with("n", episodes);
        sheet.mark(&mark, |sheet| {
            if count == 0 {
                return;
            }
            sheet.rectangle(Frame::new(from, middle - BAR / 2.0, to - from, BAR), fill);
            let text = count.to_string();
            let lettering = Lettering { color: text_on(fill.color), ..lettering::value().aligned(TextAnchor::Middle) };
            if lettering.width(&text) + 3.0 <= to - from {
                sheet.text((f64::midpoint(from, to), middle), &text, lettering);
            }
        });
    }
    let right = sheet.width - MARGIN;
    sheet.text((right, middle), &format!("n = {episodes}"), lettering::tick().aligned(TextAnchor::End));
}

fn empty_bar(sheet: &mut Sheet, plot: &Plot, experiment: &str, model: &str, middle: f64) {
    let mark = Mark::new(format!("{experiment} · {model}: no episodes"));
    let mark = mark.with("experiment", experiment).with("model", model).with("n", 0);
    let place = Frame::new(plot.frame.left, middle - BAR / 2.0, plot.frame.width, BAR);
    sheet.mark(&mark, |sheet| tiles::empty(sheet, place));
}

fn episodes_of<'a>(outcomes: &'a Outcomes, model: &str) -> Option<&'a OutcomeRow> {
    outcomes.rows.iter().find(|row| row.model == model).filter(|row| row.episodes() > 0)
}

fn part_signs() -> impl Iterator<Item = (Swatch, String)> {
    let words = ["correct", "wrong, committed", "unknown or not committed"];
    let parts = OutcomeRow::default().parts().into_iter().zip(words);
    parts.map(|((_, _, fill), text)| (Swatch::Tile(fill), text.to_owned()))
}

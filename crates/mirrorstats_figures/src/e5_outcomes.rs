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

/// The endings of episodes, each by its name and by its words in the legend: the final self-attribution is the body's
/// colour, or another colour, or it is `unknown` or was never given.
const ENDINGS: [[&str; 2]; 3] =
    [["correct", "correct"], ["wrong", "wrong, committed"], ["uncommitted", "unknown or not committed"]];

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcomes {
    pub experiment: String,
    /// The episodes of each model by their endings: correct, wrong, uncommitted. Models without a row are shown as
    /// having no episodes.
    pub rows: BTreeMap<String, [u64; 3]>,
}

impl Outcomes {
    /// The outcomes of the first experiment with episodes that has reference levels for a rate instead of a chance
    /// level, so that its question is open. `None` without one.
    ///
    /// An episode is correct if the rate is 1. Otherwise it is wrong if its decision committed to a colour: if
    /// `answered`, which has one value per episode of the table, is true.
    pub fn from_table(episodes: &EpisodeTable, answered: &[bool]) -> Option<Self> {
        let (experiment, success) = open_question(episodes)?;
        let mut rows: BTreeMap<String, [u64; 3]> = BTreeMap::new();
        let all = episodes.keys.iter().zip(success.iter()).zip(answered);
        for ((key, value), answered) in all.filter(|((key, _), _)| key.experiment == experiment) {
            let ending = match (value, answered) {
                (Some(1), _) => 0,
                (_, true) => 1,
                (_, false) => 2,
            };
            rows.entry(key.model.to_owned()).or_default()[ending] += 1;
        }
        (!rows.is_empty()).then(|| Self { experiment: experiment.to_owned(), rows })
    }

    /// Returns true if there is any episode that [`from_table`](Self::from_table) would count.
    pub fn are_there(episodes: &EpisodeTable) -> bool {
        open_question(episodes).is_some()
    }

    /// The endings of a model that has episodes.
    fn of(&self, model: &str) -> Option<[u64; 3]> {
        self.rows.get(model).copied().filter(|counts| counts.iter().sum::<u64>() > 0)
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

fn fills() -> [Fill; 3] {
    let outcome = &PALETTE.outcome;
    let fill = |color| Fill::outlined(color, PALETTE.surface.paper, 0.8);
    [outcome.correct, outcome.wrong, outcome.uncommitted].map(fill)
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
        if let Some(counts) = outcomes.of(model) {
            bar(&mut sheet, &plot, [&outcomes.experiment, model], counts, middle);
        } else {
            empty_bar(&mut sheet, &plot, &outcomes.experiment, model, middle);
        }
    }
    let parts = ENDINGS.into_iter().zip(fills()).map(|([_, words], fill)| (Swatch::Tile(fill), words.to_owned()));
    let has_all = names.iter().all(|model| outcomes.of(model).is_some());
    let empty = (!has_all).then(|| (Swatch::Empty, "no episodes".to_owned()));
    let height = legend::draw_signs(&mut sheet, (MARGIN, frame.bottom() + 34.0), parts.chain(empty).collect());
    (sheet, height + MARGIN)
}

#[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
fn bar(sheet: &mut Sheet, plot: &Plot, [experiment, model]: [&str; 2], counts: [u64; 3], middle: f64) {
    let episodes: u64 = counts.iter().sum();
    let place = |count: u64| plot.x(count as f64 / episodes as f64);
    let mut before = 0;
    for (([name, _], fill), count) in ENDINGS.into_iter().zip(fills()).zip(counts) {
        let (from, to) = (place(before), place(before + count));
        before += count;
        let title = format!("{experiment} · {model} · {name}: {count} of {episodes}");
        let mark = Mark::of_cell(title, experiment, model, name).with("value", count).with("n", episodes);
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

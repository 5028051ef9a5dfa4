//! The requested and the actual results of a scan.

use std::borrow::Cow;
use std::collections::BTreeSet;

use report::bundle;
use report::cells::group::CONDITION;
use report::figures::e5_outcomes::Outcomes;
use report::figures::{FigureName, gaze};
use score::quality::QualityByCell;
use score::table::{EpisodeKey, EpisodeTable};
use score::timeline::Timeline;
use trace::open::TraceSet;
use trace::replies::REPLY_STATUS;

/// The requested results besides the episode table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each output is asked for by itself")]
pub struct Outputs {
    /// Times of looks, claims and decisions, for the figure `gaze`.
    pub timelines: bool,
    /// Endings of open questions, for the figure `e5-outcomes`.
    pub outcomes: bool,
    /// The episodes that the infrastructure ended.
    pub losses: bool,
    pub quality: bool,
    /// The hashes of the inputs.
    pub hashes: bool,
}

impl Outputs {
    /// The inputs of these figures.
    pub fn of_figures(names: &[FigureName]) -> Self {
        let (timelines, outcomes) = (names.contains(&FigureName::Gaze), names.contains(&FigureName::E5Outcomes));
        Self { timelines, outcomes, ..Self::default() }
    }

    pub(crate) fn needs_steps(self, traces: &TraceSet) -> bool {
        let has_losses = self.losses && traces.column(REPLY_STATUS).is_some();
        self.timelines || self.outcomes || self.quality || has_losses
    }
}

/// The results of a scan.
#[derive(Clone, Debug)]
pub struct Results {
    /// One row per episode.
    pub episodes: EpisodeTable,
    /// One timeline per episode, in table order. `None` if not requested, for scores, for definitions that do not name
    /// the moments, and for more episodes than `gaze` draws.
    pub timelines: Option<Vec<Timeline>>,
    /// The endings of open questions. `None` if not requested, and if there is no such question.
    pub outcomes: Option<Outcomes>,
    /// The ids of the episodes without `done` whose last reply was lost to the infrastructure. `None` if not requested,
    /// and if the inputs do not record it.
    pub lost: Option<BTreeSet<String>>,
    /// The reply quality by cell, lost episodes included. `None` if not requested, and for scores.
    pub quality: Option<QualityByCell>,
    /// The inputs with their hashes; empty if not requested.
    pub inputs: Vec<bundle::Input>,
}

impl Results {
    pub(crate) fn of(episodes: EpisodeTable) -> Self {
        let (timelines, outcomes, lost, quality, inputs) = (None, None, None, None, Vec::new());
        Self { episodes, timelines, outcomes, lost, quality, inputs }
    }

    /// The same results, with a non-default condition in the model's name: `model [condition]`.
    pub(crate) fn with_conditions_as_models(&self) -> Cow<'_, Self> {
        if !self.episodes.has_conditions() {
            return Cow::Borrowed(self);
        }
        let (episodes, order) = self.episodes.with_labelled_models(CONDITION);
        let timelines = self.timelines.as_ref();
        let timelines = timelines.map(|timelines| {
            let of = |(row, was): (usize, &usize)| {
                let model = episodes.keys.get(row).model.to_owned();
                let line = timelines[*was].clone();
                Timeline { key: EpisodeKey { model, ..line.key.clone() }, ..line }
            };
            order.iter().enumerate().map(|(row, was)| of((row, was))).collect()
        });
        Cow::Owned(Self { episodes, timelines, ..self.clone() })
    }

    pub(crate) fn select(&mut self, outputs: Outputs) {
        if outputs.outcomes && Outcomes::are_there(&self.episodes) {
            let shown = self.with_conditions_as_models();
            let answered =
                shown.timelines.as_ref().map(|timelines| timelines.iter().map(|line| line.answered).collect());
            let outcomes = answered.and_then(|answered: Vec<bool>| Outcomes::of(&shown.episodes, &answered));
            self.outcomes = outcomes;
        }
        if !outputs.timelines || self.episodes.len() > gaze::MOST_EPISODES {
            self.timelines = None;
        }
    }
}

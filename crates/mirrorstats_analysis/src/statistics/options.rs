//! The options of all statistics.

use super::comparisons::conditions::Contrast;
use super::episodes::{Replies, Selection};
use crate::study::{Study, couples};
use mirrorstats_score::cells::interval::CONFIDENCE;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_statistics::design::Design;

/// The design, the level and what was left out, for [`super::Statistics`] and [`super::Sequential`].
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The confidence of every interval, and one minus the level of every test; between 0 and 1.
    pub confidence: f64,
    /// The number of lost episodes besides those given; `None` if the traces do not record it.
    pub lost: Option<LostCounts>,
    /// The declared design; empty by default.
    pub design: Design,
    /// The selection of episodes; all by default.
    pub selection: Option<Selection>,
    /// The settings that cells pool, one sentence each; `None` without pooling.
    pub pooled: Option<Vec<String>>,
    /// The number of replies without a decision; `None` if not recorded.
    pub replies: Option<Replies>,
    /// Further caveats of every answer, such as lost episodes that count as failures.
    pub caveats: Vec<String>,
    /// Episodes that are copies of others, or may be: a phrase each.
    pub copies: Vec<String>,
    /// The metric of the primary question in a registered plan; the first headline metric by default.
    pub primary: Option<String>,
    /// The largest difference that counts as none: of rates below 1, of durations from 1 on.
    pub margin: Option<f64>,
    /// True to compute probabilities of improvement. Each one resamples all episodes of two models.
    pub improvements: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            confidence: CONFIDENCE,
            lost: None,
            design: Design::default(),
            selection: None,
            pooled: None,
            replies: None,
            caveats: Vec::new(),
            copies: Vec::new(),
            primary: None,
            margin: None,
            improvements: false,
        }
    }
}

impl Options {
    /// The settings that cells pool or that compared blocks differ in, one sentence each; empty without pooling.
    pub(super) fn pooled_in(&self, study: &Study) -> Vec<String> {
        let Some(mut sentences) = self.pooled.clone() else { return Vec::new() };
        let models = study.experiments.iter().flat_map(|experiment| couples(&experiment.blocks));
        let contrasts = Contrast::pairs(study).into_iter().flat_map(|pair| pair.couples().collect::<Vec<_>>());
        for (first, second) in models.chain(contrasts) {
            let Some(setting) = study.setting_apart(first, second) else { continue };
            let sentence = format!("Compared though they differ (--pool): {setting}.");
            if !sentences.contains(&sentence) {
                sentences.push(sentence);
            }
        }
        sentences
    }
}

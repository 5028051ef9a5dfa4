//! The names of figures and their titles.

use std::fmt;
use std::str::FromStr;

use super::error::FigureError;
use exact::suggest::hint;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FigureName {
    /// Behavioural profiles: one radar per experiment, one line per model.
    Spider,
    /// Models by experiments and metrics, coloured by goodness.
    Heatmap,
    /// Task success against self-attribution.
    Scatter,
    /// Completion-conditioned success minus success.
    CompletionGap,
    /// Final self-identification of the open-ended experiment.
    E5Outcomes,
    /// Task success with its interval and the level of chance.
    Intervals,
    /// Task success from the first experiment to every other.
    Slopes,
    /// Task success against the dose of a factor.
    DoseResponse,
    /// The share of episodes decided by step t.
    DecisionCurve,
    /// The mirror's time in view, per episode.
    Gaze,
}

// In the order of a report; each file has this name and the extension of its format.
exact::names!(FigureName {
    Spider: "spider",
    Heatmap: "heatmap",
    Scatter: "scatter",
    CompletionGap: "completion-gap",
    E5Outcomes: "e5-outcomes",
    Intervals: "intervals",
    Slopes: "slopes",
    DoseResponse: "dose-response",
    DecisionCurve: "decision-curve",
    Gaze: "gaze",
});

impl FigureName {
    /// The title, for headings and screen readers.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Spider => "Behavioural profiles",
            Self::Heatmap => "Performance across experiments and metrics",
            Self::Scatter => "Task success against self-attribution",
            Self::CompletionGap => "Completion gap",
            Self::E5Outcomes => "Final self-identification outcomes",
            Self::Intervals => "Task success with 95 % intervals",
            Self::Slopes => "Task success from experiment to experiment",
            Self::DoseResponse => "Task success against the dose",
            Self::DecisionCurve => "Share of episodes decided by step t",
            Self::Gaze => "Mirror in view, episode by episode",
        }
    }
}

impl fmt::Display for FigureName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FigureName {
    type Err = FigureError;

    fn from_str(text: &str) -> Result<Self, FigureError> {
        Self::named(text).ok_or_else(|| {
            let known = Self::ALL.map(Self::name);
            FigureError::UnknownFigure { name: text.to_owned(), known: known.join(", "), hint: hint(text, known) }
        })
    }
}

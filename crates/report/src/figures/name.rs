//! The names of figures, their titles and captions.

use std::fmt;
use std::str::FromStr;

use super::error::FigureError;
use exact::suggest::hint;

/// The figures there are.
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
    /// Task success from the first experiment to each other.
    Slopes,
    /// The share of episodes decided by step t.
    DecisionCurve,
    /// When the mirror was in view, episode by episode.
    Gaze,
}

impl FigureName {
    /// All figures, in the order of a report.
    pub const ALL: [Self; 9] = [
        Self::Spider,
        Self::Heatmap,
        Self::Scatter,
        Self::CompletionGap,
        Self::E5Outcomes,
        Self::Intervals,
        Self::Slopes,
        Self::DecisionCurve,
        Self::Gaze,
    ];

    /// The name of its file, without the ending.
    pub const fn name(self) -> &'static str {
        self.texts()[0]
    }

    /// What it is called, for headings and for those who do not see it.
    pub const fn title(self) -> &'static str {
        self.texts()[1]
    }

    /// One or two sentences on how to read it.
    pub const fn caption(self) -> &'static str {
        self.texts()[2]
    }

    const fn texts(self) -> [&'static str; 3] {
        match self {
            Self::Spider => [
                "spider",
                "Behavioural profiles",
                "One line a model, further out is better on every axis: rates where less is better are shown as one \
                 minus the rate, durations reversed and scaled between the least and the greatest mean of their \
                 experiment, a half where all are equal. The red mark on the TSA axis is the level of chance.",
            ],
            Self::Heatmap => [
                "heatmap",
                "Performance across experiments and metrics",
                "Numbers are means. Colours are set so that darker is better: rates where less is better from one \
                 minus the rate, durations reversed and scaled within their experiment.",
            ],
            Self::Scatter => [
                "scatter",
                "Task success against self-attribution",
                "One point a model and experiment; on the dashed diagonal TSA equals CAAL. Larger markers are \
                 slower decisions (TTD against the slowest model of the experiment). Models with the same values \
                 are fanned out around the place they share.",
            ],
            Self::CompletionGap => [
                "completion-gap",
                "Completion gap",
                "TSA among episodes that end with a decision, minus TSA among all: what is lost by not deciding.",
            ],
            Self::E5Outcomes => [
                "e5-outcomes",
                "Final self-identification outcomes",
                "Episodes whose final self-attribution was correct, was another colour, or was unknown or never \
                 given.",
            ],
            Self::Intervals => [
                "intervals",
                "Task success with 95 % intervals",
                "TSA with its Wilson 95 % interval and counts. The red line is the level of chance, dotted lines \
                 are reference levels where no level of chance applies.",
            ],
            Self::Slopes => [
                "slopes",
                "Task success from experiment to experiment",
                "TSA of each model in the first experiment and in each other one. Models with the same value stand \
                 side by side.",
            ],
            Self::DecisionCurve => [
                "decision-curve",
                "Share of episodes decided by step t",
                "Kaplan-Meier estimate of the share of episodes decided by step t; episodes that end undecided are \
                 censored there (upright ticks).",
            ],
            Self::Gaze => [
                "gaze",
                "Mirror in view, episode by episode",
                "One row an episode, sorted by length within its model; the mirror in view, first sight of it, the \
                 first claim of a colour and the decision.",
            ],
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
        Self::ALL.into_iter().find(|figure| figure.name() == text).ok_or_else(|| {
            let known = Self::ALL.map(Self::name);
            FigureError::UnknownFigure { name: text.to_owned(), known: known.join(", "), hint: hint(text, known) }
        })
    }
}

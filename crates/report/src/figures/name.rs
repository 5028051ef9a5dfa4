//! The names of figures and their titles.

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
    /// Task success against the dose of a factor.
    DoseResponse,
    /// The share of episodes decided by step t.
    DecisionCurve,
    /// The mirror's time in view, per episode.
    Gaze,
}

impl FigureName {
    /// All figures, in the order of a report.
    pub const ALL: [Self; 10] = [
        Self::Spider,
        Self::Heatmap,
        Self::Scatter,
        Self::CompletionGap,
        Self::E5Outcomes,
        Self::Intervals,
        Self::Slopes,
        Self::DoseResponse,
        Self::DecisionCurve,
        Self::Gaze,
    ];

    /// The name of its file, without the ending.
    pub const fn name(self) -> &'static str {
        self.texts()[0]
    }

    /// The title, for headings and screen readers.
    pub const fn title(self) -> &'static str {
        self.texts()[1]
    }

    const fn texts(self) -> [&'static str; 2] {
        match self {
            Self::Spider => ["spider", "Behavioural profiles"],
            Self::Heatmap => ["heatmap", "Performance across experiments and metrics"],
            Self::Scatter => ["scatter", "Task success against self-attribution"],
            Self::CompletionGap => ["completion-gap", "Completion gap"],
            Self::E5Outcomes => ["e5-outcomes", "Final self-identification outcomes"],
            Self::Intervals => ["intervals", "Task success with 95 % intervals"],
            Self::Slopes => ["slopes", "Task success from experiment to experiment"],
            Self::DoseResponse => ["dose-response", "Task success against the dose"],
            Self::DecisionCurve => ["decision-curve", "Share of episodes decided by step t"],
            Self::Gaze => ["gaze", "Mirror in view, episode by episode"],
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

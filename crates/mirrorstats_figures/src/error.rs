//! Errors of drawing a figure.

use super::{FigureName, FigureWidth};

#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    #[error("expected the name of a figure ({known}), found `{name}`{hint}")]
    UnknownFigure { name: String, known: String, hint: String },
    #[error("figures need cells by experiment and model, found cells by `{found}`; leave out `--by`")]
    Grouping { found: String },
    #[error("there is no episode to draw; check the traces and `--where`")]
    NoEpisodes,
    #[error(
        "figure `{figure}` shows {}, found {known}; name them under `[figure.{figure}]` in the style, or declare them in the \
         definitions",
        .figure.needs(metric)
    )]
    UnknownMetric { figure: FigureName, metric: String, known: String },
    #[error(
        "figure `{figure}` draws `{metric}` as a rate, found a quantity; name a rate in the style's `[figure.{figure}]`"
    )]
    NotARate { figure: FigureName, metric: String },
    #[error("figure `{figure}` needs {needed}; draw it from traces that have such episodes, not from scores alone")]
    MissingInput { figure: FigureName, needed: &'static str },
    #[error(
        "figure `{figure}` shows each episode and at most {most} of them, found {found}; choose some with --where, such \
         as --where \"run = 1\""
    )]
    TooManyEpisodes { figure: FigureName, most: usize, found: usize },
    #[error(
        "figure `{figure}` needs {least} for these metrics and experiments at 6 pt; draw it wider, or choose fewer metrics"
    )]
    TooNarrow { figure: FigureName, least: FigureWidth },
    #[error("the figure `{figure}` shows {wanted} metrics, found {found}")]
    MetricCount { figure: FigureName, wanted: String, found: usize },
    #[error("figure `slopes` needs two experiments or more, found {found}; add traces of another one")]
    OneExperiment { found: String },
    #[error("figure `forest` needs two models or two experiments with `{metric}`, found {found}")]
    NoComparison { metric: String, found: String },
    #[error(
        "figure `dose-response` needs two doses of a factor or more, found {found}; the definitions `battery` have the factors \
         delay and memory, others have `[factor.NAME]`"
    )]
    NoFactor { found: String },
}

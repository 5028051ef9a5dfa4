//! The figures by name: their titles, and the metrics and captions that a style declares and the cells have.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Deserialize;

use super::FigureError;
use super::matrix::{Matrix, MetricId};
use mirrorstats_exact::suggest::hint;
use mirrorstats_metric::catalogs::catalog::{Catalog, Kind, Measures};
use mirrorstats_metric::catalogs::relations::Relations;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FigureName {
    Spider,
    Heatmap,
    Scatter,
    CompletionGap,
    E5Outcomes,
    Intervals,
    Forest,
    Slopes,
    DoseResponse,
    DecisionCurve,
    Gaze,
}

// In the order of a report; each file has this name and the extension of its format.
mirrorstats_exact::names!(FigureName {
    Spider: "spider",
    Heatmap: "heatmap",
    Scatter: "scatter",
    CompletionGap: "completion-gap",
    E5Outcomes: "e5-outcomes",
    Intervals: "intervals",
    Forest: "forest",
    Slopes: "slopes",
    DoseResponse: "dose-response",
    DecisionCurve: "decision-curve",
    Gaze: "gaze",
});

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

/// A style's declaration of one figure.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FigureSheet {
    /// The metrics that it shows, in the order of its roles.
    pub metrics: Option<Vec<String>>,
    /// The words below it; `{0}` is the first metric, `{1}` the second.
    pub caption: Option<String>,
}

pub type FigureSheets = IndexMap<String, FigureSheet>;

pub static SHOWN: LazyLock<FigureSheets> =
    LazyLock::new(|| toml::from_str(FIGURES).expect("the file comes with the program"));
/// The same as TOML, as a base for styles.
pub const FIGURES: &str = include_str!("../../../assets/styles/figures.toml");
/// With more axes the labels overlap.
const MOST_AXES: usize = 8;

/// The fixed properties of a figure.
struct Spec {
    title: &'static str,
    /// The fewest and the most metrics that it shows.
    metrics: [usize; 2],
    /// The number of the metrics, from the first on, that must be rates.
    rates: usize,
    /// The words for its metrics.
    needs: &'static str,
}

impl FigureName {
    const fn spec(self) -> Spec {
        const ANY: usize = 64;
        let (title, metrics, rates, needs) = match self {
            Self::Spider => ("Behavioural profiles", [3, ANY], 0, "three metrics or more"),
            Self::Heatmap => ("Performance across experiments and metrics", [1, ANY], 0, "metrics"),
            Self::Scatter => ("Task success against self-attribution", [3, 3], 2, "two rates and a duration"),
            Self::CompletionGap => ("Completion gap", [2, 2], 2, "a rate that `completes` another one"),
            Self::E5Outcomes => ("Final self-identification outcomes", [0, 0], 0, "metrics"),
            Self::Intervals => ("Task success with 95 % intervals", [1, 1], 1, "a rate"),
            Self::Forest => ("Differences with 95 % intervals", [1, 1], 0, "a rate or a duration"),
            Self::Slopes => ("Task success from experiment to experiment", [1, 1], 1, "a rate"),
            Self::DoseResponse => ("Task success against the dose", [1, 1], 1, "a rate"),
            Self::DecisionCurve => {
                ("Share of episodes decided by step t", [2, 2], 0, "a duration and the rate that is `finished`")
            }
            Self::Gaze => ("Mirror in view, episode by episode", [0, 0], 0, "metrics"),
        };
        Spec { title, metrics, rates, needs }
    }

    /// The title, for headings and screen readers.
    pub const fn title(self) -> &'static str {
        self.spec().title
    }

    pub fn check_count(self, found: usize) -> Result<(), FigureError> {
        let [fewest, most] = self.spec().metrics;
        if (fewest..=most).contains(&found) {
            return Ok(());
        }
        let wanted = if fewest == most { fewest.to_string() } else { format!("{fewest} to {most}") };
        Err(FigureError::MetricCount { figure: self, wanted, found })
    }

    pub(super) fn needs(self, metric: &str) -> String {
        match SHOWN.get(self.name()).and_then(|sheet| sheet.metrics.as_ref()) {
            Some(listed) if listed.iter().any(|name| name == metric) => self.spec().needs.to_owned(),
            _ => format!("the metric {metric}"),
        }
    }
}

pub(super) fn metrics<'a>(
    figure: FigureName,
    matrix: &Matrix<'a>,
    sheets: &'a FigureSheets,
) -> Result<Vec<MetricId<'a>>, FigureError> {
    let listed = sheets.get(figure.name()).and_then(|sheet| sheet.metrics.as_deref()).unwrap_or_default();
    let found: Result<Vec<_>, _> = listed.iter().map(|name| matrix.metric(figure, name)).collect();
    let found = found.or_else(|error| instead(figure, matrix, listed).ok_or(error))?;
    let quantity = found.iter().take(figure.spec().rates).find(|id| id.metric.kind == Kind::Quantity);
    match quantity {
        Some(id) => Err(FigureError::NotARate { figure, metric: id.name.to_owned() }),
        None => Ok(found),
    }
}

fn instead<'a>(figure: FigureName, matrix: &Matrix<'a>, listed: &[String]) -> Option<Vec<MetricId<'a>>> {
    let all = matrix.metrics();
    let named = |name: &str| all.iter().find(|id| id.name == name).copied();
    let related = |pair: fn(Relations) -> Option<[String; 2]>| {
        pair(Relations::of(matrix.catalog()))?.iter().map(|name| named(name)).collect()
    };
    let measured = |what| all.iter().find(|id| id.metric.measures() == Some(what)).map(|id| vec![*id]);
    match figure {
        FigureName::Heatmap => {
            let known: Vec<_> = listed.iter().filter_map(|name| named(name)).collect();
            Some(if known.is_empty() { all } else { known })
        }
        FigureName::Spider => {
            (all.len() >= figure.spec().metrics[0]).then(|| all.into_iter().take(MOST_AXES).collect())
        }
        FigureName::Scatter => {
            let measuring = |what| all.iter().filter(move |id| id.metric.measures() == Some(what)).copied();
            let found: Vec<_> =
                measuring(Measures::Rate).take(2).chain(measuring(Measures::Duration).take(1)).collect();
            (found.len() == 3).then_some(found)
        }
        FigureName::Forest => measured(Measures::Rate).or_else(|| measured(Measures::Duration)),
        FigureName::Intervals | FigureName::Slopes | FigureName::DoseResponse => {
            all.iter().find(|id| id.metric.kind == Kind::Rate).map(|id| vec![*id])
        }
        FigureName::CompletionGap => {
            related(|found| found.completed.first().map(|(whole, same)| [same, whole].map(String::clone)))
        }
        FigureName::DecisionCurve => {
            related(|found| found.durations.first().map(|(one, other)| [one, other].map(String::clone)))
        }
        FigureName::E5Outcomes | FigureName::Gaze => None,
    }
}

/// The title over these metrics. Definitions of other domains have no task and no self to name: their metrics do.
pub(super) fn title(figure: FigureName, metrics: &[MetricId<'_>], catalog: &Catalog) -> String {
    let name = |at: usize| metrics.get(at).map_or("", |id| id.name);
    match figure {
        _ if catalog.domain.is_none() => figure.title().to_owned(),
        FigureName::Scatter => format!("{} against {}", name(1), name(0)),
        FigureName::Intervals => format!("{} with 95 % intervals", name(0)),
        FigureName::Forest => format!("Differences of {} with 95 % intervals", name(0)),
        FigureName::Slopes => format!("{} from experiment to experiment", name(0)),
        FigureName::DoseResponse => format!("{} against the dose", name(0)),
        _ => figure.title().to_owned(),
    }
}

pub(super) fn caption(figure: FigureName, metrics: &[MetricId<'_>], sheets: &FigureSheets) -> String {
    let template = sheets.get(figure.name()).and_then(|sheet| sheet.caption.clone()).unwrap_or_default();
    metrics.iter().enumerate().fold(template, |text, (at, id)| text.replace(&format!("{{{at}}}"), id.name))
}

//! The inputs of figures, and the figures of a report.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use crate::gate::{check_metric, leading_metric};
use crate::results::{Outputs, Results};
use crate::statistics::statistics;
use crate::{Study, StudyError};
use mirrorstats_analysis::statistics::{Options, Statistics};
use mirrorstats_figures::{Figure, FigureError, FigureName, FigureWidth, Input};
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_report::bundle::OutputFile;
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::Cells;
use mirrorstats_score::cells::group::{DEFAULT_BY, GroupError, group};
use mirrorstats_trace::read::in_order::in_order;

/// The options of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureOptions {
    /// `default`, `paper`, or the path of a style file, for the order of models, metrics and captions.
    pub style: PathBuf,
    /// The metrics shown, in the order of their roles; the style's metrics if None.
    pub metrics: Option<Vec<String>>,
    /// The printed width; the drawn width if None.
    pub width: Option<FigureWidth>,
    /// The number of models to show, the best by their means of the first metric over all experiments; all if None.
    pub top: Option<usize>,
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self { style: PathBuf::from("default"), metrics: None, width: None, top: None }
    }
}

/// One figure, with the models in the order of a style. Errors: as [`Study::score`]; inputs that lack data for the
/// figure; a wrong number of metrics; a width that its text does not fit in at 6 pt.
pub fn figure(study: &Study, name: FigureName, options: &FigureOptions) -> Result<Figure, StudyError> {
    let mut style = Style::load(&options.style)?;
    if let Some(metrics) = &options.metrics {
        name.check_count(metrics.len())?;
        style.sheet.figure.entry(name.name().to_owned()).or_default().metrics = Some(metrics.clone());
    }
    let grouped = study.grouped_with(Outputs::of_figures(&[name]))?;
    let statistics = (name == FigureName::Forest).then(|| statistics(&grouped, &Options::default())).transpose()?;
    let mut results = grouped.counted.results;
    for metric in options.metrics.iter().flatten() {
        check_metric(&results.episodes, metric)?;
    }
    if let Some(top) = options.top {
        let metric = options.metrics.iter().flatten().next().cloned();
        results = results.top_models(top, &metric.map_or_else(|| leading_metric(study), Ok)?);
    }
    let results = results.with_conditions_as_models();
    Ok(FigureInputs { width: options.width, ..FigureInputs::of(results, &style)? }.draw(name, statistics.as_ref())?)
}

#[derive(Debug)]
pub(crate) struct FigureInputs<'a> {
    cells: Cells,
    style: &'a Style,
    width: Option<FigureWidth>,
    results: Cow<'a, Results>,
    remark: Option<String>,
}

pub const MANY_MODELS: usize = 20;

/// The number of models in a report's figures if there are more than [`MANY_MODELS`].
const SHOWN_OF_MANY: usize = 12;

#[derive(Debug, Default)]
pub(crate) struct Drawings {
    pub drawn: Vec<(FigureName, Figure)>,
    pub left_out: Vec<(FigureName, FigureError)>,
}

impl<'a> FigureInputs<'a> {
    /// Groups the episodes for figures: by experiment and model.
    fn of(results: Cow<'a, Results>, style: &'a Style) -> Result<Self, GroupError> {
        let cells = group(&results.episodes, &DEFAULT_BY.map(str::to_owned))?;
        Ok(Self { cells, style, width: None, results, remark: None })
    }

    /// The same for a page or a folder of all figures: of many models only the best, as the captions say.
    pub(crate) fn of_a_report(results: &'a Results, style: &'a Style) -> Result<Self, GroupError> {
        let all = results.with_conditions_as_models();
        let metric = results.episodes.catalog.metric.iter().find(|(_, metric)| metric.better != Better::Neither);
        let models = all.episodes.keys.iter().map(|key| key.model).collect::<BTreeSet<_>>().len();
        let Some((metric, _)) = metric.filter(|_| models > MANY_MODELS) else { return Self::of(all, style) };
        let best = all.into_owned().top_models(SHOWN_OF_MANY, metric);
        let remark = Some(format!("The best {SHOWN_OF_MANY} of {models} models by {metric}."));
        Ok(Self { remark, ..Self::of(Cow::Owned(best), style)? })
    }

    fn draw(&self, name: FigureName, statistics: Option<&Statistics>) -> Result<Figure, FigureError> {
        mirrorstats_figures::draw(name, &Input { statistics, ..self.input() })
    }

    /// The figures that need no statistics; with statistics, those that do.
    pub(crate) fn draw_all(&self, statistics: Option<&Statistics>) -> Drawings {
        let mut drawings = Drawings::default();
        let is_due = |name: &FigureName| (*name == FigureName::Forest) == statistics.is_some();
        for name in FigureName::ALL.into_iter().filter(is_due) {
            match self.draw(name, statistics) {
                Ok(figure) => drawings.drawn.push((name, figure.remarked(self.remark.as_deref()))),
                // Most definitions declare no factor, or the traces lack it; some studies compare nothing.
                Err(FigureError::NoFactor { .. } | FigureError::NoComparison { .. }) => {}
                Err(error) => drawings.left_out.push((name, error)),
            }
        }
        drawings
    }

    fn input(&self) -> Input<'_> {
        Input {
            cells: &self.cells,
            order: &self.style.sheet.row_order,
            sheets: &self.style.sheet.figure,
            episodes: Some(&self.results.episodes),
            outcomes: self.results.outcomes.as_ref(),
            timelines: self.results.timelines.as_deref(),
            statistics: None,
            width: self.width,
        }
    }
}

impl Drawings {
    /// Both, in the order of a report.
    pub(crate) fn and(mut self, others: Self) -> Self {
        self.drawn.extend(others.drawn);
        self.drawn.sort_by_key(|(name, _)| *name);
        self.left_out.extend(others.left_out);
        self.left_out.sort_by_key(|(name, _)| *name);
        self
    }

    /// The files of the figures. PNG takes most of the time of a report that has it.
    pub(crate) fn files(&self, threads: NonZeroUsize, png: bool) -> Result<Vec<OutputFile>, StudyError> {
        let mut files = Vec::new();
        in_order(
            threads,
            &self.drawn,
            |(name, figure)| (*name, figure.encode_all(png)),
            |(name, encoded)| {
                files.extend(encoded?.into_iter().map(|(format, bytes)| {
                    let path = format!("figures/{name}.{}", format.ending()).into();
                    OutputFile { path, bytes }
                }));
                Ok::<_, StudyError>(())
            },
        )?;
        Ok(files)
    }
}

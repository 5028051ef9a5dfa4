//! The bundled traces, scored once, and their pages.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::LazyLock;

use mirrorstats_analysis::statistics::{Options, Statistics};
use mirrorstats_figures::{Figure, FigureName};
use mirrorstats_report::bundle::{InputFile, Manifest};
use mirrorstats_report::html::{self, HtmlError, Page, Recordings};
use mirrorstats_report::layout;
use mirrorstats_report::layout::MetricTable;
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::Cells;
use mirrorstats_score::cells::group::group;
use mirrorstats_score::score_traces::{self, Request};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::{inputs, read::open::TraceSet};

use crate::harness::files::fixture;

/// The episodes of the bundled traces under the paper's definitions.
pub static PAPER: LazyLock<EpisodeTable> = LazyLock::new(|| {
    let folder = fixture("paper").display().to_string();
    let traces = TraceSet::open(&inputs::resolve(&[folder.into()], std::io::empty()).unwrap()).unwrap();
    let definitions = score_traces::definitions(&traces, &Request::of("paper")).unwrap();
    score_traces::score(&traces, &definitions, &["body_color".to_owned()], NonZeroUsize::MIN).unwrap()
});

/// The page of the full report on the bundled traces.
pub static PAPER_PAGE: LazyLock<String> = LazyLock::new(|| Report::paper().render().unwrap());

/// The contents of a page.
pub struct Report {
    pub episodes: EpisodeTable,
    pub cells: Cells,
    pub tables: Vec<MetricTable>,
    pub manifest: Manifest,
    pub statistics: Option<Statistics>,
    pub recordings: Recordings,
    pub figures: Vec<(FigureName, Figure)>,
}

impl Report {
    /// The report on some episodes, without figures and statistics.
    pub fn of(episodes: EpisodeTable, by: &[&str], style: &str) -> Self {
        let by: Vec<String> = by.iter().map(|&key| key.to_owned()).collect();
        let cells = group(&episodes, &by).unwrap();
        let style = Style::load(style).unwrap();
        let tables = layout::tables(&cells, &style).unwrap();
        let input = |name: &str| InputFile::new(Path::new(name), "0".repeat(64), 1234);
        let inputs = vec![input("traces/a.parquet"), input("traces/b.parquet")];
        let manifest = Manifest::new(&cells, &style, 1, None, inputs);
        let paths = manifest.inputs.iter().map(|input| input.path.clone()).collect();
        let recordings = Recordings { paths, definitions: None };
        Self { episodes, cells, tables, manifest, statistics: None, recordings, figures: Vec::new() }
    }

    /// Only the tables of the bundled traces.
    pub fn bare() -> Self {
        Self::of(PAPER.clone(), &["experiment", "model"], "default")
    }

    /// The report on the bundled traces, with the figures that need only cells and episodes.
    pub fn paper() -> Self {
        let mut report = Self::bare();
        report.statistics = Some(Statistics::from_table(&report.episodes, &report.cells, &Options::default()).unwrap());
        let input = mirrorstats_figures::Input {
            episodes: Some(&report.episodes),
            statistics: report.statistics.as_ref(),
            ..mirrorstats_figures::Input::of_cells(&report.cells)
        };
        let drawn = FigureName::ALL
            .into_iter()
            .filter(|name| !matches!(name, FigureName::Gaze | FigureName::E5Outcomes | FigureName::DoseResponse));
        report.figures = drawn.map(|name| (name, mirrorstats_figures::draw(name, &input).unwrap())).collect();
        report
    }

    pub fn render(&self) -> Result<String, HtmlError> {
        html::render(&Page {
            tables: &self.tables,
            cells: &self.cells,
            episodes: &self.episodes,
            manifest: &self.manifest,
            figures: &self.figures,
            statistics: self.statistics.as_ref(),
            lists: &[],
            recordings: Some(&self.recordings),
        })
    }
}

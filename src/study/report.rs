//! The report of a study: tables, figures, a page, and the folder that holds them.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use super::error::StudyError;
use super::figure_inputs::{Drawings, FigureInputs};
use super::scan::{Outputs, Results};
use super::{Study, scores};
use crate::figures::FigureName;
use crate::report::bundle::{self, Bundle, Manifest, OutputFile};
use crate::report::html::{self, Figure, Page};
use crate::report::layout;
use crate::report::statistics::{Options, Statistics};
use crate::report::style::{MAIN_TABLE, Style};
use crate::report::table::Table;
use crate::report::tables::markdown;
use crate::score::format::Format;
use crate::stats::cell::Cells;
use crate::trace::schema::SCHEMA_VERSION;

/// The most episodes that a page lists.
pub const MOST_LISTED: usize = 20_000;

/// How a report looks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReportOptions {
    /// `default`, `paper`, or the path of a style file.
    pub style: String,
    /// Whether figures and `report.html` are in it.
    pub figures: bool,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self { style: "default".to_owned(), figures: true }
    }
}

/// A report, in memory.
#[derive(Debug)]
pub struct Report {
    /// What the scan gave: one row per episode, and more.
    pub results: Results,
    /// The cells, grouped as the study says.
    pub cells: Cells,
    /// The tables, as the style lays them out.
    pub tables: Vec<Table>,
    /// Where everything comes from.
    pub manifest: Manifest,
    /// What the folder lacks and why, one sentence each.
    pub notes: Vec<String>,
    pub(super) style: Style,
    threads: NonZeroUsize,
    /// Figures and the page.
    illustrations: Vec<OutputFile>,
    /// The files that it is made from, none of which it may replace.
    read: Vec<PathBuf>,
}

/// A report that was written.
#[derive(Clone, Debug)]
pub struct WrittenReport {
    /// The paths of its files inside the folder, in order.
    pub files: Vec<String>,
    /// Its manifest, with the outputs.
    pub manifest: Manifest,
}

impl Study {
    /// Refuses a folder whose report has a file that this study reads, before anything is read.
    ///
    /// # Errors
    /// When it has one.
    pub fn check_folder(&self, out: &Path, options: &ReportOptions) -> Result<(), StudyError> {
        Ok(bundle::check_old(out, &self.files_read(Some(&options.style)))?)
    }

    /// Makes the report of the study.
    ///
    /// # Errors
    /// Whatever is wrong with the style, the inputs or the definitions.
    pub fn report(&self, options: &ReportOptions) -> Result<Report, StudyError> {
        // Small files first: a slip in the style should not cost a pass over the traces.
        let style = Style::load(&options.style)?;
        let figures: &[FigureName] = if options.figures { &FigureName::ALL } else { &[] };
        let results = self.scan(Outputs { losses: options.figures, hashes: true, ..Outputs::of_figures(figures) })?;
        self.check_filter(results.episodes.len())?;
        let cells = self.cells_of(&results.episodes)?;
        let tables = layout::tables(&cells, &style)?;
        let filter = self.question.filter.clone();
        let manifest = Manifest::new(&cells, &style, SCHEMA_VERSION, filter, results.inputs.clone());
        let (notes, illustrations, read) = (Vec::new(), Vec::new(), self.files_read(Some(&options.style)));
        let threads = self.threads;
        let mut report = Report { results, cells, tables, manifest, notes, style, threads, illustrations, read };
        if options.figures {
            report.illustrate()?;
        }
        Ok(report)
    }
}

impl Report {
    /// The table that is shown first.
    pub fn main_table(&self) -> Option<&Table> {
        self.tables.iter().find(|table| table.name == MAIN_TABLE).or(self.tables.first())
    }

    /// A table as Markdown; `None` where the style has no table of this name.
    pub fn markdown(&self, name: &str) -> Option<String> {
        self.tables.iter().find(|table| table.name == name).map(markdown::render)
    }

    /// Writes the folder of the report, in place of the report that is there.
    ///
    /// # Errors
    /// Where `out` is no folder or cannot be written; the folder is then as it was, or has no manifest. A file of the old
    /// report that this one is made from.
    pub fn write(&self, out: &Path) -> Result<WrittenReport, StudyError> {
        let mut episodes = Vec::new();
        scores::write(&self.results.episodes, Format::Parquet, &mut episodes, self.threads)?;
        let Self { cells, tables, manifest, illustrations: others, read, .. } = self;
        let written = bundle::write(out, &Bundle { cells, tables, episodes: &episodes, manifest, read, others })?;
        let inside = |path: &PathBuf| path.strip_prefix(out).unwrap_or(path).display().to_string();
        Ok(WrittenReport { files: written.files.iter().map(inside).collect(), manifest: written.manifest })
    }

    /// Adds the figures and the page.
    fn illustrate(&mut self) -> Result<(), StudyError> {
        let drawings = FigureInputs::of(&self.results, &self.style)?.draw_all();
        self.notes.extend(drawings.left_out.iter().map(|(name, reason)| format!("no figure `{name}`: {reason}")));
        self.illustrations = drawings.files()?;
        if self.results.episodes.len() > MOST_LISTED {
            self.notes.push(format!("no report.html: it lists at most {MOST_LISTED} episodes"));
        } else {
            let bytes = self.page(&drawings)?.into_bytes();
            self.illustrations.push(OutputFile { path: "report.html".into(), bytes });
        }
        Ok(())
    }

    fn page(&self, drawings: &Drawings) -> Result<String, StudyError> {
        let options = Options { lost: self.results.lost.clone(), ..Options::default() };
        let statistics = Statistics::of(&self.results.episodes, &self.cells, &options)?;
        let svgs: Vec<String> = drawings.drawn.iter().map(|(_, figure)| figure.inline_svg()).collect();
        let figures: Vec<Figure> =
            drawings.drawn.iter().zip(&svgs).map(|((name, _), svg)| figure_of(*name, svg)).collect();
        Ok(html::render(&Page {
            tables: &self.tables,
            cells: &self.cells,
            episodes: &self.results.episodes,
            manifest: &self.manifest,
            figures: &figures,
            statistics: Some(&statistics),
        })?)
    }
}

fn figure_of(name: FigureName, svg: &str) -> Figure<'_> {
    Figure { name: name.name(), title: name.title(), caption: name.caption(), svg }
}

//! `report.html`: tables, figures and provenance of a report as one self-contained page.
//!
//! `page.rs` makes the text of the templates, `embedded.rs` the JSON for the script, `template.rs` one page of both.
//!
//! Rule: numbers arrive in final form; a cell's attributes carry the text of `cells.csv`. Names from traces are text:
//! templates escape them, and characters that act on a reader are spelled out first. The page's policy
//! forbids all requests and all scripts but its own. It is complete without its script, which adds sorting, filters,
//! search, values on hover, the episodes behind a cell, and two models side by side. Selections are in the address.

mod command;
mod definitions;
mod embedded;
mod filter;
mod page;
mod pair;
mod template;

use crate::bundle::Manifest;
use crate::layout::MetricTable;
use mirrorstats_analysis::statistics::Statistics;
use mirrorstats_figures::{Figure, FigureName, font_style_sheet};
use mirrorstats_score::cells::Cells;
use mirrorstats_score::cells::group::GroupError;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_tables::ListTable;

pub use command::{Recordings, word};
pub use definitions::metrics;

#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    pub tables: &'a [MetricTable],
    pub cells: &'a Cells,
    pub episodes: &'a EpisodeTable,
    pub manifest: &'a Manifest,
    /// The figures, in order; an empty slice omits the section.
    pub figures: &'a [(FigureName, Figure)],
    /// The statistics; `None` omits the section.
    pub statistics: Option<&'a Statistics>,
    pub lists: &'a [ListTable],
    /// The recordings behind the episodes; absent for files of scores.
    pub recordings: Option<&'a Recordings>,
}

#[derive(Debug, thiserror::Error)]
pub enum HtmlError {
    #[error(transparent)]
    Grouping(#[from] GroupError),
    #[error("expected the cells of the episodes given, found other ones; group the same episode table")]
    OtherEpisodes,
    #[error("table `{table}`: the row `{row}` belongs to no cell; lay the tables out from the same cells")]
    StrayRow { table: String, row: String },
    #[error("the page cannot be rendered: {0}")]
    Template(#[from] minijinja::Error),
}

/// Some sections of the page, for a page that the browser assembles: `tables`, `figures`, `statistics`, `lists`,
/// `definitions`, each as its element.
pub fn sections(page: &Page<'_>, names: &[&str]) -> Result<Vec<String>, HtmlError> {
    let content = page::content(page)?;
    names.iter().map(|name| Ok(template::section(name, &content)?)).collect()
}

pub fn style_sheet() -> String {
    format!("{}\n{}", font_style_sheet(), template::STYLE)
}

pub fn render(page: &Page<'_>) -> Result<String, HtmlError> {
    Ok(template::render(page::content(page)?)?)
}

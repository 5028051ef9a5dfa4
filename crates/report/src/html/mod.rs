//! `report.html`: tables, figures and provenance of a report as one self-contained page.
//!
//! ```text
//! page.rs ──► cell.rs, filter.rs, definitions.rs, command.rs    template.rs
//! (the whole   (what the templates say, as text)            ──► (assets/templates: markup,
//!  page)        embedded.rs, pair.rs (JSON for the script)        style and script become one)
//! ```
//!
//! Rule: numbers arrive in final form; a cell's attributes carry the text of `cells.csv`. Names from traces are text:
//! templates escape them, and characters that act on a reader are spelled out first ([`visible`]). The page's policy
//! forbids all requests and all scripts but its own. It is complete without its script, which adds sorting, filters,
//! search, values on hover, the episodes behind a cell, and two models side by side. Selections are in the address.
//!
//! [`visible`]: exact::escape

mod cell;
mod command;
mod definitions;
mod embedded;
mod filter;
mod page;
mod pair;
mod template;

use crate::bundle::Manifest;
use crate::cells::Cells;
use crate::cells::group::GroupError;
use crate::layout::MetricTable;
use crate::statistics::Statistics;
use crate::tables::ListTable;
use score::table::EpisodeTable;

pub use command::{Recordings, word};

/// The contents of the page.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The tables, in order.
    pub tables: &'a [MetricTable],
    /// The cells that the tables show.
    pub cells: &'a Cells,
    /// The episodes behind the cells.
    pub episodes: &'a EpisodeTable,
    pub manifest: &'a Manifest,
    /// The figures, in order; an empty slice omits the section.
    pub figures: &'a [Figure<'a>],
    /// The statistics; `None` omits the section.
    pub statistics: Option<&'a Statistics>,
    /// The lists below the statistics, one section each.
    pub lists: &'a [ListTable],
    /// The recordings behind the episodes; absent for files of scores.
    pub recordings: Option<&'a Recordings>,
}

/// A figure for the page.
#[derive(Clone, Copy, Debug)]
pub struct Figure<'a> {
    /// The name of its files: `spider`, ...
    pub name: &'a str,
    pub title: &'a str,
    /// The explanation below it.
    pub caption: &'a str,
    /// An `<svg>` element, used unchanged: names in it must be escaped.
    pub svg: &'a str,
}

/// An error of making a page.
#[derive(Debug, thiserror::Error)]
pub enum HtmlError {
    #[error(transparent)]
    Grouping(#[from] GroupError),
    #[error("expected the cells of the episodes given, found other ones; group the same episode table")]
    OtherEpisodes,
    #[error("table `{table}`: the row `{row}` is of no cell; lay the tables out from the same cells")]
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

/// The style sheet of the page, with its font.
pub fn style_sheet() -> String {
    format!("{}\n{}", crate::figures::font_style_sheet(), template::STYLE)
}

/// Every metric of a catalog with its sentence, for a page.
pub fn metrics(catalog: &metric::catalog::Catalog) -> Vec<serde_json::Value> {
    definitions::metrics(catalog)
}

/// The text of `report.html`.
///
/// The same input gives the same text.
pub fn render(page: &Page<'_>) -> Result<String, HtmlError> {
    Ok(template::render(page::content(page)?)?)
}

//! What a report shows beside its tables: figures in every format, and the page that holds it all.

use std::num::NonZeroUsize;

use clap::ValueEnum as _;

use super::args::ScoringArgs;
use super::commands::figure::Format;
use super::drawing::{Drawings, Sources};
use super::outcome::Failure;
use super::scoring;
use crate::cells::cell::Cells;
use crate::report::bundle::{Manifest, OutputFile};
use crate::report::figures::FigureName;
use crate::report::html::{self, Figure, Page};
use crate::report::statistics::{Options, Statistics};
use crate::report::style::Style;
use crate::report::table::Table;
use crate::score::table::EpisodeTable;
use crate::trace::inputs::Input;

/// The most episodes that a page lists.
pub const MOST_EPISODES: usize = 20_000;

/// A report while it is made.
#[derive(Debug)]
pub struct Made {
    /// The files it comes from.
    pub inputs: Vec<Input>,
    /// The scores.
    pub episodes: EpisodeTable,
    /// The cells, as grouped.
    pub cells: Cells,
    /// The tables.
    pub tables: Vec<Table>,
    /// Where everything comes from.
    pub manifest: Manifest,
    /// How everything looks.
    pub style: Style,
}

/// How to read the traces again for what scores do not hold.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The definitions and the condition.
    pub scoring: &'a ScoringArgs,
    /// How many threads to use.
    pub threads: NonZeroUsize,
}

impl Asked<'_> {
    /// Every figure that can be drawn.
    ///
    /// # Errors
    /// What is wrong with the traces or the definitions.
    pub fn drawings(self, made: &Made) -> Result<Drawings, Failure> {
        let sources =
            Sources::of(&made.inputs, self.scoring, &made.episodes, &made.style, &FigureName::ALL, self.threads)?;
        Ok(sources.draw_all())
    }

    /// `report.html`; `None` for more than [`MOST_EPISODES`].
    ///
    /// # Errors
    /// What is wrong with the traces; a metric too large to square.
    pub fn page(self, made: &Made, drawings: &Drawings) -> Result<Option<OutputFile>, Failure> {
        if made.episodes.len() > MOST_EPISODES {
            return Ok(None);
        }
        let lost = scoring::lost(&made.inputs, self.threads)?;
        let options = Options { lost, ..Options::default() };
        let statistics = Statistics::of(&made.episodes, &made.cells, &options).map_err(Failure::input)?;
        let svgs: Vec<String> = drawings.drawn.iter().map(|(_, figure)| figure.inline_svg()).collect();
        let figures: Vec<Figure> =
            drawings.drawn.iter().zip(&svgs).map(|((name, _), svg)| figure_of(*name, svg)).collect();
        let page = Page {
            tables: &made.tables,
            cells: &made.cells,
            episodes: &made.episodes,
            manifest: &made.manifest,
            figures: &figures,
            statistics: Some(&statistics),
        };
        let text = html::render(&page).map_err(Failure::input)?;
        Ok(Some(OutputFile { path: "report.html".into(), bytes: text.into_bytes() }))
    }
}

fn figure_of(name: FigureName, svg: &str) -> Figure<'_> {
    Figure { name: name.name(), title: name.title(), caption: name.caption(), svg }
}

/// The figures in every format, as files of a report.
///
/// # Errors
/// When a picture has no room in memory.
pub fn figure_files(drawings: &Drawings) -> Result<Vec<OutputFile>, Failure> {
    let mut files = Vec::new();
    for (name, figure) in &drawings.drawn {
        for format in Format::value_variants() {
            let path = format!("figures/{name}.{}", format.ending()).into();
            files.push(OutputFile { path, bytes: format.encode(figure)? });
        }
    }
    Ok(files)
}

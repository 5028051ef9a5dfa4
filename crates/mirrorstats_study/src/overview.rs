//! Sections of a report for episodes that are already scored, for pages that are assembled on request.

use crate::figure::{Drawings, FigureInputs};
use crate::losses::Counted;
use crate::results::Results;
use crate::statistics::statistics;
use crate::tables::tables;
use crate::{Study, StudyError};
use mirrorstats_analysis::statistics::Options;
use mirrorstats_report::bundle::Manifest;
use mirrorstats_report::html::{self, Page};
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::{Cells, KeyValue};
use mirrorstats_trace::schema::SCHEMA_VERSION;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Tables,
    Figures,
    Statistics,
}

#[derive(Clone, Debug)]
pub struct Overview {
    /// The HTML element of each section, in page order.
    pub sections: Vec<String>,
    pub episodes: usize,
    pub by: Vec<String>,
    /// The values of these columns for each group, in the numbering of the table rows; `None` for null.
    pub groups: Vec<Vec<Option<String>>>,
}

/// Makes report sections from these results, which come from a scan of this study, or from a part of them. Errors:
/// faults of the style; a cell that mixes episodes recorded differently.
pub fn overview(study: &Study, results: Results, style: &str, part: Part) -> Result<Overview, StudyError> {
    let style = Style::load(style)?;
    let grouped = study.group(Counted::of(results, study.question.lost))?;
    let (results, cells) = (&grouped.counted.results, &grouped.cells);
    let statistics = (part != Part::Tables).then(|| statistics(&grouped, &Options::default())).transpose()?;
    let drawings = match part {
        Part::Figures => {
            let inputs = FigureInputs::of_a_report(results, &style)?;
            inputs.draw_all(None).and(inputs.draw_all(statistics.as_ref()))
        }
        Part::Tables | Part::Statistics => Drawings::default(),
    };
    let (tables, lists) = tables(&grouped, &style)?;
    let manifest = Manifest::new(cells, &style, SCHEMA_VERSION, study.question.filter.clone(), results.inputs.clone());
    let names: &[&str] = match part {
        Part::Tables if !lists.is_empty() => &["tables", "lists", "definitions"],
        Part::Tables => &["tables", "definitions"],
        Part::Figures => &["figures"],
        Part::Statistics => &["statistics"],
    };
    let page = Page {
        tables: &tables,
        cells,
        episodes: &results.episodes,
        manifest: &manifest,
        figures: &drawings.drawn,
        statistics: statistics.as_ref(),
        lists: &lists,
        recordings: None,
    };
    let sections = html::sections(&page, names)?;
    Ok(Overview { sections, episodes: results.episodes.len(), by: cells.by.clone(), groups: groups(cells) })
}

fn groups(cells: &Cells) -> Vec<Vec<Option<String>>> {
    cells.groups.iter().map(|group| group.key.iter().map(KeyValue::text).collect()).collect()
}

//! Sections of a report for episodes that are already scored, for pages that are assembled on request.

use crate::Study;
use crate::error::StudyError;
use crate::figure_inputs::FigureInputs;
use crate::losses::Counted;
use crate::results::Results;
use mirrorstats_analysis::statistics::Options;
use mirrorstats_report::bundle::Manifest;
use mirrorstats_report::html::{self, Page};
use mirrorstats_report::layout::quality;
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

impl Study {
    /// Makes report sections from these results, which come from a scan of this study, or from a part of them. Errors:
    /// faults of the style; a cell that mixes episodes recorded differently.
    pub fn overview(&self, results: Results, style: &str, part: Part) -> Result<Overview, StudyError> {
        let style = Style::load(style)?;
        let counted = self.counted(results);
        let cells = self.cells_of(&counted.results.episodes)?;
        let statistics = match part {
            Part::Statistics => Some(self.statistics_of(&counted, &cells, &Options::default())?),
            Part::Tables | Part::Figures => None,
        };
        let replies = counted.replies();
        let Counted { results, lost, .. } = counted;
        let drawings = match part {
            Part::Figures => FigureInputs::of_a_report(&results, &style)?.draw_all(),
            Part::Tables | Part::Statistics => crate::Drawings::default(),
        };
        let svgs = drawings.svgs();
        let (tables, ranks) = self.tables(&results.episodes, (&lost, replies.as_ref()), &cells, &style)?;
        let lists: Vec<_> = ranks.into_iter().chain(results.quality.as_ref().and_then(quality::of_cells)).collect();
        let manifest =
            Manifest::new(&cells, &style, SCHEMA_VERSION, self.question.filter.clone(), results.inputs.clone());
        let names: &[&str] = match part {
            Part::Tables if !lists.is_empty() => &["tables", "lists", "definitions"],
            Part::Tables => &["tables", "definitions"],
            Part::Figures => &["figures"],
            Part::Statistics => &["statistics"],
        };
        let page = Page {
            tables: &tables,
            cells: &cells,
            episodes: &results.episodes,
            manifest: &manifest,
            figures: &drawings.on_page(&svgs),
            statistics: statistics.as_ref(),
            lists: &lists,
            recordings: None,
        };
        let sections = html::sections(&page, names)?;
        Ok(Overview { sections, episodes: results.episodes.len(), by: cells.by.clone(), groups: groups(&cells) })
    }
}

fn groups(cells: &Cells) -> Vec<Vec<Option<String>>> {
    let text = |value: &KeyValue| match value {
        KeyValue::Missing => None,
        value => Some(value.to_string()),
    };
    cells.groups.iter().map(|group| group.key.iter().map(text).collect()).collect()
}

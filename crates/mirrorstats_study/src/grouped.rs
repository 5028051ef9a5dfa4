//! The counted episodes of a study and their cells, from which answers are made.

use crate::caveats::{design_of, pooled_cells, selection, undecided};
use crate::losses::{Counted, beside_cells};
use crate::{Study, StudyError};
use mirrorstats_analysis::statistics::Ranks;
use mirrorstats_report::layout::{self, MetricTable};
use mirrorstats_report::style::{EmphasisRule, Style};
use mirrorstats_score::cells::Cells;
use mirrorstats_tables::ListTable;

/// The counted episodes of a study, and their cells.
#[derive(Debug)]
pub struct Grouped<'s> {
    pub(crate) study: &'s Study,
    pub(crate) counted: Counted,
    pub(crate) cells: Cells,
}

impl Grouped<'_> {
    /// The tables of a style, and the ranks if the style marks ties.
    pub(crate) fn tables(&self, style: &Style) -> Result<(Vec<MetricTable>, Option<ListTable>), StudyError> {
        let Self { study, counted, cells } = self;
        let (episodes, lost) = (&counted.results.episodes, undecided(study, &counted.lost));
        let (mut tables, mut ranks) = (layout::tables(cells, style)?, None);
        if tables.iter().any(|table| table.is_tied) {
            let found = Ranks::of_table(episodes, &lost, design_of(&episodes.declared), study.question.pool)?;
            for table in &mut tables {
                table.mark_ties(&found, style.sheet.emphasis_note(EmphasisRule::Tied));
            }
            ranks = found.list();
        }
        let chosen = selection(study, episodes).map(|selection| selection.sentence());
        let pooled = pooled_cells(study, episodes)?.unwrap_or_default();
        let left_out = beside_cells(&lost, counted.replies().as_ref());
        for table in &mut tables {
            table.footnotes.extend(chosen.iter().chain(&pooled).chain(&left_out).cloned());
        }
        Ok((tables, ranks))
    }
}

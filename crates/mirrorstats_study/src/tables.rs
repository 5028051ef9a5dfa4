//! The tables of a study in a style, with their footnotes and lists.

use crate::StudyError;
use crate::caveats::{design_of, pooled_cells, selection, undecided};
use crate::losses::beside_cells;
use crate::study::Grouped;
use mirrorstats_analysis::statistics::Ranks;
use mirrorstats_report::layout::{self, MetricTable, quality};
use mirrorstats_report::style::{EmphasisRule, Style};
use mirrorstats_tables::ListTable;

/// The tables of a style; and the lists: ranks, if the style marks ties, and reply quality, if it was scanned.
pub(crate) fn tables(grouped: &Grouped<'_>, style: &Style) -> Result<(Vec<MetricTable>, Vec<ListTable>), StudyError> {
    let Grouped { study, counted, cells } = grouped;
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
    let unit_means = Ranks::unit_means(episodes, design_of(&episodes.declared))?;
    let pooled = pooled_cells(study, episodes)?.unwrap_or_default();
    let left_out = beside_cells(&lost, counted.replies().as_ref());
    for table in &mut tables {
        table.footnotes.extend(chosen.iter().chain(&unit_means).chain(&pooled).chain(&left_out).cloned());
    }
    let quality = counted.results.quality.as_ref().and_then(quality::of_cells);
    Ok((tables, ranks.into_iter().chain(quality).collect()))
}

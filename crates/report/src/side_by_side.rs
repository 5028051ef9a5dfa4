//! A comparison with published values as text: the differing cells side by side, the reasons, a summary line.

use std::fmt::Write as _;

use crate::comparison::{Comparison, Difference};
use crate::tables::{Column, Look, Table, push_wrapped};
use exact::escape::visible;

impl Comparison {
    /// The whole answer of `compare`, in lines of at most `width` columns.
    pub fn render(&self, width: Option<usize>) -> String {
        let mut text = String::new();
        if !self.differences.is_empty() {
            push_differences(&mut text, &self.differences, width);
            text.push('\n');
        }
        for erratum in &self.unused_errata {
            let _ = writeln!(
                text,
                "erratum not needed: {}, {}, {}, {}: `{}` for `{}`",
                visible(&erratum.experiment),
                visible(&erratum.model),
                visible(&erratum.metric),
                erratum.field.name(),
                visible(&erratum.published),
                visible(&erratum.computed),
            );
        }
        if !self.unpublished.is_empty() {
            let _ = writeln!(text, "not in the published table: {} of our cells", self.unpublished.len());
        }
        let _ = writeln!(
            text,
            "{}: {} cells: {} as published, {} excused by errata, {} differ",
            visible(&self.table),
            self.cells,
            self.same,
            self.excused,
            self.differing
        );
        text
    }
}

/// Experiment, model and metric: the columns that name a cell.
const NAMES: usize = 3;

fn push_differences(text: &mut String, differences: &[Difference], width: Option<usize>) {
    let header = ["experiment", "model", "metric", "field", "published", "computed", "verdict"];
    let mut table = Table::list(Look::Framed, NAMES, header.map(Column::left));
    let mut reasons = Vec::new();
    for difference in differences {
        let verdict = match &difference.excused_by {
            None => "differs".to_owned(),
            Some(reason) => {
                reasons.push(reason);
                format!("excused [{}]", reasons.len())
            }
        };
        table.push(record(difference, verdict));
    }
    *text += &table.within(width);
    for (at, reason) in reasons.iter().enumerate() {
        let number = format!("[{}] ", at + 1);
        push_wrapped(text, &format!("{number}{}", visible(reason)), width, number.len());
    }
}

fn record(difference: &Difference, verdict: String) -> [String; 7] {
    let or_none = |text: &str| if text.is_empty() { "(none)" } else { text }.to_owned();
    let (field, computed) = match difference.field {
        Some(field) => (field.name(), or_none(&difference.computed)),
        None => ("cell", "(not in the traces)".to_owned()),
    };
    let published = or_none(&difference.published);
    [
        difference.cell.experiment.clone(),
        difference.cell.model.clone(),
        difference.cell.metric.clone(),
        field.to_owned(),
        published,
        computed,
        verdict,
    ]
}

use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_tables::Table;

use super::agreement::{LabelAgreement, PairAgreement};

/// The labels of coders and their agreement as text.
pub fn agreement_text(found: &LabelAgreement, width: Option<usize>) -> String {
    let mut parts = vec![format!("{} of {} coded\n", found.coded, counted(found.episodes, "episode"))];
    if found.elsewhere > 0 {
        let elsewhere = counted(found.elsewhere, "episode");
        parts.push(format!("{elsewhere} more coded, which the traces lack or --where leaves out\n"));
    }
    let coders = found.coders.iter().map(|coder| [coder.coder.clone(), coder.episodes.to_string()]);
    let labels = found.labels.iter().map(|label| [label.label.clone(), label.episodes.to_string()]);
    for (title, table) in [
        ("", Table::of_texts(["coder", "episodes"]).aligned_right([1]).with(coders)),
        ("", Table::of_texts(["label", "episodes"]).aligned_right([1]).with(labels)),
        ("agreement of two coders\n", pairs(&found.agreement)),
    ] {
        if !table.is_empty() {
            parts.push(format!("\n{title}{}", table.within(width)));
        }
    }
    if found.coders.len() == 1 {
        parts.push("\nOne coder: agreement needs a second one on the same episodes.\n".to_owned());
    }
    parts.concat()
}

fn pairs(pairs: &[PairAgreement]) -> Table {
    let header =
        ["label", "coders", "n", "both", "first only", "second only", "neither", "agree", "kappa", "95 % interval"];
    let rows = pairs.iter().map(|pair| {
        let counts = pair.counts;
        let shown = pair
            .interval
            .map(|interval| format!("[{}, {}]", fixed(Some(interval.low), 2), fixed(Some(interval.high), 2)));
        let why = pair.cannot_say.as_ref().map(|why| format!("cannot say: {why}"));
        [
            pair.label.clone(),
            pair.coders.join(", "),
            pair.n.to_string(),
            counts.both.to_string(),
            counts.first_only.to_string(),
            counts.second_only.to_string(),
            counts.neither.to_string(),
            fixed(pair.agreement, 2),
            fixed(pair.kappa, 2),
            shown.or(why).unwrap_or_default(),
        ]
    });
    Table::of_texts(header).aligned_right(2..=8).with(rows)
}

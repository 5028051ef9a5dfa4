//! Changes from one scoring to another, as text: `lists` has the tables, `words` their fields.
//!
//! Rule: a shortened list says how many lines are missing; a number comes with its exact counts.

mod lists;
mod words;

use std::fmt::Write as _;

use crate::cells::diff::{Changes, DefinitionsName, Overlap};
use exact::escape::visible;
use exact::format::counted;

/// The number of items shown of each list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit(pub usize);

/// The number of digits of a hash that identify definitions.
const SHORT_HASH: usize = 12;

impl Changes {
    /// The whole answer of `diff`, with tables at most `width` columns wide; the last line is a summary.
    pub fn render(&self, limit: Limit, width: Option<usize>) -> String {
        let mut text = String::new();
        let names = &self.definitions;
        let _ = writeln!(text, "before: {}\nafter:  {}", origin(&names.before), origin(&names.after));
        push_section(&mut text, "Written differently", lists::rewritten(&self.rewritten, limit, width));
        push_alone(&mut text, "metric", &self.metrics, limit, |name| visible(name));
        push_alone(&mut text, "episode", &self.episodes, limit, |name| visible(&name.episode_id));
        push_section(&mut text, "Cells that moved", lists::cells(self, limit, width));
        push_section(&mut text, "Values that flipped, by metric", lists::flips_by_metric(&self.flips));
        push_section(&mut text, "Episodes that flipped", lists::flips(&self.flips, limit, width));
        let _ = writeln!(text, "\n{}", sum(self));
        text
    }
}

fn origin(name: &DefinitionsName) -> String {
    let hash = name.sha256.get(..SHORT_HASH).unwrap_or(&name.sha256);
    format!("{} ({hash})", visible(&name.name))
}

fn push_section(text: &mut String, title: &str, section: Option<String>) {
    if let Some(section) = section {
        let _ = writeln!(text, "\n{title}\n{section}");
    }
}

fn push_alone<T>(text: &mut String, noun: &str, overlap: &Overlap<T>, limit: Limit, name: impl Fn(&T) -> String) {
    for (side, alone) in [("before", &overlap.only_before), ("after", &overlap.only_after)] {
        if !alone.is_empty() {
            let names: Vec<String> = alone.iter().take(limit.0).map(&name).collect();
            let rest = words::left_out(alone.len(), limit).map_or_else(String::new, |rest| format!("; {rest}"));
            let _ = writeln!(text, "\nOnly {side}: {}: {}{rest}", counted(alone.len() as u64, noun), names.join(", "));
        }
    }
}

fn sum(changes: &Changes) -> String {
    let over = format!(
        "{} in both, {} in both",
        counted(changes.episodes.both, "episode"),
        counted(changes.metrics.both, "metric")
    );
    if changes.is_empty() {
        return format!("Nothing changed: {over}, {} compared.", counted(changes.cells_compared, "cell"));
    }
    format!(
        "{} of {} moved; {} in {}; {over}.",
        changes.cells.len(),
        counted(changes.cells_compared, "cell"),
        counted(changes.flips.len() as u64, "flip"),
        counted(changes.flipped_episodes().len() as u64, "episode"),
    )
}

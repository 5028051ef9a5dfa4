//! Statistics for people: first the answers, then the numbers behind them, each under the name of its method.
//!
//! Rule: text from traces is shown, never obeyed ([`visible`]).

pub mod pairs;
pub mod sequential;
mod tables;
mod text_table;

pub(crate) use self::tables::beside;

use super::{Answer, DesignAudit, FEW, Selection, Statistics};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_tables::{Table, push_wrapped};

/// The most characters of caveats that each answer repeats.
const MOST_REPEATED: usize = 120;

/// The most models whose ranks are printed before `--full`; others are counted.
const MOST_RANKED: usize = 12;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Length {
    /// One screen: the audit, the answers, tied models, and what cannot be concluded.
    Screen,
    /// The numbers behind the answers, too.
    Tables,
    /// Everything: every row and interval, plain means, clusters, detectable differences.
    Full,
}

impl Statistics {
    /// The text, with tables for these metrics only, in lines of at most `width` columns. Empty tables are omitted.
    /// [`Statistics::headline`] has the metrics for a reader who did not choose.
    pub fn render(&self, metrics: &[String], length: Length, width: Option<usize>) -> String {
        let statistics = self;
        let shown = |metric: &str| metrics.iter().any(|name| name == metric);
        let mut text = format!(
            "{}, definitions {}, {} confidence\n",
            counted(statistics.episodes as u64, "episode"),
            visible(&statistics.definitions),
            percent(statistics.confidence)
        );
        episodes(&mut text, statistics.selection.as_ref(), &statistics.pooled, width);
        push_wrapped(&mut text, &format!("Design: {}.", visible(&statistics.design_note)), width, 0);
        audit(&mut text, &statistics.audit, width);
        departures(&mut text, statistics.departures.as_deref(), width);
        list(&mut text, &heading(statistics), &answers(statistics), width);
        if length == Length::Full {
            list(&mut text, "What can be concluded", &statistics.conclusions, width);
        }
        let design = format!("{}.", statistics.design_note);
        let is_new = |warning: &&String| **warning != design && !statistics.pooled.contains(warning);
        let warnings: Vec<String> = statistics.warnings.iter().filter(is_new).cloned().collect();
        let most = if length == Length::Full { usize::MAX } else { MOST_RANKED };
        let tied = tables::tied(statistics, &shown, most).into_iter();
        // One screen has the ranks under the first metric.
        let count = if length == Length::Screen { 1 } else { usize::MAX };
        tied.take(count).for_each(|table| section(&mut text, table, width));
        list(&mut text, "What cannot be concluded", &warnings, width);
        for table in sections(statistics, &shown, length) {
            section(&mut text, table, width);
        }
        let more = match length {
            Length::Screen => "--tables prints the numbers behind the answers; --full also every row and interval.",
            Length::Tables => {
                "--full prints every row and interval, plain means, clusters, and what could have been shown."
            }
            Length::Full => return text,
        };
        text.push('\n');
        push_wrapped(&mut text, more, width, 0);
        text
    }
}

impl DesignAudit {
    /// The cells as a table, then the findings, in lines of at most `width` columns.
    pub fn render(&self, width: Option<usize>) -> String {
        let mut text = tables::design(self).within(width) + "\n";
        audit(&mut text, self, width);
        text
    }
}

/// The answers, each with its caveats. Long findings of the audit, which is above, are named by their numbers.
fn answers(statistics: &Statistics) -> Vec<String> {
    let findings = &statistics.audit.findings;
    let line = |answer: &Answer| {
        let number = |caveat: &str| findings.iter().position(|it| it.finding == caveat).map(|at| at + 1);
        let is_long = answer.caveats.iter().map(String::len).sum::<usize>() > MOST_REPEATED;
        let numbers: Vec<String> =
            answer.caveats.iter().filter_map(|it| number(it)).map(|number| format!("[{number}]")).collect();
        let mut caveats: Vec<String> =
            answer.caveats.iter().filter(|it| !is_long || number(it).is_none()).cloned().collect();
        if is_long && !numbers.is_empty() {
            caveats.push(format!("design audit {}", numbers.join(" ")));
        }
        let caveats = caveats.join("; ");
        let caveats = if caveats.is_empty() { caveats } else { format!(" ({caveats})") };
        format!("{} {}: {}{caveats}.", answer.question, answer.metric, answer.answer)
    };
    statistics.answers.iter().map(line).collect()
}

/// The filter that chose the episodes, and the settings that they pool.
fn episodes(text: &mut String, selection: Option<&Selection>, pooled: &[String], width: Option<usize>) {
    let pooled = pooled.iter().map(|sentence| visible(sentence));
    let sentences = selection.map(Selection::sentence).into_iter().chain(pooled);
    sentences.for_each(|sentence| push_wrapped(text, &sentence, width, 0));
}

fn audit(text: &mut String, audit: &DesignAudit, width: Option<usize>) {
    if audit.findings.is_empty() {
        push_wrapped(
            text,
            &format!("Design audit: nothing found in {}.", counted(audit.cells.len() as u64, "cell")),
            width,
            0,
        );
    }
    let numbered = (1..).zip(audit.sentences()).map(|(number, sentence)| format!("[{number}] {sentence}"));
    list(text, "Design audit", &numbered.collect::<Vec<_>>(), width);
}

fn departures(text: &mut String, found: Option<&[String]>, width: Option<usize>) {
    let Some(found) = found else { return };
    let none = ["no departure found".to_owned()];
    list(text, "Registered plan", if found.is_empty() { &none } else { found }, width);
}

fn heading(statistics: &Statistics) -> String {
    let of = match (statistics.families, statistics.answers.len()) {
        (_, 0 | 1) => String::new(),
        (1, _) => " within 1 family of tests".to_owned(),
        (families, _) => {
            format!(
                " within each of {families} families of tests; the first answer is primary, the others are secondary"
            )
        }
    };
    format!("Answers, after Holm's adjustment{of}")
}

/// The numbers behind the answers; empty tables are not printed.
fn sections(statistics: &Statistics, shown: tables::Shown, length: Length) -> Vec<Table> {
    if length == Length::Screen {
        return Vec::new();
    }
    let is_full = length == Length::Full;
    let mut sections = vec![
        tables::rates(statistics, shown, is_full),
        tables::chance(statistics, shown, is_full),
        tables::separated(statistics, shown, is_full),
        tables::overall(statistics, shown, is_full),
        tables::conditions(statistics, shown, is_full),
        tables::trends(statistics, shown),
        tables::durations(statistics, shown),
        tables::retests(statistics, shown),
        tables::losses(statistics, shown),
    ];
    if is_full {
        sections.extend([
            tables::improvements(statistics, shown),
            tables::correct(statistics, shown),
            tables::quantities(statistics, shown),
            tables::clusters(statistics, shown),
        ]);
    }
    sections
}

fn list(text: &mut String, title: &str, sentences: &[String], width: Option<usize>) {
    if sentences.is_empty() {
        return;
    }
    text.push('\n');
    push_wrapped(text, title, width, 0);
    for sentence in sentences {
        push_wrapped(text, &format!("  - {}", visible(sentence)), width, 4);
    }
}

fn section(text: &mut String, mut table: Table, width: Option<usize>) {
    if table.is_empty() {
        return;
    }
    if table.rows().flatten().any(|cell| cell.text.contains(tables::FEW_MARK)) {
        table.sentences.push(format!("{} fewer than {FEW} defined episodes: not to be compared.", tables::FEW_MARK));
    }
    text.push('\n');
    *text += &table.within(width);
}

pub fn percent(confidence: f64) -> String {
    let text = fixed(Some(confidence * 100.0), 3);
    format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::percent;

    #[test]
    fn a_confidence_is_a_percentage() {
        assert_eq!([percent(0.95), percent(0.995), percent(0.9)], ["95 %", "99.5 %", "90 %"]);
    }
}

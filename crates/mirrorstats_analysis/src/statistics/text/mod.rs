//! Statistics for people: first the answers, then the numbers behind them, each under the name of its method.
//!
//! Rule: text from traces is shown, never obeyed ([`visible`]).

pub mod pairs;
pub mod sequential;
mod tables;
mod text_table;

pub(crate) use self::tables::beside;

use super::{Answer, DesignAudit, FEW, Family, Selection, Statistics};
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
        let percent = percent(statistics.confidence);
        let mut text = format!(
            "{}, definitions {}, {percent} confidence\n",
            counted(statistics.episodes as u64, "episode"),
            visible(&statistics.definitions)
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
        let tables = if length == Length::Screen { Vec::new() } else { sections(statistics, &shown, length, &percent) };
        for (title, table) in tables {
            section(&mut text, table.titled(title), width);
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

fn sections(statistics: &Statistics, shown: tables::Shown, length: Length, percent: &str) -> Vec<(String, Table)> {
    let is_full = length == Length::Full;
    let mut sections = Vec::new();
    let mut add = |title: String, table: Table| sections.push((title, table));
    let title = if is_full { "intervals" } else { "score intervals (Wilson)" };
    add(format!("Rates, {percent} {title}"), tables::rates(statistics, shown, is_full));
    let mid_p = if is_full { "; mid-p need not keep the level" } else { "" };
    let title = "Against chance: exact binomial test, two-sided by minimum likelihood; Holm over the models";
    add(format!("{title}{mid_p}"), tables::chance(statistics, shown, is_full));
    let is_permuted = statistics.models.iter().flat_map(Family::comparisons).any(|found| found.p_error.is_some());
    let by_permutation = if is_permuted { ", also by permutation at unequal n" } else { "" };
    let title = format!(
        "Models told apart: exact tests two-sided by minimum likelihood (McNemar of pairs, Fisher of independent \
         episodes), t tests of restricted means{by_permutation}; Holm over all pairs; {percent} intervals (Newcombe) not \
         adjusted"
    );
    add(title, tables::separated(statistics, shown, is_full));
    let title = format!(
        "Models over all experiments: exact conditional test with the Mantel-Haenszel difference and Klingenberg's \
         {percent} interval, McNemar's over the pairs of all, or permutation by scene or cluster; two-sided by minimum \
         likelihood; Holm over all pairs"
    );
    add(title, tables::overall(statistics, shown, is_full));
    let title = format!(
        "Between conditions: first experiment minus the other, by the same methods; Holm over the models; {percent} \
         intervals not adjusted"
    );
    add(title, tables::conditions(statistics, shown, is_full));
    let title = "Rates against a dose: Cochran-Armitage test within each scene or other unit (Mantel 1963); Holm over the models";
    add(title.to_owned(), tables::trends(statistics, shown));
    let title = format!(
        "Durations: unfinished episodes censored (Kaplan-Meier); medians by Brookmeyer and Crowley, restricted means on \
         the log-odds scale, {percent} intervals"
    );
    add(title, tables::durations(statistics, shown));
    let title = "The same scene played again: verdicts that differ by chance alone, which a difference has to exceed";
    add(title.to_owned(), tables::retests(statistics, shown));
    add("Lost to infrastructure".to_owned(), tables::losses(statistics, shown));
    if !is_full {
        return sections;
    }
    let title = format!(
        "How often one model decides earlier than another, averaged over experiments; who never decides is the latest; \
         stratified bootstrap, {percent} percentile intervals"
    );
    add(title, tables::improvements(statistics, shown));
    let title = format!("Time to a correct decision: a wrong one competes (Aalen-Johansen); {percent} intervals");
    add(title, tables::correct(statistics, shown));
    let title = format!("Quantities, {percent} intervals of the plain mean: Student's t, seeded BCa bootstrap");
    add(title, tables::quantities(statistics, shown));
    let title = "By seed: cluster-robust standard errors, t(seeds - 1), of rates on the log-odds scale";
    add(title.to_owned(), tables::clusters(statistics, shown));
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

//! Sequential statistics for people.

use super::tables::{Shown, plain};
use super::text_table::TextTable;
use super::{audit, departures, episodes, list, percent, section};
use crate::statistics::{Sequential, SequentialPair, Verdict};
use mirrorstats_exact::chance::with_strategy;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::{counted, e_value, fixed};
use mirrorstats_tables::{Table, push_wrapped};

/// The methods, with line breaks for a wide terminal.
const METHODS: [&str; 5] = [
    "Methods: beta-binomial mixtures over Beta(1/2, 1/2) (Robbins; Krichevsky and Trofimov), which need no order; p is",
    "1 / e, and Holm's adjustment of it holds at every look. What they need: each next episode succeeds with the same",
    "probability, whatever came before, and what is seen decides when the study stops, not which episodes it counts.",
    "Models are compared by pairs of equal scenes; episodes without such a partner are paired in the order of seed and run.",
    "Each scene counts once, by its first episode.",
];

impl Sequential {
    /// The whole text, for these metrics only, in lines of at most `width` columns. Pairs of models that are not
    /// separated are counted.
    pub fn render(&self, metrics: &[String], width: Option<usize>) -> String {
        let sequential = self;
        let shown = |metric: &str| metrics.iter().any(|name| name == metric);
        let percent = percent(sequential.confidence);
        let definitions = visible(&sequential.definitions);
        let opening = format!(
            "{} so far, definitions {definitions}, {percent} confidence at every look",
            counted(sequential.episodes as u64, "episode")
        );
        let mut text = String::new();
        push_wrapped(&mut text, &opening, width, 0);
        episodes(&mut text, sequential.selection.as_ref(), &sequential.pooled, width);
        audit(&mut text, &sequential.audit, width);
        departures(&mut text, sequential.departures.as_deref(), width);
        list(&mut text, "What every verdict leaves out", &sequential.caveats, width);
        list(&mut text, "What this is for", &PURPOSE.map(str::to_owned), width);
        let pairs: Vec<&SequentialPair> = sequential.models.iter().filter(|pair| shown(&pair.metric)).collect();
        for table in [rates(sequential, &shown), chance(sequential, &shown), separated(&pairs)] {
            section(&mut text, table, width);
        }
        let told_apart = pairs.iter().filter(|pair| pair.verdict != Verdict::NotSeparated).count();
        let apart = sequential.not_comparable.iter();
        let apart: Vec<String> = apart
            .map(|(setting, pairs)| format!("{} not comparable ({setting})", counted(*pairs as u64, "pair")))
            .collect();
        let outcome = match pairs.len() {
            0 if !apart.is_empty() => format!("No two models are compared: {}.", apart.join("; ")),
            0 => "No two models have episodes of one experiment: they are not compared.".to_owned(),
            1 => format!("{told_apart} of 1 pair of models is told apart so far."),
            all => format!("{told_apart} of {all} pairs of models are told apart so far."),
        };
        let outcome = match apart.as_slice() {
            [] => outcome,
            _ if pairs.is_empty() => outcome,
            apart => format!("{outcome} {}.", apart.join("; ")),
        };
        text.push('\n');
        push_wrapped(&mut text, &outcome, width, 0);
        text.push('\n');
        for line in METHODS {
            push_wrapped(&mut text, line, width, 0);
        }
        text
    }
}

const PURPOSE: [&str; 2] = [
    "A running study: look as often as you like, stop when you like; these intervals and verdicts keep their confidence.",
    "The price is width. Where the number of episodes was fixed beforehand, `stats` without --sequential shows more.",
];

fn rates(sequential: &Sequential, shown: Shown) -> Table {
    TextTable::of(sequential.rates.iter().filter(|row| shown(&row.metric)))
        .cell(|row| (&row.key, &row.metric))
        .number("count", |row| format!("{}/{}", row.successes, row.n))
        .number("rate", |row| fixed(row.rate, 3))
        .number("sequence", |row| plain(row.interval, 3))
        .table()
        .titled(format!("Rates, {} confidence sequences", percent(sequential.confidence)))
}

fn chance(sequential: &Sequential, shown: Shown) -> Table {
    TextTable::of(sequential.chance.iter().filter(|row| shown(&row.metric)))
        .cell(|row| (&row.key, &row.metric))
        .text("level", |row| format!("{} {}", row.role.name(), with_strategy(row.level, row.strategy.as_deref())))
        .number("count", |row| format!("{}/{}", row.successes, row.n))
        .number("e", |row| e_value(row.e))
        .p_values(false, |row| [Some(row.p), None, Some(row.p_adjusted)])
        .number("verdict", |row| row.verdict.name())
        .table()
        .titled("Against chance: e-values, Holm over the models")
}

fn separated(pairs: &[&SequentialPair]) -> Table {
    let order = |pair: &SequentialPair| if pair.verdict == Verdict::Below { [1, 0] } else { [0, 1] };
    let models = |pair: &SequentialPair| order(pair).map(|at| [&pair.first, &pair.second][at].clone());
    let only = |pair: &SequentialPair| order(pair).map(|at| [pair.pairs.first_only, pair.pairs.second_only][at]);
    TextTable::of(pairs.iter().filter(|pair| pair.verdict != Verdict::NotSeparated))
        .text("experiment", |pair| pair.experiment.clone())
        .text("metric", |pair| pair.metric.clone())
        .text("higher", |pair| models(pair)[0].clone())
        .text("lower", |pair| models(pair)[1].clone())
        .number("only one", |pair| only(pair).map(|count| count.to_string()).join(":"))
        .number("e", |pair| e_value(pair.e))
        .p_values(false, |pair| [Some(pair.p), None, Some(pair.p_adjusted)])
        .table()
        .titled("Models told apart: e-values of discordant pairs, Holm over all pairs of an experiment")
}

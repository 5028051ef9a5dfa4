//! Sequential statistics for people.

use super::{departures, list, percent, section};
use crate::statistics::{Role, Sequential, SequentialChance, SequentialPair, Verdict};
use crate::tables::{Table, push_wrapped};
use exact::escape::visible;
use exact::format::{bounds, e_value, fixed, p_value};

/// The methods, with line breaks for a wide terminal.
const METHODS: [&str; 5] = [
    "Methods: beta-binomial mixtures over Beta(1/2, 1/2) (Robbins; Krichevsky and Trofimov), which need no order; p is",
    "1 / e, and Holm's adjustment of it holds at every look. What they need: each next episode succeeds with the same",
    "probability, whatever came before, and what is seen decides when the study stops, not which episodes it counts.",
    "Models are compared by pairs of equal scenes; episodes without such a partner are paired in the order of seed and run.",
    "Each scene counts once, by its first episode.",
];

impl Sequential {
    /// The whole text, for these metrics only, in lines of at most `width` columns.
    ///
    /// Pairs of models that are not separated are counted.
    pub fn render(&self, metrics: &[String], width: Option<usize>) -> String {
        let sequential = self;
        let shown = |metric: &String| metrics.contains(metric);
        let percent = percent(sequential.confidence);
        let definitions = visible(&sequential.definitions);
        let opening = format!(
            "{} episodes so far, definitions {definitions}, {percent} confidence at every look",
            sequential.episodes
        );
        let mut text = String::new();
        push_wrapped(&mut text, &opening, width, 0);
        if let Some(selection) = &sequential.selection {
            push_wrapped(&mut text, &selection.sentence(), width, 0);
        }
        for sentence in &sequential.pooled {
            push_wrapped(&mut text, &visible(sentence), width, 0);
        }
        departures(&mut text, sequential.departures.as_deref(), width);
        list(&mut text, "What this is for", &PURPOSE.map(str::to_owned), width);
        let pairs: Vec<&SequentialPair> = sequential.models.iter().filter(|pair| shown(&pair.metric)).collect();
        for (title, table) in [
            (&*format!("Rates, {percent} confidence sequences"), rates(sequential, &shown)),
            ("Against chance: e-values, Holm over the models", chance(sequential, &shown)),
            (
                "Models told apart: e-values of discordant pairs, Holm over all pairs of an experiment",
                separated(&pairs),
            ),
        ] {
            section(&mut text, title, table, width);
        }
        let told_apart = pairs.iter().filter(|pair| pair.verdict != Verdict::NotSeparated).count();
        let outcome = match pairs.len() {
            0 => "No two models have episodes of one experiment: they are not compared.".to_owned(),
            all => format!("{told_apart} of {all} pairs of models are told apart so far."),
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

/// The purpose of this page and of the other one.
const PURPOSE: [&str; 2] = [
    "A running study: look as often as you like, stop when you like; these intervals and verdicts keep their confidence.",
    "The price is width. Where the number of episodes was fixed beforehand, `stats` without --sequential shows more.",
];

type Shown<'a> = &'a dyn Fn(&String) -> bool;

fn rates(sequential: &Sequential, shown: Shown) -> Table {
    let lines = sequential.rates.iter().filter(|row| shown(&row.metric)).map(|row| {
        let names = [row.experiment.clone(), row.name(), row.metric.clone()];
        let interval = bounds(row.interval.map(|interval| (interval.low, interval.high)), 3);
        let count = format!("{}/{}", row.successes, row.n);
        names.into_iter().chain([count, fixed(row.rate, 3), interval])
    });
    Table::plain(&["experiment", "model", "metric"], &["count", "rate", "sequence"]).with(lines)
}

fn chance(sequential: &Sequential, shown: Shown) -> Table {
    let line = |row: &SequentialChance| {
        let role = match row.role {
            Role::Chance => "chance",
            Role::Reference => "reference",
        };
        let names = [row.experiment.clone(), row.name(), row.metric.clone(), format!("{role} {}", row.level)];
        let count = format!("{}/{}", row.successes, row.n);
        let numbers = [count, e_value(row.e), p_value(Some(row.p)), p_value(Some(row.p_adjusted))];
        names.into_iter().chain(numbers).chain([word(row.verdict).to_owned()])
    };
    let lines = sequential.chance.iter().filter(|row| shown(&row.metric)).map(line);
    let numbers = ["count", "e", "p", "p (Holm)", "verdict"];
    Table::plain(&["experiment", "model", "metric", "level"], &numbers).with(lines)
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Above => "above",
        Verdict::Below => "below",
        Verdict::NotSeparated => "not told apart",
    }
}

fn separated(pairs: &[&SequentialPair]) -> Table {
    let told_apart = pairs.iter().filter(|pair| pair.verdict != Verdict::NotSeparated);
    let lines = told_apart.map(|pair| {
        let (mut models, mut only) = ([&pair.first, &pair.second], [pair.pairs.first_only, pair.pairs.second_only]);
        if pair.verdict == Verdict::Below {
            models.reverse();
            only.reverse();
        }
        let [higher, lower] = models.map(Clone::clone);
        let names = [pair.experiment.clone(), pair.metric.clone(), higher, lower];
        let numbers = [e_value(pair.e), p_value(Some(pair.p)), p_value(Some(pair.p_adjusted))];
        names.into_iter().chain([format!("{}:{}", only[0], only[1])]).chain(numbers)
    });
    let numbers = ["only one", "e", "p", "p (Holm)"];
    Table::plain(&["experiment", "metric", "higher", "lower"], &numbers).with(lines)
}

//! Settings that make two sets of episodes incomparable.
//!
//! Rule: a comparison varies one setting, and all others are equal on both sides. Settings that no footer declares
//! cannot be checked; a setting that only some episodes declare is a difference.

use std::collections::BTreeSet;

use mirrorstats_metric::catalogs::catalog::Catalog;
use serde_json::Value;

use mirrorstats_exact::escape::visible;
use mirrorstats_score::tables::table::{Declared, EpisodeTable};

pub const FINGERPRINT: &str = "fingerprint";
/// Digits of a hash in a message.
const SHOWN: usize = 8;
/// World settings that an experiment sets itself.
const OF_EXPERIMENT: [&str; 2] = ["others", "clutter"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Varied {
    /// The model, its sampling and its driver.
    Model,
    /// The condition, which may be any setting.
    Condition,
    /// The experiment: its panes, its prompt and its layout.
    Experiment,
    /// Nothing: the episodes belong to one cell.
    Nothing,
}

impl Varied {
    /// The parts of a fingerprint that must be equal.
    fn kept(self) -> &'static [&'static str] {
        match self {
            Self::Model => &["world", "prompts", "reply_schema", "renderer"],
            Self::Condition => &[],
            Self::Experiment => &["agent", "sampling", "model", "renderer"],
            Self::Nothing => &["world", "prompts", "reply_schema", "agent", "sampling", "model", "renderer"],
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recorded<'a> {
    fingerprints: BTreeSet<&'a str>,
    undeclared: usize,
    episodes: usize,
}

impl<'a> Recorded<'a> {
    pub fn of(table: &'a EpisodeTable, rows: impl Iterator<Item = usize>) -> Self {
        let column = table.label(FINGERPRINT);
        let mut found = Self::default();
        for row in rows {
            found.episodes += 1;
            match column.and_then(|column| column.get(row)) {
                Some(name) => drop(found.fingerprints.insert(name)),
                None => found.undeclared += 1,
            }
        }
        found
    }

    pub const fn is_declared(&self) -> bool {
        self.undeclared == 0
    }
}

/// The setting that makes two sets of episodes incomparable, with the values of both; `None` if none is known.
pub fn difference(declared: &Declared, sides: [&Recorded<'_>; 2], varied: Varied) -> Option<String> {
    let [first, second] = sides;
    if varied == Varied::Condition {
        return None;
    }
    let (undeclared, episodes) = (first.undeclared + second.undeclared, first.episodes + second.episodes);
    if undeclared > 0 && undeclared < episodes {
        return Some(format!("{undeclared} of {episodes} episodes have no fingerprint"));
    }
    if let Some(name) = first.fingerprints.union(&second.fingerprints).find(|name| declared.ambiguous.contains(**name))
    {
        return Some(format!("the fingerprint `{}` stands for different recordings", visible(name)));
    }
    let couples = first.fingerprints.iter().flat_map(|one| second.fingerprints.iter().map(move |other| [*one, *other]));
    couples.filter(|[one, other]| one != other).find_map(|names| between(declared, names, varied))
}

/// The settings that differ between two fingerprints though the comparison does not vary them.
fn between(declared: &Declared, names: [&str; 2], varied: Varied) -> Option<String> {
    let parts = parts(declared, names, varied.kept());
    let recordings = names.map(|name| declared.recordings.get(name));
    let [Some(one), Some(other)] = recordings else { return parts };
    if varied == Varied::Experiment {
        return parts.or_else(|| between_experiments(one, other));
    }
    parts.map(|parts| match settings(one, other, varied) {
        Some(settings) if varied == Varied::Nothing => format!("{parts}; {settings}"),
        Some(settings) => settings,
        None => parts,
    })
}

/// The differing parts of two fingerprints. Ignores a part that one side lacks, such as the prompt of a script.
fn parts(declared: &Declared, names: [&str; 2], kept: &[&str]) -> Option<String> {
    let [one, other] = names.map(|name| declared.fingerprints.get(name));
    let (one, other) = (one?, other?);
    let is_strict = kept.contains(&"model");
    let differs = |key: &&&str| {
        let (one, other) = (&one[**key], &other[**key]);
        one != other && (is_strict || !(one.is_null() || other.is_null()))
    };
    let difference = |key: &&str| match key {
        // The renderer is stored unhashed.
        &"renderer" => first_difference(key, &one[*key], &other[*key]).unwrap_or_default(),
        key => format!("{key} ({}, {})", shown(&one[*key]), shown(&other[*key])),
    };
    let found: Vec<String> = kept.iter().filter(differs).map(difference).collect();
    (!found.is_empty()).then(|| found.join(", "))
}

fn settings(one: &Value, other: &Value, varied: Varied) -> Option<String> {
    let keys = if varied == Varied::Model { &["world", "experiment"][..] } else { &["world", "experiment", "agent"] };
    let found: Vec<String> = keys.iter().filter_map(|key| first_difference(key, &one[*key], &other[*key])).collect();
    (!found.is_empty()).then(|| found.join("; "))
}

fn between_experiments(one: &Value, other: &Value) -> Option<String> {
    let world = |recording: &Value| {
        let mut world = recording["world"].clone();
        if let Some(world) = world.as_object_mut() {
            world.retain(|key, _| !OF_EXPERIMENT.contains(&key.as_str()));
        }
        world
    };
    let prompt = |recording: &Value| recording["experiment"]["prompt"].clone();
    let hash = |recording: &Value| recording["experiment"]["prompt_hash"].clone();
    let of_prompt = || {
        let is_same = !prompt(one).is_null() && prompt(one) == prompt(other);
        is_same.then(|| first_difference("experiment.prompt_hash", &hash(one), &hash(other))).flatten()
    };
    first_difference("world", &world(one), &world(other)).or_else(of_prompt)
}

fn first_difference(name: &str, one: &Value, other: &Value) -> Option<String> {
    if one == other {
        return None;
    }
    if let (Value::Object(a), Value::Object(b)) = (one, other) {
        let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
        let mut inner = keys.map(|key| (key, &one[key], &other[key])).filter(|(_, one, other)| one != other);
        if let Some((key, one, other)) = inner.next() {
            return first_difference(&format!("{name}.{}", visible(key)), one, other);
        }
    }
    Some(format!("{name} is {} and {}", shown(one), shown(other)))
}

fn shown(value: &Value) -> String {
    match value {
        Value::Null => "nothing".to_owned(),
        Value::String(text) if text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit()) => {
            text[..SHOWN].to_owned()
        }
        Value::String(text) => visible(text),
        other => visible(&other.to_string()),
    }
}

/// The reason why two experiments cannot be contrasted, or `None`: tasks must be alike, with equal chance levels.
///
/// An experiment may lack levels of some metrics: shared levels decide, or all levels if none is shared.
pub(crate) fn tasks_differ(catalog: &Catalog, baseline: &str, against: &str) -> Option<String> {
    let levels = |metric: &str| [baseline, against].map(|name| catalog.chance(name, metric));
    let is_shared = |metric: &&String| levels(metric).iter().all(Option::is_some);
    let shares = catalog.metric.keys().any(|metric| is_shared(&metric));
    let differs = |metric: &&String| (!shares || is_shared(metric)) && levels(metric)[0] != levels(metric)[1];
    let metric = catalog.metric.keys().find(differs)?;
    let level = |name: &str| catalog.chance(name, metric).map_or_else(|| "none".to_owned(), |level| level.to_string());
    Some(format!("the chance level of {metric} is {} and {}", level(baseline), level(against)))
}

//! Settings that make two sets of episodes incomparable.
//!
//! Rule: a comparison varies one setting, and all others are equal on both sides. Settings that no footer declares
//! cannot be checked; a setting that only some episodes declare is a difference.

use std::collections::{BTreeMap, BTreeSet};

use mirrorstats_metric::catalogs::catalog::Catalog;
use serde_json::Value;

use mirrorstats_exact::escape::visible;
use mirrorstats_score::tables::table::{Declared, EpisodeTable, LabelColumn};

/// The label of the scene: room, body, cubes, start.
pub(crate) const SCENE: &str = "scene";
pub(crate) const PARTICIPANT: &str = "participant";
pub const FINGERPRINT: &str = "fingerprint";
/// The label of the origin of an episode, where a study has episodes of several origins.
pub const ORIGIN: &str = "origin";
pub const BODY_COLOR: &str = "body_color";
pub const REPETITION: &str = "repetition";
/// The origin of an episode whose file declares none.
const UNDECLARED: &str = "undeclared";
/// The keys of an agent's description that are about its model. All others are about its driver.
const OF_MODEL: [&str; 8] =
    ["model", "id", "temperature", "max_output_tokens", "reasoning_effort", "extra_body", "backend", "contract"];
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
    origins: BTreeSet<&'a str>,
    undeclared: usize,
    episodes: usize,
}

impl<'a> Recorded<'a> {
    pub fn of(table: &'a EpisodeTable, rows: impl Iterator<Item = usize>) -> Self {
        let (column, origins) = (table.label(FINGERPRINT), table.label(ORIGIN));
        let mut found = Self::default();
        for row in rows {
            found.episodes += 1;
            found.origins.extend(origins.map(|origins| origins.get(row).unwrap_or(UNDECLARED)));
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
    let origins: Vec<&str> = first.origins.union(&second.origins).copied().collect();
    if origins.len() > 1 {
        return Some(format!("kind is {}", origins.join(" and ")));
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
    let found = parts(declared, names, varied.kept());
    let recordings = names.map(|name| declared.recordings.get(name));
    let [Some(one), Some(other)] = recordings else { return found };
    if varied == Varied::Experiment {
        // The hash of a world is also of the experiment, unless the footer has the hash alone.
        let is_hashed = [one, other].iter().any(|it| it["world"].is_null());
        let worlds = || is_hashed.then(|| parts(declared, names, &["world"])).flatten();
        return found.or_else(worlds).or_else(|| between_experiments(one, other));
    }
    found.map(|parts| match settings(one, other, varied) {
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

/// The steps of an episode by the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Budget {
    Undeclared,
    /// It depends on the scene or the recording.
    Varying,
    Steps(i64),
}

impl Budget {
    pub fn of(declared: &Declared, side: &Recorded) -> Self {
        let recordings = side.fingerprints.iter().map(|name| declared.recordings.get(*name));
        let mut budgets = recordings.map(|recording| recording.map_or(Self::Undeclared, |it| Self::of_recording(it)));
        let first = budgets.next().filter(|_| side.is_declared()).unwrap_or(Self::Undeclared);
        if budgets.all(|other| other == first) { first } else { Self::Varying }
    }

    fn of_recording(recording: &Value) -> Self {
        let experiment = &recording["experiment"];
        // Tasks with a hand have the steps of their way.
        if !experiment["hand"].is_null() {
            return Self::Varying;
        }
        let steps = experiment["steps"].as_i64().or_else(|| recording["world"]["episode"]["steps"].as_i64());
        steps.map_or(Self::Undeclared, Self::Steps)
    }
}

/// The difference between the drivers of two models: memory, retries, budget.
pub(crate) fn driver(declared: &Declared, sides: [&Recorded<'_>; 2]) -> Option<String> {
    let [first, second] = sides;
    let couples = first.fingerprints.iter().flat_map(|one| second.fingerprints.iter().map(move |other| [*one, *other]));
    couples.filter(|[one, other]| one != other).find_map(|names| {
        let agents = names.map(|name| declared.recordings.get(name).map_or(&Value::Null, |it| &it["agent"]));
        match agents {
            // A script, a program or a person is model and driver in one.
            [Value::Null, Value::Null] if names.iter().any(|name| has_no_model(declared, name)) => None,
            [Value::Null, Value::Null] => parts(declared, names, &["agent"]),
            _ if agents.iter().any(|agent| agent["backend"].is_null()) => None,
            _ => {
                let [one, other] = agents.map(|agent| {
                    let members = agent.as_object().into_iter().flatten();
                    members
                        .filter(|(key, _)| !OF_MODEL.contains(&key.as_str()))
                        .map(|(key, it)| (key.clone(), it.clone()))
                        .collect()
                });
                first_difference("agent", &Value::Object(one), &Value::Object(other))
            }
        }
    })
}

fn has_no_model(declared: &Declared, fingerprint: &str) -> bool {
    let found = declared.fingerprints.get(fingerprint);
    found.is_some_and(|found| found["model"].is_null() && found["sampling"].is_null())
}

/// Gives each scene whose name is used with several body colours a name per colour: a scene fixes the body.
pub fn divide_scenes_by_color(table: &mut EpisodeTable) {
    let Some((scenes, colors)) = table.label(SCENE).zip(table.label(BODY_COLOR)) else { return };
    let mut known: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (scene, color) in scenes.iter().zip(colors.iter()).filter_map(|(scene, color)| scene.zip(color)) {
        known.entry(scene).or_default().insert(color);
    }
    if known.values().all(|colors| colors.len() < 2) {
        return;
    }
    let named = |(scene, color): (Option<&str>, Option<&str>)| {
        let scene = scene?;
        let is_divided = known.get(scene).is_some_and(|colors| colors.len() > 1);
        Some(color.filter(|_| is_divided).map_or_else(|| scene.to_owned(), |color| format!("{scene} ({color})")))
    };
    let divided: Vec<Option<String>> = scenes.iter().zip(colors.iter()).map(named).collect();
    let values = divided.iter().map(Option::as_deref).collect();
    table.labels.retain(|label| label.name != SCENE);
    table.labels.push(LabelColumn { name: SCENE.to_owned(), values });
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
/// Of several blind strategies guessing counts, the lowest: the others use what the contrast is about, such as a false
/// statement. An experiment may lack levels of some metrics: shared levels decide, or all levels if none is shared.
pub(crate) fn tasks_differ(catalog: &Catalog, baseline: &str, against: &str) -> Option<String> {
    let levels =
        |metric: &str| [baseline, against].map(|name| catalog.levels(name, metric).first().map(|(_, level)| *level));
    let is_shared = |metric: &&String| levels(metric).iter().all(Option::is_some);
    let shares = catalog.metric.keys().any(|metric| is_shared(&metric));
    let differs = |metric: &&String| (!shares || is_shared(metric)) && levels(metric)[0] != levels(metric)[1];
    let metric = catalog.metric.keys().find(differs)?;
    let [level, other] = levels(metric).map(|level| level.map_or_else(|| "none".to_owned(), |level| level.to_string()));
    Some(format!("the chance level of {metric} is {level} and {other}"))
}

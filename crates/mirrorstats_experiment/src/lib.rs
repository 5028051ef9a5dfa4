//! Experiments as data: the world, the prompt, and the decision.
//!
//! ```text
//! assets/experiments/*.toml, a lab's own file ──► file (every fault underlined) ──► Spec ──► Experiment
//!                                                   └── prompt (a folder of templates, hashed)
//! ```
//!
//! `table` reads one `[experiment.NAME]` key by key; [`schema`] has the same shape as types, for the JSON Schema;
//! [`explain`] describes a [`Spec`] in words; [`angle`] has the headings of a body.
//!
//! The paper's five experiments are such files. A trace has the whole [`Spec`] in its footer, so replays and reports
//! need no file.
//!
//! ```
//! use mirrorstats_experiment::Experiment;
//!
//! let experiment = Experiment::parse("E1")?;
//! assert!(experiment.asks_for_cube());
//! # Ok::<(), mirrorstats_experiment::UnknownExperiment>(())
//! ```
//!
//! Rule: an experiment draws nothing, renders nothing and knows no agent; `mirrorstats_sim` and `mirrorstats_agents`
//! read it.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod angle;
mod built_in;
pub mod explain;
pub mod file;
pub mod prompt;
pub mod schema;
pub mod spec;
mod table;

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::Deref;
use std::sync::{Arc, LazyLock};

use serde::{Serialize, Serializer};

pub use built_in::{built_in, built_in_names};
use prompt::Templates;
pub use spec::Spec;

/// An experiment: its [`Spec`] and its prompt. A clone shares both.
///
/// Experiments are equal if their [`Spec`]s and places are. The built-in ones are first, in their order, then those of
/// files, by place.
#[derive(Clone)]
pub struct Experiment {
    /// The index in [`BUILT_IN`], or that among those of files.
    place: usize,
    /// `None` for a built-in one.
    own: Option<Arc<Known>>,
}

struct Known {
    spec: Spec,
    /// Its prompt; empty if it comes from a trace's footer, which has only the hash.
    templates: Templates,
}

static BUILT_IN: LazyLock<Vec<Experiment>> = LazyLock::new(built_in::all);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no experiment `{name}`: expected {}, or a file such as mine.toml", built_in_names().join(", "))]
pub struct UnknownExperiment {
    pub name: String,
}

impl Experiment {
    // Literals, since a reference to what a function returns would be to a temporary value.
    /// A mirror and three cubes.
    pub const E1: Self = Self { place: 0, own: None };
    /// As E1 without the mirror.
    pub const E2: Self = Self { place: 1, own: None };
    /// As E1 with a false colour stated.
    pub const E3: Self = Self { place: 2, own: None };
    /// A mirror, three cubes and one to six others.
    pub const E4: Self = Self { place: 3, own: None };
    /// A mirror, one to six others and clutter; no cube to select.
    pub const E5: Self = Self { place: 4, own: None };

    pub const PAPER: [Self; 5] = [Self::E1, Self::E2, Self::E3, Self::E4, Self::E5];

    fn built_in(place: usize) -> Self {
        Self { place, own: None }
    }

    pub fn parse(name: &str) -> Result<Self, UnknownExperiment> {
        let at = built_in_names().iter().position(|known| *known == name);
        at.map(Self::built_in).ok_or_else(|| UnknownExperiment { name: name.to_owned() })
    }

    fn from_file(place: usize, known: Known) -> Self {
        Self { place, own: Some(Arc::new(known)) }
    }

    /// The experiment that a trace's footer declares: the equal built-in one, or one without a prompt.
    pub fn from_footer(spec: Spec) -> Self {
        match BUILT_IN.iter().position(|known| **known == spec) {
            Some(at) => Self::built_in(at),
            None => Self::from_file(0, Known { spec, templates: Templates::default() }),
        }
    }

    /// The same experiment; one of a file gets this place.
    #[must_use]
    pub fn at_place(self, place: usize) -> Self {
        if self.own.is_some() { Self { place, ..self } } else { self }
    }

    fn known(&self) -> &Known {
        match &self.own {
            Some(own) => own,
            None => BUILT_IN[self.place].known(),
        }
    }

    /// The built-in index, or the place after all built-in ones.
    fn place(&self) -> usize {
        if self.own.is_some() { BUILT_IN.len() + self.place } else { self.place }
    }

    pub fn name(&self) -> &str {
        &self.known().spec.name
    }

    pub fn templates(&self) -> &Templates {
        &self.known().templates
    }

    /// A number for an agent's randomness: differs between experiments.
    pub fn number(&self) -> u64 {
        match self {
            Self { own: None, place: place @ 0..5 } => *place as u64 + 1,
            _ => number_of(self.name()) >> 8,
        }
    }
}

fn built_in_specs() -> Vec<&'static Spec> {
    BUILT_IN.iter().map(|known| &**known).collect()
}

/// A number derived from a name: the beginning of its SHA-256.
pub fn number_of(name: &str) -> u64 {
    let hash = mirrorstats_exact::hash::of_bytes(name.as_bytes());
    u64::from_str_radix(&hash[..16], 16).unwrap_or_default()
}

impl Deref for Experiment {
    type Target = Spec;

    fn deref(&self) -> &Spec {
        &self.known().spec
    }
}

impl Ord for Experiment {
    fn cmp(&self, other: &Self) -> Ordering {
        let is_same = std::ptr::eq(self.known(), other.known());
        let text = |one: &Self| serde_json::to_string(&**one).unwrap_or_default();
        let by_text = || if is_same { Ordering::Equal } else { text(self).cmp(&text(other)) };
        self.place().cmp(&other.place()).then_with(by_text)
    }
}

impl PartialOrd for Experiment {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Experiment {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Experiment {}

impl Hash for Experiment {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.place().hash(state);
    }
}

impl fmt::Debug for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Experiment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::spec::{Cubes, Decision, PaneKind, ReplyKey, Stated};
    use super::{Experiment, built_in_names, file};
    use mirrorstats_toml_spec::Source;

    fn faults(text: &str) -> Vec<String> {
        let source = Source { name: "mine.toml".to_owned(), text: text.to_owned() };
        let read = file::read(source, Some(std::path::Path::new(".")), &super::built_in_specs());
        let faults = read.err().map(|faults| faults.0).unwrap_or_default();
        faults.iter().map(|fault| format!("{}:{}", fault.line_and_column().0, fault.message)).collect()
    }

    #[test]
    fn the_papers_five_experiments_come_first_and_match_the_paper() {
        assert_eq!(Experiment::PAPER.each_ref().map(Experiment::name), ["E1", "E2", "E3", "E4", "E5"]);
        assert_eq!(built_in_names()[..5], ["E1", "E2", "E3", "E4", "E5"]);
        let [e1, e2, e3, e4, e5] = Experiment::PAPER;
        assert_eq!([&e1, &e2, &e3].map(|one| one.scenes.clone()), ["E1"; 3]);
        assert_eq!(
            [&e1, &e2, &e3].map(|one| one.layout.clone()),
            [e1.layout.clone(), e1.layout.clone(), e1.layout.clone()]
        );
        assert_eq!([&e1, &e2, &e3, &e4, &e5].map(|one| one.panes.len()), [1, 0, 1, 1, 1]);
        assert!([&e1, &e3, &e4, &e5].iter().all(|one| one.panes[0].kind == PaneKind::Mirror));
        assert_eq!([&e1, &e2, &e3, &e4].map(|one| one.layout.cubes), [Cubes::Candidates { count: 3 }; 4]);
        assert_eq!(
            [&e1, &e2, &e3, &e4, &e5].map(|one| one.stated_color == Stated::Candidate),
            [false, false, true, false, false]
        );
        assert_eq!([&e1, &e5].map(|one| one.decision), [Decision::SelectedCube, Decision::SelfColor]);
        let keys = [ReplyKey::ViewDescription, ReplyKey::Reasoning, ReplyKey::Action, ReplyKey::Summary];
        assert_eq!(e1.reply, [&keys[..], &[ReplyKey::SelectedCube, ReplyKey::Identification]].concat());
        assert_eq!(e5.reply, [&keys[..], &[ReplyKey::Identification]].concat());
    }

    #[test]
    fn the_batterys_definitions_agree_with_its_experiment_files() {
        let all = built_in_names().into_iter().flat_map(Experiment::parse);
        for experiment in all.filter(|experiment| experiment.hand.is_none()) {
            let definitions = experiment.definitions.as_deref().filter(|name| *name != "paper").unwrap_or("battery");
            let document = mirrorstats_metric::file::read(definitions).unwrap();
            let entry = &document.experiments[experiment.name()];
            let defined = &entry.experiment;
            assert_eq!((defined.title.as_str(), entry.order), (experiment.title.as_str(), experiment.order));
            let levels = |metric: &str| {
                let level = defined.chance.get(metric);
                level.map(|level| level.as_ref().map_or_else(|| "none".to_owned(), ToString::to_string))
            };
            assert_eq!(levels("TSA"), experiment.chance.get("TSA").map(ToString::to_string), "{}", experiment.name());
            assert_eq!(defined.chance.len(), experiment.chance.len());
        }
    }

    #[test]
    fn an_experiment_comes_back_from_a_footer() {
        for experiment in built_in_names().into_iter().flat_map(Experiment::parse) {
            let stored = serde_json::to_string(&*experiment).unwrap();
            let spec = serde_json::from_str(&stored).unwrap();
            assert_eq!(Experiment::from_footer(spec), experiment, "{stored}");
        }
    }

    #[test]
    fn every_fault_is_reported_at_once_with_its_line() {
        let text = r#"
[experiment.E1]
title = "Mine"
prompt = "cube-selection"
cubes = { kind = "candidates", count = 30 }

[experiment."a b"]
titel = "Mine"
scenes = "E7"
prompt = "../../etc"
step_length = nan
decision = "mark_report"
stated_color = "candiate"

[[experiment."a b".mirror]]
kind = "delayed"
width = inf

[[experiment."a b".mark]]
part = "hand"
color = "rad"
from_t = 0
on = "other"
"#;
        insta::assert_snapshot!("faults_of_a_file", faults(text).join("\n"));
    }

    #[test]
    fn keys_that_depend_on_each_other_are_checked_together() {
        let head = "[experiment.X]\ntitle = \"X\"\nprompt = \"cube-selection\"\n";
        let of = |rest: &str| faults(&format!("{head}{rest}"));
        insta::assert_snapshot!(
            "faults_of_relations",
            [
                of("decision = \"selected_cube\"\ncubes = { kind = \"none\" }"),
                of("stated_color = \"candidate\"\ncubes = { kind = \"none\" }\ndecision = \"self_color\""),
                of("reply = [\"action\", \"action\", \"tail\"]"),
                of("decision = \"mark_report\"\nreply = [\"action\", \"mark\"]"),
                of("scenes = \"E1\"\ncubes = { kind = \"candidates\", count = 4 }"),
                of("mirror = [{ kind = \"window\", delay = 3 }, { kind = \"decoy\", color = \"own\" }]"),
                of("mirror = [{ wall = \"same\" }, { from_t = 9, until_t = 3 }]"),
                of("mirror = [{}, { wall = \"west\" }]"),
                of("mirror = [{}, {}, {}, {}, {}]"),
                of("mark = [{ part = \"head\", on = \"other\" }]"),
                of("mark = [{ part = \"head\" }, { part = \"head\" }]"),
                of("others = { least = 3, most = 2 }"),
                of("palette = [\"red\", \"red\"]"),
                of("absent = [\"self_colour\", \"selected_cube\", \"t\"]"),
            ]
            .map(|faults| faults.join("; "))
            .join("\n")
        );
    }

    #[test]
    fn a_file_may_hold_several_and_have_scenes_of_its_own() {
        let text = "[experiment.A]\ntitle = \"A\"\nprompt = \"exploration\"\ncubes = { kind = \"none\" }\n\
                    [experiment.B]\ntitle = \"B\"\nprompt = \"exploration\"\nscenes = \"A\"\n\
                    [experiment.C]\ntitle = \"C\"\nprompt = \"exploration\"\nscenes = \"B\"\nmirror = [{ width = 2 }]";
        let source = Source { name: "mine.toml".to_owned(), text: text.to_owned() };
        let entries = file::read(source, Some(std::path::Path::new(".")), &super::built_in_specs()).unwrap();
        let specs: Vec<_> = entries.iter().map(|entry| &entry.experiment).collect();
        assert_eq!(specs.iter().map(|spec| spec.scenes.as_str()).collect::<Vec<_>>(), ["A", "A", "A"]);
        assert!(specs.iter().all(|spec| spec.layout == specs[0].layout && spec.decision == Decision::SelfColor));
        assert_eq!(specs[2].panes[0].width_mm, Some(2000));
    }

    #[test]
    fn a_mirror_with_a_delay_has_the_delayed_kind() {
        let text = "[experiment.A]\ntitle = \"A\"\nprompt = \"cube-selection\"\n\
                    mirror = [{ kind = \"mirror\", delay = 5 }, { delay = 0 }, { kind = \"decoy\", delay = 2 }]";
        let source = Source { name: "mine.toml".to_owned(), text: text.to_owned() };
        let entries = file::read(source, Some(std::path::Path::new(".")), &super::built_in_specs()).unwrap();
        let panes = &entries[0].experiment.panes;
        let kinds: Vec<_> = panes.iter().map(|pane| (pane.kind, pane.delay)).collect();
        assert_eq!(kinds, [(PaneKind::Delayed, 5), (PaneKind::Mirror, 0), (PaneKind::Decoy, 2)]);
    }

    #[test]
    fn a_misspelt_built_in_prompt_is_suggested() {
        let text = "[experiment.E9]\ntitle = \"x\"\nprompt = \"cube-selecton\"\n";
        let source = Source { name: "mine.toml".to_owned(), text: text.to_owned() };
        let faults = file::read(source, Some(std::path::Path::new(".")), &super::built_in_specs()).unwrap_err();
        let help =
            faults.0.iter().find_map(|fault| fault.help.as_deref().filter(|help| help.contains("built in"))).unwrap();
        assert!(help.ends_with("did you mean `cube-selection`?"), "{help}");
    }

    #[test]
    fn an_invalid_answer_is_refused_with_its_location() {
        let head = "[experiment.X]\ntitle = \"X\"\nprompt = \"answers\"\ncubes = { kind = \"none\" }\n";
        let of = |answer: &str| faults(&format!("{head}answer = [{{ words = \"w\", {answer} }}]")).join("; ");
        for (answer, expected) in [
            ("key = \"Side\", type = \"number\", constant = \"1\"", "a key has 1 to 24 lower-case letters"),
            ("key = \"action\", type = \"number\", constant = \"1\"", "a reply already has the key `action`"),
            ("key = \"a\", type = \"number\"", "one of `truth`, `constant` and `conditions`, found 0"),
            ("key = \"a\", type = \"number\", constant = \"one\"", "expected a number, found `one`"),
            (
                "key = \"a\", type = \"number\", truth = \"body_color\"",
                "`body_color` is of type `color`, the answer of type `number`",
            ),
            ("key = \"a\", type = \"yes_no\", options = [\"b\", \"c\"], constant = \"yes\"", "has no options"),
            ("key = \"a\", type = \"one_of\", options = [\"b\"], constant = \"b\"", "has 2 to 12 options, found 1"),
            (
                "key = \"a\", type = \"one_of\", options = [\"b\", \"unknown\"], constant = \"b\"",
                "says that there is no evidence",
            ),
            (
                "key = \"a\", type = \"one_of\", options = [\"b\", \"c\"], truth = \"mirror_place\"",
                "as many options as there are bodies",
            ),
        ] {
            let found = of(answer);
            assert!(found.contains(expected), "{answer}: {found}");
        }
        assert_eq!(of("key = \"a\", type = \"color\", unknown = true, truth = \"mark_color\""), "");
    }
}

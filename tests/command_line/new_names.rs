//! Metrics and experiments under other names: outputs change in the names alone.
//!
//! A new name has the letters of the old one, so texts keep their width. Lists by name keep their order.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::write::OptionalColumns;
use regex::Regex;

use crate::harness::traces::{episode, write_trace};
use crate::{contents, run};

const NAMES: [(&str, &str); 13] = [
    ("TSA-C", "T-SAC"),
    ("AR_SC", "CS_AR"),
    ("TSA", "STA"),
    ("TTD", "DTT"),
    ("MCR", "RMC"),
    ("MTATO", "ATTOM"),
    ("CAAL", "LACA"),
    ("CR", "RC"),
    ("MGD", "GDM"),
    ("SC", "CS"),
    ("E1", "1E"),
    ("E2", "2E"),
    ("E5", "5E"),
];

/// The built-in definitions as one text; `to` renames every metric and experiment.
fn definitions(to: &Renaming) -> String {
    to.all(include_str!("../../assets/definitions/paper.toml"))
}

fn style(to: &Renaming) -> String {
    let figures = include_str!("../../assets/styles/figures.toml").replace("\n[", "\n[figure.");
    to.all(&(include_str!("../../assets/styles/default.toml").to_owned() + &figures))
}

/// Replaces whole words by other words.
struct Renaming {
    words: Regex,
    names: BTreeMap<String, String>,
}

impl Renaming {
    fn new(pairs: impl IntoIterator<Item = (&'static str, &'static str)>) -> Self {
        let mut names = BTreeMap::new();
        for (old, new) in pairs {
            // Plain, and escaped for LaTeX.
            for spelled in [str::to_owned, |name: &str| name.replace('_', "\\_")] {
                names.insert(spelled(old), spelled(new));
            }
        }
        let mut longest: Vec<String> = names.keys().map(|name| regex::escape(name)).collect();
        longest.sort_by_key(|name| std::cmp::Reverse(name.len()));
        Self { words: Regex::new(&format!(r"\b(?:{})\b", longest.join("|"))).unwrap(), names }
    }

    fn all(&self, text: &str) -> String {
        self.words.replace_all(text, |found: &regex::Captures| self.names[&found[0]].clone()).into_owned()
    }

    fn one(&self, name: &str) -> String {
        self.names.get(name).cloned().unwrap_or_else(|| name.to_owned())
    }
}

/// Three models in three experiments; some episodes never end with a decision.
fn episodes(to: &Renaming) -> Vec<Episode> {
    let mut episodes = Vec::new();
    for (at, experiment) in ["E1", "E2", "E5"].into_iter().enumerate() {
        for (skill, model) in ["weak", "strong", "never"].into_iter().enumerate() {
            for run in 1..=14i32 {
                let length = 6 + usize::try_from(run).unwrap() % 7 + 2 * skill;
                let is_decided = model != "never" && run % 5 != 0;
                let knows = model == "strong" || run % 3 == 0;
                let color = |right: bool| Some(if right { "red" } else { "blue" }.to_owned());
                let step = |t: usize| Step {
                    action: Some(if is_decided && t == length { Action::Done } else { Action::TurnLeft }),
                    mirror_visible: experiment != "E2" && t > 3 + at,
                    self_color: (t > 2).then(|| color(knows && t > 4)).flatten(),
                    selected_cube: (is_decided && t == length).then(|| color(knows)).flatten(),
                    ..Step::default()
                };
                let own = episode(&format!("{at}-{model}-{run}"), (1..=length).map(step).collect());
                episodes.push(Episode { experiment: to.one(experiment), model: model.into(), run, ..own });
            }
        }
    }
    episodes
}

/// The output of every command, by command or file, without the hashes of the inputs.
fn outputs(at: &Path, to: &Renaming) -> BTreeMap<String, String> {
    write_trace(&at.join("a.parquet"), &episodes(to), OptionalColumns::NONE);
    fs::write(at.join("mine.toml"), definitions(to)).unwrap();
    fs::write(at.join("look.toml"), style(to)).unwrap();
    let other = definitions(to).replace("visible   = \"mirror_visible\"", "visible   = \"mirror_visible and t > 5\"");
    fs::write(at.join("other.toml"), other).unwrap();
    let metric = to.one("TSA-C");
    let mine = ["--definitions", "mine.toml"];
    let commands: [&[&str]; 9] = [
        &["report", "a.parquet", "--style", "look.toml", "--out", "out"],
        &["stats", "a.parquet", "--full"],
        &["stats", "a.parquet", "--json"],
        &["stats", "a.parquet", "--sequential"],
        &["score", "a.parquet"],
        &["score", "a.parquet", "-o", "scores.csv"],
        &["stats", "scores.csv"],
        #[cfg(feature = "polars")]
        &["query", "SELECT * FROM cells", "a.parquet"],
        #[cfg(not(feature = "polars"))]
        &["score", "a.parquet"],
        &["definitions", "explain", &metric],
    ];
    let mut found = BTreeMap::new();
    for command in commands {
        let answer = run(at, &[command, &mine].concat()).ends(0);
        found.insert(command.join(" ").replace(&metric, "METRIC"), answer.stdout + &answer.stderr);
    }
    found.insert("diff".to_owned(), run(at, &["diff", "mine.toml", "other.toml", "a.parquet", "--json"]).done());
    for (name, bytes) in contents(&at.join("out")) {
        if let Ok(text) = String::from_utf8(bytes) {
            found.insert(name, text);
        }
    }
    let hash = Regex::new("[0-9a-f]{64}|[0-9a-f]{12}|\"bytes\": [0-9]+").unwrap();
    found.into_iter().map(|(name, text)| (name, hash.replace_all(&text, "HASH").into_owned())).collect()
}

/// The page's data from its line; parsed, so that the order of keys does not matter.
fn data_of_page(line: &str) -> Option<serde_json::Value> {
    let json = line.strip_prefix("<script type=\"application/json\" id=\"data\">")?.strip_suffix("</script>")?;
    Some(serde_json::from_str(json).unwrap())
}

#[test]
fn renaming_all_metrics_and_experiments_changes_only_names() {
    let (old, new) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // Points of the scatter have attributes named after metrics.
    let attributes = [("laca", "caal"), ("dtt", "ttd")];
    let back = Renaming::new(NAMES.map(|(old, new)| (new, old)).into_iter().chain(attributes));
    let expected = outputs(old.path(), &Renaming::new(NAMES.map(|(old, _)| (old, old))));
    let found = outputs(new.path(), &Renaming::new(NAMES));
    assert!(expected.keys().eq(found.keys()) && expected.len() > 25, "{:?}", expected.keys());
    for ((name, expected), found) in expected.iter().zip(found.values()) {
        for (line, (expected, found)) in expected.lines().zip(found.lines()).enumerate() {
            let (expected, found) = (back.all(expected), back.all(found));
            let place = format!("{name}, line {}", line + 1);
            match (data_of_page(&expected), data_of_page(&found)) {
                (Some(expected), Some(found)) => assert!(expected == found, "{place}"),
                _ => assert_eq!(found, expected, "{place}"),
            }
        }
        assert_eq!(expected.lines().count(), found.lines().count(), "{name}");
    }
}

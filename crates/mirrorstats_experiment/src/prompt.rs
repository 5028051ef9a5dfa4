//! Prompts as folders of templates.
//!
//! | file | what it says | values |
//! |---|---|---|
//! | `system.txt` | the system prompt | `stated_color`, `reply_keys`, `answers` |
//! | `user.txt` | the user prompt | `history_text`, `position_text`, `bumped`, `warning_if_bumped_wall`, `remaining`, `budget` |
//! | `history.txt` | the step before, or all of them | `first`, `action`, `thought`, `steps` |
//! | `position.txt` | pose and budget | `x`, `y`, `yaw`, `remaining`, `budget` |
//! | `warning.txt` | the last move was stopped | none |
//!
//! `answers` have `key`, `words` and `expected`; `steps`, in order, have `action`, `name`, `bumped` and `thought`.
//!
//! Every folder needs the first two; the other three have shared defaults. The templates of the paper's two prompts are
//! verbatim (appendix, "Prompt Templates"). The three of the dynamic context are ours, since the paper states their
//! content but not their wording.
//!
//! In the paper, the user prompt of E1 to E4 has `<warning_if_bumped_wall>`, that of E5 does not. Ours has it in both,
//! so that one rule names every blocked move; without a bump, the words of E5 are the paper's.

use std::fs;
use std::path::{Component, Path};

use minijinja::Environment;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::hash;
use mirrorstats_exact::input;

const LARGEST: Limit = Limit::new("bytes of a prompt", 256 * 1024);

/// A template: the name of its file without the ending, and its text.
pub type Template = (String, String);

/// The names of the templates, and their permitted values.
const NAMES: [(&str, &[&str]); 5] = [
    ("system", &["stated_color", "reply_keys", "answers"]),
    ("user", &["history_text", "position_text", "bumped", "warning_if_bumped_wall", "remaining", "budget"]),
    ("history", &["first", "action", "thought", "steps"]),
    ("position", &["x", "y", "yaw", "remaining", "budget"]),
    ("warning", &[]),
];

/// The templates that every folder must have; the others have defaults.
const OWN: [&str; 2] = ["system", "user"];

macro_rules! folder {
    ($name:literal: $($template:literal),+) => {
        ($name, &[$(($template, include_str!(concat!("../../../assets/prompts/", $name, "/", $template, ".txt")))),+])
    };
}

/// The built-in folders, with their own templates.
const BUILT_IN: [(&str, &[(&str, &str)]); 13] = [
    folder!("cube-selection": "system", "user"),
    folder!("exploration": "system", "user"),
    folder!("mark": "system", "user"),
    folder!("reach-scheme": "system", "user", "history"),
    folder!("reach-mirror": "system", "user", "history"),
    folder!("reach-hand": "system", "user", "history"),
    folder!("reach-bare": "system", "user", "history"),
    folder!("memory-0": "system", "user", "history"),
    folder!("memory-8": "system", "user", "history"),
    folder!("memory-no-summary": "system", "user", "history"),
    folder!("memory-no-position": "system", "user", "position"),
    folder!("evidence": "system", "user"),
    folder!("answers": "system", "user"),
];

/// The three shared defaults.
const SHARED: [(&str, &str); 3] = [
    ("history", include_str!("../../../assets/prompts/history.txt")),
    ("position", include_str!("../../../assets/prompts/position.txt")),
    ("warning", include_str!("../../../assets/prompts/warning.txt")),
];

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Templates {
    /// `system`, `user`, `history`, `position`, `warning`, in this order; empty if only the hash is known.
    pub all: Vec<Template>,
}

impl Templates {
    /// SHA-256 of names and texts, 64 hexadecimal digits.
    pub fn hash(&self) -> String {
        let text: String = self.all.iter().flat_map(|(name, text)| [name, "\n", text.as_str()]).collect();
        hash::of_bytes(text.as_bytes())
    }

    pub fn built_in(name: &str) -> Option<Self> {
        let (_, own) = BUILT_IN.iter().find(|(known, _)| *known == name)?;
        let own: Vec<Template> = own.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
        Some(Self::of(&own))
    }

    pub fn built_in_names() -> Vec<&'static str> {
        BUILT_IN.iter().map(|(name, _)| *name).collect()
    }

    pub fn read(folder: &Path, name: &str) -> Result<Self, String> {
        let relative = Path::new(name);
        if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
            return Err("the prompt is a folder beside the experiment file or below it, and no other path".to_owned());
        }
        let place = folder.join(relative);
        let unreadable = |path: &Path, error: &std::io::Error| format!("cannot read `{}`: {error}", path.display());
        let real = fs::canonicalize(&place).map_err(|error| unreadable(&place, &error))?;
        let root = fs::canonicalize(folder).map_err(|error| unreadable(folder, &error))?;
        if !real.starts_with(&root) {
            return Err(format!("`{}` is a link that leads out of the folder of the experiment file", place.display()));
        }
        let mut own = Vec::new();
        for (name, _) in NAMES {
            let path = real.join(format!("{name}.txt"));
            let is_needed = OWN.contains(&name);
            if is_needed || path.exists() {
                let is_inside = fs::canonicalize(&path).map_err(|error| unreadable(&path, &error))?.starts_with(&root);
                if !is_inside {
                    return Err(format!("`{}` is a link that leads out of the folder", path.display()));
                }
                own.push((name.to_owned(), input::text(&path, LARGEST).map_err(|error| unreadable(&path, &error))?));
            }
        }
        let templates = Self::of(&own);
        templates.check()?;
        Ok(templates)
    }

    fn of(own: &[Template]) -> Self {
        let shared = |name: &str| SHARED.iter().find(|(known, _)| *known == name).map(|(_, text)| (*text).to_owned());
        let text = |name: &str| own.iter().find(|(known, _)| known == name).map(|(_, text)| text.clone());
        let all = NAMES.iter().filter_map(|(name, _)| Some(((*name).to_owned(), text(name).or_else(|| shared(name))?)));
        Self { all: all.collect() }
    }

    fn check(&self) -> Result<(), String> {
        for ((name, text), (_, values)) in self.all.iter().zip(NAMES) {
            let mut environment = Environment::new();
            environment
                .add_template(name, text)
                .map_err(|error| format!("the template {name}.txt does not parse: {error}"))?;
            let used = environment.get_template(name).map_err(|error| error.to_string())?.undeclared_variables(false);
            let mut unknown: Vec<&String> = used.iter().filter(|value| !values.contains(&value.as_str())).collect();
            unknown.sort();
            if let Some(value) = unknown.first() {
                let known = if values.is_empty() { "nothing".to_owned() } else { values.join(", ") };
                return Err(format!("the template {name}.txt uses `{value}`; it is given {known}"));
            }
        }
        Ok(())
    }
}

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

/// The names of the templates, their permitted values, and their shared defaults.
const TEMPLATES: [(&str, &[&str], Option<&str>); 5] = [
    ("system", &["stated_color", "reply_keys", "answers"], None),
    ("user", &["history_text", "position_text", "bumped", "warning_if_bumped_wall", "remaining", "budget"], None),
    ("history", &["first", "action", "thought", "steps"], Some(include_str!("../../../assets/prompts/history.txt"))),
    ("position", &["x", "y", "yaw", "remaining", "budget"], Some(include_str!("../../../assets/prompts/position.txt"))),
    ("warning", &[], Some(include_str!("../../../assets/prompts/warning.txt"))),
];

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

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Templates {
    /// Names and texts: `system`, `user`, `history`, `position`, `warning`, in this order; empty if only the hash is known.
    pub all: Vec<(String, String)>,
}

impl Templates {
    /// SHA-256 of names and texts, 64 hexadecimal digits.
    pub fn hash(&self) -> String {
        let text: String = self.all.iter().flat_map(|(name, text)| [name, "\n", text.as_str()]).collect();
        hash::of_bytes(text.as_bytes())
    }

    pub fn built_in(name: &str) -> Option<Self> {
        let (_, own) = BUILT_IN.iter().find(|(known, _)| *known == name)?;
        let text = |name: &str| own.iter().find(|(known, _)| *known == name).map(|(_, text)| *text);
        let all = TEMPLATES.into_iter().filter_map(|(name, _, default)| Some((name, text(name).or(default)?)));
        Some(Self { all: all.map(|(name, text)| (name.to_owned(), text.to_owned())).collect() })
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
        let mut all = Vec::new();
        for (name, _, default) in TEMPLATES {
            let path = real.join(format!("{name}.txt"));
            if let Some(default) = default.filter(|_| !path.exists()) {
                all.push((name.to_owned(), default.to_owned()));
                continue;
            }
            let is_inside = fs::canonicalize(&path).map_err(|error| unreadable(&path, &error))?.starts_with(&root);
            if !is_inside {
                return Err(format!("`{}` is a link that leads out of the folder", path.display()));
            }
            all.push((name.to_owned(), input::text(&path, LARGEST).map_err(|error| unreadable(&path, &error))?));
        }
        let templates = Self { all };
        templates.check()?;
        Ok(templates)
    }

    fn check(&self) -> Result<(), String> {
        let environment = Environment::new();
        for ((name, text), (_, values, _)) in self.all.iter().zip(TEMPLATES) {
            let template = environment.template_from_named_str(name, text);
            let template = template.map_err(|error| format!("the template {name}.txt does not parse: {error}"))?;
            let used = template.undeclared_variables(false);
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

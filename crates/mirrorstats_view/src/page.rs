//! The page: one document, its style sheet, and its script as modules.
//!
//! Rule: imports are whole lines at the top of a module, and `export` is a word before a declaration. Without these,
//! all modules together are one classic script, since browsers load no modules from a local folder.

use mirrorstats_report::html;

const BODY: &str = include_str!("../../../assets/view/body.html");

/// The style of the application; the style of reports precedes it.
const STYLE: &str = include_str!("../../../assets/view/view.css");

macro_rules! modules {
    ($($name:literal)*) => { [$(($name, include_str!(concat!("../../../assets/view/", $name)))),*] };
}

/// The modules in order of dependency.
const MODULES: [(&str, &str); 15] = modules![
    "dom.js" "where.js" "data.js" "state.js" "filters.js" "overview.js" "labels.js" "list.js"
    "values.js" "map.js" "timeline.js" "episode.js" "compare.js" "live.js" "main.js"
];

pub(super) fn file(name: &str) -> Option<(String, &'static str)> {
    match name {
        "" => Some((document("<script type=\"module\" src=\"assets/main.js\"></script>"), "text/html; charset=utf-8")),
        "assets/view.css" => Some((style(), "text/css; charset=utf-8")),
        _ => {
            let name = name.strip_prefix("assets/")?;
            let (_, text) = MODULES.iter().find(|(known, _)| *known == name)?;
            Some(((*text).to_owned(), "text/javascript; charset=utf-8"))
        }
    }
}

pub(super) fn document(script: &str) -> String {
    mirrorstats_web::page("mirrorstats view", "assets/view.css", &BODY.replace("<!-- script -->", script))
}

pub(super) fn style() -> String {
    format!("{}\n{STYLE}", html::style_sheet())
}

pub(super) fn classic() -> String {
    let bodies = MODULES.iter().map(|(_, text)| {
        let lines = text.lines().filter(|line| !line.starts_with("import "));
        lines
            .map(|line| line.strip_prefix("export ").unwrap_or(line))
            .fold(String::new(), |all, line| all + line + "\n")
    });
    format!("(() => {{\n\"use strict\";\n{}}})();\n", bodies.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::{MODULES, classic};

    #[test]
    fn a_module_imports_only_from_those_before_it() {
        for (at, (name, text)) in MODULES.iter().enumerate() {
            for line in text.lines().filter(|line| line.starts_with("import ")) {
                let from = line.rsplit_once("\"./").and_then(|(_, rest)| rest.strip_suffix("\";")).unwrap();
                assert!(MODULES[..at].iter().any(|(known, _)| *known == from), "{name} imports {from}");
            }
            assert!(
                !text.contains("innerHTML ="),
                "{name}: text becomes elements by the program's own templates alone"
            );
        }
    }

    #[test]
    fn top_level_names_are_unique_across_modules() {
        let mut names = std::collections::BTreeSet::new();
        for line in classic().lines() {
            let words: Vec<&str> = line.trim_end().split([' ', '(', '=']).filter(|word| *word != "async").collect();
            if let ["function" | "const" | "let" | "class", name, ..] = words[..] {
                assert!(name.starts_with(['[', '{']) || names.insert(name.to_owned()), "{name}");
            }
        }
        assert!(names.len() > 50);
    }

    #[test]
    fn the_classic_script_has_no_imports_or_exports() {
        assert!(!classic().lines().any(|line| line.starts_with("import ") || line.starts_with("export ")));
    }
}

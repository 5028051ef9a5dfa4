//! Names of commands before they were grouped by noun. They still work until the next release, but no help shows them.

use std::ffi::OsString;

/// Nouns, and the verbs that were commands of their own.
const MOVED: [(&str, &[&str]); 5] = [
    ("definitions", &["sensitivity", "sql"]),
    ("setup", &["completions", "config", "man"]),
    ("table", &["audit", "compare", "rescore", "verify"]),
    ("trace", &["check", "info", "recover", "renormalize", "schema", "validate"]),
    ("world", &["filmstrip", "replay"]),
];

fn noun_of(verb: &str) -> Option<&'static str> {
    MOVED.iter().find(|(_, verbs)| verbs.contains(&verb)).map(|(noun, _)| *noun)
}

pub fn current(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let words = arguments.iter().skip(1).map(|word| word.to_str().unwrap_or_default());
    let (mut at, mut is_value) = (1, false);
    for word in words {
        // `--errors json` may come first, and `help` is followed by the name of a command.
        if !is_value && !word.starts_with('-') && word != "help" {
            break;
        }
        is_value = word == "--errors";
        at += 1;
    }
    if let Some(noun) = arguments.get(at).and_then(|word| noun_of(word.to_str()?)) {
        arguments.insert(at, noun.into());
    }
    arguments
}

/// The current name of a command, for a section of a configuration file.
pub fn current_section(name: &str) -> String {
    noun_of(name).map_or_else(|| name.to_owned(), |noun| format!("{noun} {name}"))
}

/// The name that a command had before.
pub fn before(name: &str) -> Option<&str> {
    let (noun, verb) = name.split_once(' ')?;
    (noun_of(verb) == Some(noun)).then_some(verb)
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use super::{MOVED, current};
    use crate::cli::Cli;
    use clap::CommandFactory as _;

    fn shown(line: &str) -> String {
        let words = current(line.split(' ').map(OsString::from).collect());
        words.iter().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn old_command_names_are_replaced_in_messages() {
        assert_eq!(shown("mirrorstats check runs"), "mirrorstats trace check runs");
        assert_eq!(shown("mirrorstats --errors json check runs"), "mirrorstats --errors json trace check runs");
        assert_eq!(shown("mirrorstats help check"), "mirrorstats help trace check");
        for line in ["mirrorstats", "mirrorstats score check", "mirrorstats style check", "mirrorstats --help"] {
            assert_eq!(shown(line), line);
        }
    }

    #[test]
    fn each_old_name_leads_to_a_command() {
        let command = Cli::command();
        for (noun, old) in MOVED.iter().flat_map(|(noun, verbs)| verbs.iter().map(move |verb| (noun, verb))) {
            let is_built = command.find_subcommand(noun).is_some_and(|noun| noun.find_subcommand(old).is_some());
            assert!(is_built || cfg!(not(all(feature = "sim", feature = "view"))), "{old}");
            assert!(command.find_subcommand(old).is_none(), "{old} has two meanings");
        }
    }
}

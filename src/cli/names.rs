//! Names of commands before they were grouped by noun. They still work until the next release, but no help shows them.

use std::ffi::OsString;

/// The old names and their replacements.
const RENAMED: [(&str, [&str; 2]); 17] = [
    ("audit", ["table", "audit"]),
    ("check", ["trace", "check"]),
    ("compare", ["table", "compare"]),
    ("completions", ["setup", "completions"]),
    ("config", ["setup", "config"]),
    ("filmstrip", ["world", "filmstrip"]),
    ("info", ["trace", "info"]),
    ("man", ["setup", "man"]),
    ("recover", ["trace", "recover"]),
    ("renormalize", ["trace", "renormalize"]),
    ("replay", ["world", "replay"]),
    ("rescore", ["table", "rescore"]),
    ("schema", ["trace", "schema"]),
    ("sensitivity", ["definitions", "sensitivity"]),
    ("sql", ["definitions", "sql"]),
    ("validate", ["trace", "validate"]),
    ("verify", ["table", "verify"]),
];

fn renamed(name: &str) -> Option<[&'static str; 2]> {
    RENAMED.iter().find(|(old, _)| *old == name).map(|(_, new)| *new)
}

/// Replaces an old command name in a command line.
pub fn current(arguments: Vec<OsString>) -> Vec<OsString> {
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
    let Some(new) = arguments.get(at).and_then(|word| renamed(word.to_str()?)) else { return arguments };
    let (before, rest) = arguments.split_at(at);
    before.iter().cloned().chain(new.map(OsString::from)).chain(rest[1..].iter().cloned()).collect()
}

/// The current name of a command, for a section of a configuration file.
pub fn current_section(name: &str) -> String {
    renamed(name).map_or_else(|| name.to_owned(), |new| new.join(" "))
}

/// The old name of a command.
pub fn before(name: &str) -> Option<&'static str> {
    RENAMED.iter().find(|(_, new)| new.join(" ") == name).map(|(old, _)| *old)
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use super::{RENAMED, current};
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
        for (old, [noun, verb]) in RENAMED {
            let is_built = command.find_subcommand(noun).is_some_and(|noun| noun.find_subcommand(verb).is_some());
            assert!(is_built || cfg!(not(all(feature = "sim", feature = "view"))), "{old}");
            assert!(command.find_subcommand(old).is_none(), "{old} has two meanings");
        }
    }
}

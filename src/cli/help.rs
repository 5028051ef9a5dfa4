//! The parts of `--help` besides the options: groups of commands, and examples.
//!
//! Rule: every command has an example that runs as written, apart from file names; the first page fits a small screen.

use clap::Command;
use clap::builder::styling::Style;

/// The examples of each command: its name, then each purpose and command line as the help shows them.
const EXAMPLES: &str = include_str!("../../assets/help/examples.txt");

/// Adds a first page of one screen, and examples.
pub fn with_help(command: Command) -> Command {
    let template = format!(
        "{{about-with-newline}}{{usage-heading}} {{usage}}\n{}{}",
        first_page(&command),
        "Options: --errors text|json, --help, --version; `help COMMAND` for the rest\n"
    );
    with_examples_alone(command.help_template(template))
}

pub fn with_examples_alone(command: Command) -> Command {
    let command = examples().fold(command, |command, (path, lines)| {
        let names: Vec<&str> = path.split(' ').collect();
        with_examples(command, &names, &lines)
    });
    let is_noun = |inner: &&Command| inner.has_subcommands();
    let nouns: Vec<String> = command.get_subcommands().filter(is_noun).map(|noun| noun.get_name().to_owned()).collect();
    nouns.iter().fold(command, |command, noun| {
        let of_noun = examples().filter(|(path, _)| path.split(' ').next() == Some(noun));
        let first: Vec<&str> = of_noun.flat_map(|(_, lines)| lines.into_iter().take(2)).collect();
        with_examples(command, &[noun], &first)
    })
}

fn examples() -> impl Iterator<Item = (&'static str, Vec<&'static str>)> {
    EXAMPLES.split("\n\n").filter_map(|of_command| {
        let mut lines = of_command.lines();
        Some((lines.next()?, lines.collect()))
    })
}

fn with_examples(command: Command, path: &[&str], lines: &[&str]) -> Command {
    match path {
        [] => command.after_help(title() + &lines.join("\n") + "\n"),
        [name, rest @ ..] if command.find_subcommand(name).is_some() => {
            command.mut_subcommand(name, |inner| with_examples(inner, rest, lines))
        }
        // The command belongs to a feature that this build lacks.
        _ => command,
    }
}

fn first_page(command: &Command) -> String {
    let line = |inner: &Command| {
        let about = inner.get_about().map(ToString::to_string).unwrap_or_default();
        format!("  {:<14}{}\n", inner.get_name(), about.split(": ").next().unwrap_or_default())
    };
    let (nouns, verbs): (Vec<_>, Vec<_>) = command.get_subcommands().partition(|inner| inner.has_subcommands());
    let [verbs, nouns] = [verbs, nouns].map(|all| all.into_iter().map(line).collect::<String>());
    format!("{verbs}{nouns}")
}

fn title() -> String {
    let style = Style::new().bold().underline();
    format!("{style}Examples:{style:#}\n")
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory as _, Parser as _};

    use super::{examples, with_help};
    use crate::cli::Cli;

    fn all(command: &Command, before: &str) -> Vec<String> {
        let inner = command.get_subcommands().filter(|inner| !inner.is_hide_set());
        inner
            .flat_map(|inner| {
                let name = format!("{before} {}", inner.get_name()).trim().to_owned();
                if inner.has_subcommands() { all(inner, &name) } else { vec![name] }
            })
            .collect()
    }

    #[test]
    fn the_first_page_fits_24_lines_of_80_columns() {
        let page = with_help(Cli::command()).render_help().to_string();
        assert!(page.lines().count() <= 24, "{page}");
        assert!(page.lines().all(|line| line.chars().count() <= 80), "{page}");
    }

    #[test]
    fn every_command_has_examples_that_are_parsed() {
        for command in all(&Cli::command(), "") {
            let of_command = examples().filter(|(name, _)| *name == command);
            assert_eq!(of_command.count(), 1, "{command}");
        }
        for (name, lines) in examples() {
            for typed in lines.iter().filter_map(|line| line.strip_prefix("    mirrorstats ")) {
                let typed = typed.split(" > ").next().unwrap();
                let words = words(typed);
                let is_noun = |name: &String| Cli::command().find_subcommand(name).is_some();
                if !words.first().is_some_and(is_noun) && cfg!(not(feature = "sim")) {
                    continue;
                }
                let arguments = std::iter::once("mirrorstats".to_owned()).chain(words);
                if let Err(error) = Cli::try_parse_from(arguments) {
                    panic!("{name}: {typed}\n{error}");
                }
            }
        }
    }

    fn words(line: &str) -> Vec<String> {
        let (mut words, mut quote) = (vec![String::new()], None);
        for c in line.chars() {
            match quote {
                Some(open) if c == open => quote = None,
                None if c == '"' || c == '\'' => quote = Some(c),
                None if c == ' ' => words.push(String::new()),
                _ => words.last_mut().unwrap().push(c),
            }
        }
        words
    }
}

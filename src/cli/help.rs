//! What `--help` says beside the options: the commands in groups, and examples of each.
//!
//! Rule: every command stands in one group and has an example that runs as it is written, names of files apart.

use clap::Command;
use clap::builder::styling::Style;

use crate::cli::terminal;
use report::tables::wrapped;

/// The commands by what they are for, in the order of a first use.
const GROUPS: &[(&str, &[&str])] = &[
    ("Record", &["record", "replay", "filmstrip", "participants", "world", "experiments", "plan"]),
    (
        "Score and report",
        &["report", "view", "score", "stats", "figure", "rescore", "diff", "sensitivity", "compare", "audit", "verify"],
    ),
    ("Traces", &["info", "validate", "check", "import", "recover", "renormalize", "schema"]),
    ("Definitions and queries", &["definitions", "style", "query", "sql"]),
    ("This program", &["config", "completions", "man", "help"]),
];

/// The examples of each command: what it is typed for, and what is typed.
const EXAMPLES: &[(&str, &[(&str, &str)])] = &[
    ("audit", &[("Which cells of a published table no 21 episodes can give", "audit table.csv --n 21")]),
    ("check", &[("Fail where more than a twentieth of the replies is unreadable", "check runs --max-unreadable 0.05")]),
    ("compare", &[("Against a published table, cell by cell", "compare runs --published table.csv")]),
    (
        "completions",
        &[(
            "For bash, from the next shell on",
            "completions bash > ~/.local/share/bash-completion/completions/mirrorstats",
        )],
    ),
    ("config", &[("What holds here, and where it comes from", "config")]),
    ("definitions check", &[("Every fault of a file, underlined", "definitions check mine.toml")]),
    ("definitions explain", &[("A metric in words", "definitions explain MTATO")]),
    ("definitions show", &[("A file to begin with", "definitions show paper > mine.toml")]),
    (
        "diff",
        &[
            ("What another definition changes", "diff paper mine.toml runs"),
            ("Two files of scores", "diff old.parquet new.parquet"),
        ],
    ),
    ("experiments check", &[("Every fault of a file, underlined", "experiments check mine.toml")]),
    ("experiments explain", &[("What it shows, asks and decides", "experiments explain E3")]),
    ("experiments show", &[("A file to begin with", "experiments show E1 > mine.toml")]),
    (
        "figure",
        &[
            ("Intervals of a metric", "figure intervals runs -o tsa.svg"),
            (
                "As a picture, of two experiments",
                "figure spider runs --where \"experiment in ('E1', 'E3')\" -o spider.png",
            ),
        ],
    ),
    ("filmstrip", &[("Every frame of an episode in a row", "filmstrip E1/oracle/s1/r1 runs -o strip.png")]),
    (
        "import",
        &[
            ("Steps of another harness, a line of JSON each", "import steps.jsonl -o mine.parquet"),
            ("What a line may hold", "schema step"),
        ],
    ),
    (
        "info",
        &[("What is there, and what is missing", "info runs"), ("Every episode by its id", "info runs --episodes")],
    ),
    ("man", &[("Manual pages, a file per command", "man ~/.local/share/man/man1")]),
    ("participants remove", &[("Out of traces, logs and journals", "participants remove P01 runs")]),
    (
        "plan",
        &[
            ("Episodes that show a difference of 0.3", "plan --difference 0.3"),
            ("What 21 episodes can show", "plan --runs 7"),
            ("A plan to hold a study against", "plan --difference 0.3 --models 2 --register plan.json"),
        ],
    ),
    (
        "query",
        &[(
            "Any SELECT over steps, episodes and cells",
            "query \"SELECT model, COUNT(*) AS steps FROM steps GROUP BY model\" runs",
        )],
    ),
    (
        "record",
        &[
            ("A scripted agent in one experiment", "record --agent oracle --experiment E1 --out runs"),
            (
                "A model behind an API; OPENAI_API_KEY holds the key",
                "record --agent vlm --model gpt-5.1 --experiment E1..E5 --seeds 3 --runs 7 --out runs",
            ),
            ("What it will cost, without a request", "record --agent vlm --model gpt-5.1 --dry-run"),
            ("Your own program", "record --agent exec:'python3 agent.py' --model mine --experiment E1 --out runs"),
            (
                "Two people, each in a browser",
                "record --agent human --model people --participants P01,P02 --consent words.txt",
            ),
        ],
    ),
    ("recover", &[("A trace out of a log that was cut off", "recover runs/E1-oracle.mcap -o E1-oracle.parquet")]),
    ("renormalize", &[("Attributions again from the texts of old replies", "renormalize runs -o anew")]),
    ("replay", &[("The same episodes again, step by step", "replay runs")]),
    (
        "report",
        &[
            ("Tables here, and all in reports/latest", "report runs"),
            ("In the paper's layout, to a folder", "report runs --style paper --out reports/mine"),
            ("Some episodes, in other groups", "report runs --by model,seed --where \"experiment <> 'E2'\""),
        ],
    ),
    ("rescore", &[("A report again under another definition", "rescore reports/mine --definitions mine.toml")]),
    ("schema", &[("What a trace is", "schema"), ("The JSON Schema of a step", "schema step")]),
    (
        "score",
        &[
            ("A row per episode", "score runs -o scores.parquet"),
            ("Why an episode has its scores", "score runs --explain E1/oracle/s1/r1"),
        ],
    ),
    ("sensitivity", &[("Every cell under six thresholds", "sensitivity runs --out thresholds")]),
    ("sql", &[("The scores as a statement for DuckDB", "sql --dialect duckdb > scores.sql")]),
    (
        "stats",
        &[("What the data can bear", "stats runs"), ("At every look, while the study runs", "stats runs --sequential")],
    ),
    ("style check", &[("Every fault of a file, underlined", "style check mine.toml")]),
    ("style show", &[("A file to begin with", "style show paper > mine.toml")]),
    ("validate", &[("Every rule, every finding", "validate runs")]),
    ("verify", &[("Whether a report is as it was written", "verify reports/latest")]),
    (
        "view",
        &[
            ("The report, and every episode step by step", "view runs"),
            ("What another definition changes", "view runs --against mine.toml"),
            ("A copy for any web server, or from the disk", "view runs --export page"),
        ],
    ),
    ("world config", &[("A configuration to begin with", "world config > world.toml")]),
    ("world scene", &[("Where everything stands", "world scene E1")]),
    ("world sheet", &[("Pictures of the first scenes", "world sheet --out sheet.png")]),
];

/// The same command with its help in groups and with examples.
pub fn with_help(command: Command) -> Command {
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{}\n{}{{options}}",
        groups(&command),
        title("Options:")
    );
    with_examples_alone(command.help_template(template))
}

/// The same command with examples.
pub fn with_examples_alone(command: Command) -> Command {
    EXAMPLES.iter().fold(command, |command, (path, examples)| {
        let names: Vec<&str> = path.split(' ').collect();
        with_examples(command, &names, &shown(examples))
    })
}

fn with_examples(command: Command, path: &[&str], text: &str) -> Command {
    match path {
        [] => command.after_help(text.to_owned()),
        [name, rest @ ..] if command.find_subcommand(name).is_some() => {
            command.mut_subcommand(name, |inner| with_examples(inner, rest, text))
        }
        // A command that this build has not.
        _ => command,
    }
}

fn shown(examples: &[(&str, &str)]) -> String {
    let lines = examples.iter().map(|(what, typed)| format!("  {what}:\n    mirrorstats {typed}\n"));
    title("Examples:") + &lines.collect::<String>()
}

/// Every group with its commands, each with the first sentence of what it does.
fn groups(command: &Command) -> String {
    let all: Vec<(String, String)> = command
        .get_subcommands()
        .filter(|inner| !inner.is_hide_set())
        .map(|inner| (inner.get_name().to_owned(), inner.get_about().map(ToString::to_string).unwrap_or_default()))
        .chain([("help".to_owned(), "Print this message or the help of a command".to_owned())])
        .collect();
    let widest = all.iter().map(|(name, _)| name.len()).max().unwrap_or_default();
    let width = terminal::width().unwrap_or(100).min(100).max(widest + 24);
    let mut text = String::new();
    for (group, names) in GROUPS {
        let listed: Vec<&(String, String)> =
            names.iter().filter_map(|name| all.iter().find(|(known, _)| known == name)).collect();
        if listed.is_empty() {
            continue;
        }
        text += "\n";
        text += &title(&format!("{group}:"));
        for (name, about) in listed {
            let line = format!("  {name:widest$}  {about}");
            text += &(wrapped(&line, width, widest + 4).join("\n") + "\n");
        }
    }
    text
}

fn title(words: &str) -> String {
    let style = Style::new().bold().underline();
    format!("{style}{words}{style:#}\n")
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory as _, Parser as _};

    use super::{EXAMPLES, GROUPS};
    use crate::cli::Cli;

    /// Every command that does something, as it is typed.
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
    fn every_command_stands_in_one_group() {
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        grouped.retain(|name| *name != "help");
        grouped.sort_unstable();
        let command = Cli::command();
        let mut known: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        known.sort_unstable();
        // A build with fewer features has fewer commands.
        grouped.retain(|name| cfg!(feature = "sim") || known.contains(name));
        assert_eq!(grouped, known);
    }

    #[test]
    fn every_command_has_examples_that_are_parsed() {
        for command in all(&Cli::command(), "") {
            let of_command = EXAMPLES.iter().filter(|(name, _)| *name == command);
            assert_eq!(of_command.count(), 1, "{command}");
        }
        for (name, examples) in EXAMPLES {
            for (_, typed) in *examples {
                let typed = typed.split(" > ").next().unwrap();
                let words = words(typed);
                let first = words.first().map(String::as_str).unwrap_or_default();
                if Cli::command().find_subcommand(first).is_none() && cfg!(not(feature = "sim")) {
                    continue;
                }
                let arguments = std::iter::once("mirrorstats".to_owned()).chain(words);
                if let Err(error) = Cli::try_parse_from(arguments) {
                    panic!("{name}: {typed}\n{error}");
                }
            }
        }
    }

    /// The words of a line: by spaces, quoted ones whole.
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

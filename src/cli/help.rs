//! The parts of `--help` besides the options: groups of commands, and examples.
//!
//! Rule: every command has an example that runs as written, apart from file names; the first page fits a small screen.

use clap::Command;
use clap::builder::styling::Style;

/// The examples of each command: the purpose, and the command line.
const EXAMPLES: &[(&str, &[(&str, &str)])] = &[
    ("table audit", &[("Which cells of a published table no 21 episodes can give", "table audit table.csv --n 21")]),
    (
        "trace check",
        &[("Fail where more than a twentieth of the replies is unreadable", "trace check runs --max-unreadable 0.05")],
    ),
    ("table compare", &[("Against a published table, cell by cell", "table compare runs --published table.csv")]),
    (
        "setup completions",
        &[(
            "For bash, from the next shell on",
            "setup completions bash > ~/.local/share/bash-completion/completions/mirrorstats",
        )],
    ),
    ("setup config", &[("What holds here, and where it comes from", "setup config")]),
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
            (
                "Intervals of a metric, for a column of 8.5 cm",
                "figure intervals runs --metric TSA --width 8.5cm -o tsa.svg",
            ),
            (
                "As a picture, of two experiments",
                "figure spider runs --where \"experiment in ('E1', 'E3')\" -o spider.png",
            ),
        ],
    ),
    ("world filmstrip", &[("Every frame of an episode in a row", "world filmstrip E1/oracle/s1/r1 runs -o strip.png")]),
    (
        "gate",
        &[
            ("Whether a new version is worse", "gate old new --margin 0.1"),
            ("In a workflow of GitHub Actions", "gate old new --format github"),
        ],
    ),
    (
        "import",
        &[
            ("Steps of another harness, a line of JSON each", "import steps.jsonl -o mine.parquet"),
            ("A log of Inspect", "import log.eval -o tools.parquet --definitions tools.toml"),
            ("What a line may hold", "trace schema step"),
        ],
    ),
    (
        "trace info",
        &[
            ("What is there, and what is missing", "trace info runs"),
            ("Every episode by its id", "trace info runs --episodes"),
        ],
    ),
    ("trace labels", &[("How far two coders agree on each label", "trace labels runs")]),
    ("setup man", &[("Manual pages, a file per command", "setup man ~/.local/share/man/man1")]),
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
            ("What a model takes, by one request", "record --agent vlm --model gpt-5.1 --probe"),
            ("Models, experiments and budgets of a file", "record study.toml"),
            ("Your own program", "record --agent exec:'python3 agent.py' --model mine --experiment E1 --out runs"),
            (
                "Two people, each in a browser",
                "record --agent human --model people --participants P01,P02 --consent words.txt",
            ),
        ],
    ),
    (
        "trace recover",
        &[("A trace out of a log that was cut off", "trace recover runs/E1-oracle.mcap -o E1-oracle.parquet")],
    ),
    ("trace renormalize", &[("Attributions again from the texts of old replies", "trace renormalize runs -o anew")]),
    ("trace seal", &[("A trace of pyarrow, protected from now on", "trace seal theirs.parquet sealed.parquet")]),
    ("world replay", &[("The same episodes again, step by step", "world replay runs")]),
    (
        "report",
        &[
            ("Tables here, and all in reports/latest", "report runs"),
            ("In the paper's layout, to a folder", "report runs --style paper --out reports/mine"),
            ("Some episodes, in other groups", "report runs --by model,seed --where \"experiment <> 'E2'\""),
        ],
    ),
    (
        "table rescore",
        &[("A report again under another definition", "table rescore reports/mine --definitions mine.toml")],
    ),
    ("trace schema", &[("What a trace is", "trace schema"), ("The JSON Schema of a step", "trace schema step")]),
    (
        "score",
        &[
            ("A row per episode", "score runs -o scores.parquet"),
            ("Why an episode has its scores", "score runs --explain E1/oracle/s1/r1"),
        ],
    ),
    (
        "definitions sensitivity",
        &[("Every cell under six thresholds", "definitions sensitivity runs --out thresholds")],
    ),
    ("definitions sql", &[("The scores as a statement for DuckDB", "definitions sql --dialect duckdb > scores.sql")]),
    (
        "stats",
        &[("What the data can bear", "stats runs"), ("At every look, while the study runs", "stats runs --sequential")],
    ),
    ("style check", &[("Every fault of a file, underlined", "style check mine.toml")]),
    ("style show", &[("A file to begin with", "style show paper > mine.toml")]),
    ("trace validate", &[("Every rule, every finding", "trace validate runs")]),
    ("table verify", &[("Whether a report is as it was written", "table verify reports/latest")]),
    (
        "view",
        &[
            ("The report, and every episode step by step", "view runs"),
            ("What another definition changes", "view runs --against mine.toml"),
            ("A copy for any web server, or from the disk", "view runs --export page"),
            ("Label episodes as Ann", "view runs --label ann"),
        ],
    ),
    ("world config", &[("A configuration to begin with", "world config > world.toml")]),
    ("world scene", &[("Where everything stands", "world scene E1")]),
    ("world sheet", &[("Pictures of the first scenes", "world sheet --out sheet.png")]),
];

/// Adds a first page of one screen, and examples.
pub fn with_help(command: Command) -> Command {
    let template = format!(
        "{{about-with-newline}}{{usage-heading}} {{usage}}\n\n{}{}",
        first_page(&command),
        "Options: --errors text|json, --help, --version; `help COMMAND` for the rest\n"
    );
    with_examples_alone(command.help_template(template))
}

/// Adds examples.
pub fn with_examples_alone(command: Command) -> Command {
    let command = EXAMPLES.iter().fold(command, |command, (path, examples)| {
        let names: Vec<&str> = path.split(' ').collect();
        with_examples(command, &names, &shown(examples))
    });
    let nouns: Vec<String> = command.get_subcommands().filter(|inner| inner.has_subcommands()).map(name_of).collect();
    nouns.iter().fold(command, |command, noun| {
        let of_noun = EXAMPLES.iter().filter(|(path, _)| path.split(' ').next() == Some(noun));
        let first: Vec<_> = of_noun.filter_map(|(_, examples)| examples.first()).copied().collect();
        with_examples(command, &[noun], &shown(&first))
    })
}

fn name_of(command: &Command) -> String {
    command.get_name().to_owned()
}

fn with_examples(command: Command, path: &[&str], text: &str) -> Command {
    match path {
        [] => command.after_help(text.to_owned()),
        [name, rest @ ..] if command.find_subcommand(name).is_some() => {
            command.mut_subcommand(name, |inner| with_examples(inner, rest, text))
        }
        // The command belongs to a feature that this build lacks.
        _ => command,
    }
}

fn shown(examples: &[(&str, &str)]) -> String {
    let lines = examples.iter().map(|(what, typed)| format!("  {what}:\n    mirrorstats {typed}\n"));
    title("Examples:") + &lines.collect::<String>()
}

fn first_page(command: &Command) -> String {
    let line = |inner: &Command| {
        let about = inner.get_about().map(ToString::to_string).unwrap_or_default();
        format!("  {:<14}{}\n", inner.get_name(), about.split(": ").next().unwrap_or_default())
    };
    let (nouns, verbs): (Vec<_>, Vec<_>) = command.get_subcommands().partition(|inner| inner.has_subcommands());
    let [verbs, nouns] = [verbs, nouns].map(|all| all.into_iter().map(line).collect::<String>());
    format!("{verbs}\n{nouns}")
}

fn title(words: &str) -> String {
    let style = Style::new().bold().underline();
    format!("{style}{words}{style:#}\n")
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory as _, Parser as _};

    use super::{EXAMPLES, with_help};
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
            let of_command = EXAMPLES.iter().filter(|(name, _)| *name == command);
            assert_eq!(of_command.count(), 1, "{command}");
        }
        for (name, examples) in EXAMPLES {
            for (_, typed) in *examples {
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

//! The messages for a refused command line, besides clap's own.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

use crate::cli::features;
use mirrorstats_exact::suggest;

const OF_SIM: [&str; 2] = ["record", "world"];

/// Adds the commands that have a refused option, and the feature that has a refused command.
pub fn with_tips(mut error: Error, command: &Command) -> Error {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    let tip = match error.kind() {
        ErrorKind::UnknownArgument => text(ContextKind::InvalidArg).and_then(|option| of_others(&option, command)),
        ErrorKind::InvalidSubcommand => text(ContextKind::InvalidSubcommand)
            .and_then(|name| of_feature(&name).or_else(|| Some(similar(&name, command)))),
        _ => None,
    };
    if error.kind() == ErrorKind::InvalidSubcommand {
        // Clap's similarity is too broad: it suggests `filmstrip` for `ls`.
        error.remove(ContextKind::SuggestedSubcommand);
    }
    if let Some(tip) = tip {
        // A similar option of this command is no better than the same option of another command.
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

fn of_others(option: &str, command: &Command) -> Option<String> {
    let long = option.strip_prefix("--")?.split('=').next()?;
    let mut paths = Vec::new();
    collect(command, "", long, &mut paths);
    let paths: Vec<String> = paths.iter().map(|path| format!("`{path}`")).collect();
    (!paths.is_empty()).then(|| format!("`--{long}` is an option of {}", paths.join(", ")))
}

fn collect(command: &Command, path: &str, long: &str, found: &mut Vec<String>) {
    for inner in command.get_subcommands() {
        let path = format!("{path} {}", inner.get_name()).trim_start().to_owned();
        if inner.get_arguments().any(|arg| arg.get_long() == Some(long)) {
            found.push(path.clone());
        }
        collect(inner, &path, long, found);
    }
}

fn of_feature(name: &str) -> Option<String> {
    (!cfg!(feature = "sim") && OF_SIM.contains(&name)).then(|| {
        format!(
            "`{name}` needs the feature `sim`, which this build lacks: build with `--features {}`",
            features::with("sim")
        )
    })
}

fn similar(name: &str, command: &Command) -> String {
    let nouns: Vec<&Command> = command.get_subcommands().collect();
    let verbs = nouns.iter().flat_map(|noun| noun.get_subcommands().map(move |verb| (noun.get_name(), verb)));
    let verbs = verbs.map(|(noun, verb)| (verb.get_name(), format!("{noun} {}", verb.get_name())));
    let all: Vec<(&str, String)> =
        nouns.iter().map(|noun| (noun.get_name(), noun.get_name().to_owned())).chain(verbs).collect();
    let near = suggest::nearest(name, all.iter().map(|(last, _)| *last));
    match near.and_then(|near| all.iter().find(|(last, _)| *last == near)) {
        Some((_, path)) => format!("a similar command exists: `{path}`"),
        None => "`mirrorstats help` lists the commands".to_owned(),
    }
}

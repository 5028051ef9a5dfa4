//! The messages for a refused command line, besides clap's own, and the features of this build.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

use super::config;
use mirrorstats_exact::suggest;

/// Every feature, ordered by name; true if this build has it.
const FEATURES: [(&str, bool); 4] = [
    ("polars", cfg!(feature = "polars")),
    ("raster", cfg!(feature = "raster")),
    ("sim", cfg!(feature = "sim")),
    ("view", cfg!(feature = "view")),
];

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
    let choices = config::choices(command, "");
    let having = choices.iter().filter(|choice| choice.arg.get_long() == Some(long));
    let paths: Vec<String> = having.map(|choice| format!("`{}`", choice.command)).collect();
    (!paths.is_empty()).then(|| format!("`--{long}` is an option of {}", paths.join(", ")))
}

fn of_feature(name: &str) -> Option<String> {
    (!cfg!(feature = "sim") && OF_SIM.contains(&name)).then(|| {
        format!(
            "`{name}` needs the feature `sim`, which this build lacks: build with `--features {}`",
            features_with("sim")
        )
    })
}

/// The version, and the features of this build.
pub fn long_version() -> String {
    let present: Vec<&str> = FEATURES.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect();
    let features = if present.is_empty() { "none".to_owned() } else { present.join(", ") };
    format!("{}\nfeatures: {features}", env!("CARGO_PKG_VERSION"))
}

/// The features for a build with one more: `polars,sim`. Features of every build are left out.
fn features_with(name: &str) -> String {
    let chosen = FEATURES.into_iter().filter(|(known, is_there)| (*is_there && *known != "raster") || *known == name);
    chosen.map(|(known, _)| known).collect::<Vec<_>>().join(",")
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

#[cfg(test)]
mod tests {
    use super::{features_with, long_version};

    #[test]
    fn a_missing_feature_is_added_to_the_present_ones() {
        assert!(features_with("polars").split(',').any(|name| name == "polars"));
        assert_eq!(features_with("polars").split(',').any(|name| name == "sim"), cfg!(feature = "sim"));
        assert_eq!(long_version().contains("sim"), cfg!(feature = "sim"));
    }
}

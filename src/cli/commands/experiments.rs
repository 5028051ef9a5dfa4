//! `experiments`: check a file of experiments, explain an experiment in words, list and show built-in ones.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::escape::{visible, visible_lines};
use mirrorstats_exact::suggest::hint;
use mirrorstats_experiment::explain::{Measured, explained};
use mirrorstats_experiment::file::Loaded;
use mirrorstats_experiment::{Experiment, Spec, UnknownExperiment, built_in, built_in_names};

/// Check, explain and show experiments
#[derive(Clone, Debug, clap::Subcommand)]
pub enum ExperimentsCommand {
    /// Show every fault of a file of experiments, underlined, with a suggestion
    Check {
        /// A TOML file
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Print the experiments as traces carry them, as JSON
        #[arg(long)]
        json: bool,
    },
    /// Explain in words what an experiment shows, asks and decides
    Explain {
        /// A built-in experiment, or a TOML file
        #[arg(value_name = "NAME|FILE")]
        experiment: PathBuf,
        /// Print the templates of its prompt, each under its file's name
        #[arg(long, conflicts_with = "json")]
        prompt: bool,
        /// Print the experiment as traces carry it, as JSON
        #[arg(long)]
        json: bool,
    },
    /// Print the file of a built-in experiment, to start your own from; without a name, list them
    Show {
        /// A built-in experiment
        #[arg(value_name = "NAME")]
        name: Option<String>,
    },
}

/// The answer for a program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ExperimentsAnswer {
    /// The experiments, in the order of their file.
    pub experiments: Vec<Spec>,
}

impl ExperimentsCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Check { file, json } => check(&file, json),
            Self::Explain { experiment, prompt, json } => explain(&experiment, prompt, json),
            Self::Show { name } => show(name.as_deref()),
        }
    }
}

#[cfg(feature = "sim")]
fn placed(file: &Path) -> Result<Vec<Loaded>, Failure> {
    Ok(mirrorstats_record::experiments::placed(file, &mirrorstats_sim::config::WorldConfig::default())?)
}

#[cfg(not(feature = "sim"))]
fn placed(file: &Path) -> Result<Vec<Loaded>, Failure> {
    Ok(mirrorstats_experiment::file::load(file)?)
}

/// What scenes of the built-in world tell.
#[cfg(feature = "sim")]
fn measured(experiment: &Experiment) -> Measured {
    let config = mirrorstats_sim::config::WorldConfig::default();
    let blind = mirrorstats_sim::blind::Blind::measured(&config, experiment);
    let warning = blind.filter(mirrorstats_sim::blind::Blind::is_above_chance).map(|blind| {
        let help = "draw colours that do not depend on the body's, or declare this rate in `chance`";
        format!("warning: the scenes of {} give the answer away: {blind}\n  help: {help}", experiment.name())
    });
    let ways = mirrorstats_sim::placement::Ways::measured(&config, experiment).map(|ways| ways.described());
    Measured { ways, blind: blind.map(|blind| blind.to_string()), warning }
}

#[cfg(not(feature = "sim"))]
fn measured(_: &Experiment) -> Measured {
    Measured::default()
}

fn check(file: &Path, json: bool) -> Result<Outcome, Failure> {
    let loaded = placed(file)?;
    let all: Vec<Measured> = loaded.iter().map(|one| measured(&one.experiment)).collect();
    all.iter().filter_map(|measured| measured.warning.as_deref()).for_each(output::say);
    if json {
        return answer(loaded.iter().map(|one| &one.experiment));
    }
    let line = |(Loaded { experiment, .. }, measured): (&Loaded, &Measured)| {
        let (title, prompt) = (visible(&experiment.title), visible(&experiment.prompt));
        let ways = measured.ways.as_ref().map_or_else(String::new, |ways| format!("    shortest way {ways}\n"));
        let hash = experiment.templates().hash();
        format!("  {}: {title}\n    prompt {prompt}, sha256 {hash}\n{ways}", experiment.name())
    };
    let lines: String = loaded.iter().zip(&all).map(line).collect();
    output::plain(format!("{}: no fault\n{lines}", visible(&file.display().to_string())))
}

fn answer<'a>(experiments: impl Iterator<Item = &'a Experiment>) -> Result<Outcome, Failure> {
    output::print_json(&ExperimentsAnswer { experiments: experiments.map(|one| (**one).clone()).collect() })
}

fn explain(path: &Path, prompt: bool, json: bool) -> Result<Outcome, Failure> {
    let experiments = match Experiment::parse(&path.to_string_lossy()) {
        Ok(experiment) => vec![experiment],
        Err(_) if path.extension().is_some_and(|ending| ending == "toml") => {
            placed(path)?.into_iter().map(|one| one.experiment).collect()
        }
        Err(unknown) => return Err(unknown_name(&unknown)),
    };
    if json {
        return answer(experiments.iter());
    }
    let words = |experiment| if prompt { prompt_of(experiment) } else { explained(experiment, &measured(experiment)) };
    let texts: Vec<String> = experiments.iter().map(words).collect();
    output::plain(texts.join("\n") + "\n")
}

fn prompt_of(experiment: &Experiment) -> String {
    let file = |(name, text): &(String, String)| {
        let folder = visible(&experiment.prompt);
        format!("# {folder}/{name}.txt\n{}\n", visible_lines(text.trim_end()))
    };
    experiment.templates().all.iter().map(file).collect::<Vec<_>>().join("\n")
}

fn show(name: Option<&str>) -> Result<Outcome, Failure> {
    let Some(name) = name else {
        let line = |experiment: Experiment| format!("{:<12}  {}\n", experiment.name(), experiment.title);
        let all = built_in_names().into_iter().flat_map(Experiment::parse);
        return output::plain(all.map(line).collect::<String>());
    };
    let unknown = || UnknownExperiment { name: name.to_owned() };
    output::plain(built_in(name).ok_or_else(|| unknown_name(&unknown()))?)
}

fn unknown_name(unknown: &UnknownExperiment) -> Failure {
    Failure::input(format!("{unknown}{}", hint(&unknown.name, built_in_names())))
}

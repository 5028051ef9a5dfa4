//! `plan`: the number of episodes that a study needs, or the difference that its episodes can show.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::cli::args::number;
#[cfg(feature = "sim")]
use crate::cli::commands::world::configured;
#[cfg(feature = "sim")]
use crate::cli::registered;
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_analysis::plan::register::{NamedHash, RegisteredPlan};
use mirrorstats_analysis::plan::{Given, Plan, PlanRequest, plan};
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_exact::suggest::hint;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::vocabulary::schema_columns;
use mirrorstats_statistics::sample_size::Clusters;

/// Plan how many episodes a study needs: for a wanted difference, or the difference that given episodes can show
#[derive(Clone, Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("given").required(true).args(["difference", "runs", "scenes"])))]
pub struct PlanArgs {
    /// The difference of two rates to show, such as 0.3: how many episodes does it take?
    #[arg(long, value_name = "D", value_parser = share)]
    pub difference: Option<f64>,
    /// Runs per seed of each model and experiment: which difference can they show?
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u64).range(1..))]
    pub runs: Option<u64>,
    /// The same as scenes that each participant plays
    #[arg(long, value_name = "N", requires = "participants", value_parser = clap::value_parser!(u64).range(1..))]
    pub scenes: Option<u64>,
    /// The lower of the two rates [default: both around 1/2, the worst case]
    #[arg(long, value_name = "RATE", value_parser = share)]
    pub baseline: Option<f64>,
    /// The probability of finding the difference
    #[arg(long, value_name = "POWER", default_value = "0.8", value_parser = within)]
    pub power: f64,
    /// Confidence of the tests; they are at one minus it
    #[arg(long, value_name = "LEVEL", default_value = "0.95", value_parser = within)]
    pub confidence: f64,
    /// Models, compared in pairs
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u64).range(2..=1000))]
    pub models: u64,
    /// Seeds, all with equally many runs
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=2000))]
    pub seeds: u64,
    /// Participants of a crossed study instead of seeds, all with equally many scenes: tests count participants, as
    /// `stats` does
    #[arg(long, value_name = "N", conflicts_with_all = ["seeds", "sequential", "register", "runs"], value_parser = clap::value_parser!(u64).range(1..=2000))]
    pub participants: Option<u64>,
    /// The share of pairs in which one model alone succeeds [default: as if independent, the worst case]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub discordance: Option<f64>,
    /// Intraclass correlation of the episodes of one seed: above 0, tests count seeds, as `stats` does
    #[arg(long, value_name = "ICC", default_value = "0", value_parser = share)]
    pub icc: f64,
    /// Look after each run of all seeds with `stats --sequential`, and stop at the first verdict
    #[arg(long, conflicts_with = "icc")]
    pub sequential: bool,
    /// A chance level to compare each model with, such as 1/3
    #[arg(long, value_name = "LEVEL", value_parser = chance)]
    pub chance: Option<Ratio>,
    /// Definitions that a registered plan names by their hash: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    pub definitions: PathBuf,
    /// The metric of the primary question that a registered plan declares, such as TSA
    #[arg(long, value_name = "NAME", requires = "register")]
    pub primary: Option<String>,
    /// An experiment that a registered plan analyses; may be repeated
    #[arg(long, value_name = "NAME", requires = "register")]
    pub experiment: Vec<String>,
    /// A model that a registered plan compares; may be repeated
    #[arg(long, value_name = "NAME", requires = "register")]
    pub model: Vec<String>,
    /// The filter of the analysis that a registered plan declares, in the language of definitions
    #[arg(long = "where", value_name = "EXPR", requires = "register")]
    pub condition: Option<String>,
    /// Write the plan, the hash of the definitions and its own hash to a new file
    #[arg(long, value_name = "FILE")]
    pub register: Option<PathBuf>,
    /// The world configuration that a registered plan names by its hash [default: the built-in one]
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "FILE", requires = "register")]
    pub config: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

impl PlanArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let plan = plan(self.request())?;
        if let Some(file) = &self.register {
            self.write(file, &plan)?;
        }
        output::print_rendered(&plan, self.json, |plan| plan.render(terminal::width()))
    }

    fn request(&self) -> PlanRequest {
        let runs = || self.runs.or(self.scenes).expect("clap requires one of the three");
        PlanRequest {
            given: self.difference.map_or_else(|| Given::Runs(runs()), Given::Difference),
            baseline: self.baseline,
            power: self.power,
            confidence: self.confidence,
            models: self.models,
            clusters: Clusters {
                seeds: self.participants.unwrap_or(self.seeds),
                icc: self.icc,
                people: self.participants.is_some(),
            },
            discordance: self.discordance,
            chance: self.chance,
            sequential: self.sequential,
        }
    }

    fn write(&self, file: &Path, plan: &Plan) -> Result<(), Failure> {
        let catalog = Definitions::load(&self.definitions, &schema_columns())?.catalog;
        if file.exists() {
            return Err(registered_before(file));
        }
        if let Some(name) = self.primary.as_ref().filter(|name| !catalog.metric.contains_key(*name)) {
            let known: Vec<&str> = catalog.metric.keys().map(String::as_str).collect();
            let suggestion = hint(name, known.iter().copied());
            let known_names = known.join(", ");
            return Err(Failure::input(format!(
                "--primary {name}: expected a metric of the definitions ({known_names}), found `{name}`{suggestion}"
            )));
        }
        let definitions = NamedHash { name: catalog.name, sha256: catalog.hash };
        let (experiments, prompts) = self.recorded()?;
        let registered = RegisteredPlan::new(plan.clone(), definitions, experiments, prompts);
        let registered = RegisteredPlan {
            primary: self.primary.clone(),
            experiment_names: self.experiment.clone(),
            model_names: self.model.clone(),
            filter: self.condition.clone(),
            ..registered
        }
        .sealed();
        let mut new = output::create(file)?;
        let written = new.write_all(registered.to_json().as_bytes()).and_then(|()| new.commit_new());
        written.map_err(|error| match error.kind() {
            // Another process has registered a plan meanwhile.
            io::ErrorKind::AlreadyExists => registered_before(file),
            _ => output::unwritable(file, error),
        })
    }

    #[cfg(feature = "sim")]
    fn recorded(&self) -> Result<(Vec<NamedHash>, Vec<NamedHash>), Failure> {
        Ok(registered::recorded(&configured(self.config.as_ref())?))
    }

    #[cfg(not(feature = "sim"))]
    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "a program that records reads a file")]
    fn recorded(&self) -> Result<(Vec<NamedHash>, Vec<NamedHash>), Failure> {
        Ok((Vec::new(), Vec::new()))
    }
}

fn registered_before(file: &Path) -> Failure {
    Failure::input(format!("{}: a registered plan is not replaced; give the name of a new file", file.display()))
}

fn share(text: &str) -> Result<f64, String> {
    number(text, "a number from 0 to 1 such as 0.3", |value| (0.0..=1.0).contains(&value))
}

fn within(text: &str) -> Result<f64, String> {
    number(text, "a number between 0 and 1 such as 0.8", |value| value > 0.0 && value < 1.0)
}

fn chance(text: &str) -> Result<Ratio, String> {
    let level: Ratio = text.parse()?;
    let is_share = level.numerator() >= 0 && level.numerator() <= level.denominator();
    if is_share { Ok(level) } else { Err(format!("expected a fraction from 0 to 1 such as 1/3, found `{text}`")) }
}

#[cfg(test)]
mod tests {
    use super::{chance, share, within};

    #[test]
    fn shares_and_levels_are_numbers_from_zero_to_one() {
        assert_eq!([share("0"), share("1"), within("0.5")], [0.0, 1.0, 0.5].map(Ok));
        for text in ["-0.1", "1.1", "NaN", "30%", ""] {
            assert!(share(text).is_err() && within(text).is_err() && chance(text).is_err(), "{text}");
        }
        assert!(within("0").is_err() && within("1").is_err() && chance("4/3").is_err());
        assert_eq!(chance("1/3").unwrap().to_string(), "1/3");
    }
}

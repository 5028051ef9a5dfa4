//! The verbs: one file each.

pub mod definitions;
pub mod experiments;
#[cfg(all(feature = "sim", feature = "view"))]
pub mod participants;
pub mod setup;
pub mod study;
pub mod style;
pub mod table;
pub mod trace;
#[cfg(feature = "sim")]
pub mod world;

use super::outcome::{Failure, Outcome};
pub use definitions::{sensitivity, sql};
pub use setup::{completions, config, man};
#[cfg(feature = "view")]
pub use study::view;
pub use study::{diff, figure, plan, query, report, score, stats};
pub use table::{audit, compare, rescore, verify};
pub use trace::{check, import, info, recover, renormalize, schema, validate};
#[cfg(feature = "sim")]
pub use world::{filmstrip, record, replay};

/// What to do.
#[derive(Debug, clap::Subcommand)]
#[expect(missing_docs, reason = "the words of each verb stand with its arguments")]
pub enum Command {
    Report(report::ReportArgs),
    #[cfg(feature = "sim")]
    Record(Box<record::RecordArgs>),
    #[cfg(feature = "view")]
    View(view::ViewArgs),
    Score(score::ScoreArgs),
    Stats(stats::StatsArgs),
    Figure(figure::FigureArgs),
    Sensitivity(sensitivity::SensitivityArgs),
    Compare(compare::CompareArgs),
    Audit(audit::AuditArgs),
    Plan(plan::PlanArgs),
    Diff(diff::DiffArgs),
    Rescore(rescore::RescoreArgs),
    Verify(verify::VerifyArgs),
    Validate(validate::ValidateCommand),
    Check(check::CheckArgs),
    Info(info::InfoCommand),
    Import(import::ImportArgs),
    Recover(recover::RecoverArgs),
    Renormalize(renormalize::RenormalizeArgs),
    #[cfg(feature = "sim")]
    Replay(replay::ReplayArgs),
    #[cfg(feature = "sim")]
    Filmstrip(filmstrip::FilmstripArgs),
    #[cfg(all(feature = "sim", feature = "view"))]
    Participants(participants::ParticipantsArgs),
    Schema(schema::SchemaCommand),
    Sql(sql::SqlArgs),
    Query(query::QueryArgs),
    Definitions(definitions::DefinitionsArgs),
    Style(style::StyleArgs),
    Experiments(experiments::ExperimentsArgs),
    #[cfg(feature = "sim")]
    World(world::WorldArgs),
    Config(config::ConfigArgs),
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
}

impl Command {
    /// Whether it runs where the configuration cannot be used: what it does depends on no default.
    pub const fn needs_no_settings(&self) -> bool {
        matches!(self, Self::Config(_) | Self::Completions(_) | Self::Man(_))
    }

    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Report(args) => args.run(),
            #[cfg(feature = "sim")]
            Self::Record(args) => args.run(),
            #[cfg(feature = "view")]
            Self::View(args) => args.run(),
            Self::Score(args) => args.run(),
            Self::Stats(args) => args.run(),
            Self::Figure(args) => args.run(),
            Self::Sensitivity(args) => args.run(),
            Self::Compare(args) => args.run(),
            Self::Audit(args) => args.run(),
            Self::Plan(args) => args.run(),
            Self::Diff(args) => args.run(),
            Self::Rescore(args) => args.run(),
            Self::Verify(args) => args.run(),
            Self::Validate(command) => command.run(),
            Self::Check(args) => args.run(),
            Self::Info(command) => command.run(),
            Self::Import(args) => args.run(),
            Self::Recover(args) => args.run(),
            Self::Renormalize(args) => args.run(),
            #[cfg(feature = "sim")]
            Self::Replay(args) => args.run(),
            #[cfg(feature = "sim")]
            Self::Filmstrip(args) => args.run(),
            #[cfg(all(feature = "sim", feature = "view"))]
            Self::Participants(args) => args.run(),
            Self::Schema(command) => command.run(),
            Self::Sql(args) => args.run(),
            Self::Query(args) => args.run(),
            Self::Definitions(args) => args.run(),
            Self::Style(args) => args.run(),
            Self::Experiments(args) => args.run(),
            #[cfg(feature = "sim")]
            Self::World(args) => args.run(),
            Self::Config(args) => args.run(),
            Self::Completions(args) => args.run(),
            Self::Man(args) => args.run(),
        }
    }
}

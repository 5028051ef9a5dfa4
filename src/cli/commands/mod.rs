//! The commands: one file each, in folders for commands that share a noun.

pub(super) mod definitions;
pub(super) mod experiments;
#[cfg(all(feature = "sim", feature = "view"))]
pub(super) mod participants;
#[cfg(feature = "sim")]
pub mod record;
pub(super) mod setup;
pub(super) mod study;
pub(super) mod style;
pub(super) mod table;
pub(super) mod trace;
#[cfg(feature = "sim")]
pub(super) mod world;

use study::{diff, figure, gate, plan, query, report, score, stats, verify};
#[cfg(feature = "view")]
use study::{publish, view};

use super::outcome::{Failure, Outcome};

/// The commands, in the order of the help: those of a first use, then nouns.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    Report(report::ReportArgs),
    #[cfg(feature = "view")]
    View(view::ViewArgs),
    Score(score::ScoreArgs),
    Stats(stats::StatsArgs),
    Figure(figure::FigureArgs),
    Diff(diff::DiffArgs),
    Gate(gate::GateArgs),
    #[cfg(feature = "view")]
    Publish(publish::PublishArgs),
    Verify(verify::VerifyArgs),
    #[cfg(feature = "sim")]
    Record(Box<record::RecordArgs>),
    Import(trace::import::ImportArgs),
    Query(query::QueryArgs),
    Plan(plan::PlanArgs),
    #[command(subcommand)]
    Trace(trace::TraceCommand),
    #[command(subcommand)]
    Table(table::TableCommand),
    #[command(subcommand)]
    Definitions(definitions::DefinitionsCommand),
    #[command(subcommand)]
    Experiments(experiments::ExperimentsCommand),
    #[command(subcommand)]
    Style(style::StyleCommand),
    #[cfg(feature = "sim")]
    #[command(subcommand)]
    World(world::WorldCommand),
    #[cfg(all(feature = "sim", feature = "view"))]
    #[command(subcommand)]
    Participants(participants::ParticipantsCommand),
    #[command(subcommand)]
    Setup(setup::SetupCommand),
}

impl Command {
    /// Returns true if the command runs even with an invalid configuration.
    pub const fn needs_no_settings(&self) -> bool {
        matches!(self, Self::Setup(_))
    }

    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Report(args) => args.run(),
            #[cfg(feature = "view")]
            Self::View(args) => args.run(),
            Self::Score(args) => args.run(),
            Self::Stats(args) => args.run(),
            Self::Figure(args) => args.run(),
            Self::Diff(args) => args.run(),
            Self::Gate(args) => args.run(),
            #[cfg(feature = "view")]
            Self::Publish(args) => args.run(),
            Self::Verify(args) => args.run(),
            #[cfg(feature = "sim")]
            Self::Record(args) => args.run(),
            Self::Import(args) => args.run(),
            Self::Query(args) => args.run(),
            Self::Plan(args) => args.run(),
            Self::Trace(command) => command.run(),
            Self::Table(command) => command.run(),
            Self::Definitions(command) => command.run(),
            Self::Experiments(command) => command.run(),
            Self::Style(command) => command.run(),
            #[cfg(feature = "sim")]
            Self::World(command) => command.run(),
            #[cfg(all(feature = "sim", feature = "view"))]
            Self::Participants(command) => command.run(),
            Self::Setup(command) => command.run(),
        }
    }
}

//! `audit`: the cells of published tables that no data can give.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser as _};

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{output, terminal};
use exact::rounding::Rounding;
use metric::definitions::Definitions;
use metric::implied::implied;
use report::audit::episodes::Episodes;
use report::audit::{NamedTable, Terms, audit};
use report::published;
use report::style::Style;
use score::score_traces::{has_value, schema_columns};
use study::StudyError;

/// Name the cells of published tables that no data can give, and say why
#[derive(Clone, Debug, clap::Args)]
pub struct AuditArgs {
    /// Published tables of one study: CSV files with the columns experiment,model,metric,mean,se,emphasis
    #[arg(required = true, value_name = "TABLE")]
    pub tables: Vec<PathBuf>,
    /// Episodes per row: `21`, `E1=21,E2=20`, `21,E3/GPT 5.1=19`
    #[arg(long = "n", value_name = "EPISODES")]
    pub episodes: Episodes,
    /// Definitions: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    pub definitions: PathBuf,
    /// The most steps of an episode
    #[arg(long, value_name = "STEPS", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub steps: u32,
    /// Roundings to consider, separated by commas: half-even, half-up, binary, twice, truncate [default: all]
    #[arg(long, value_name = "RULES", value_delimiter = ',', value_parser = rounding_parser(), hide_possible_values = true)]
    pub rounding: Vec<Rounding>,
    /// The style whose tables say what emphasis means, and where undefined prints as zero: `paper`, `default`, or a file
    #[arg(long, value_name = "STYLE", default_value = "paper")]
    pub style: PathBuf,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

impl AuditArgs {
    /// Audits; the check holds if some data can give every cell.
    pub fn run(self) -> Result<Outcome, Failure> {
        let tables = self.tables.iter().map(|path| table(path)).collect::<Result<Vec<_>, _>>()?;
        let definitions = Definitions::load(&self.definitions, &schema_columns()).map_err(StudyError::from)?;
        let implied = implied(&definitions.plan, self.steps, has_value);
        let style = Style::load(&self.style).map_err(StudyError::from)?;
        style.check_against(&definitions.catalog).map_err(Failure::input)?;
        let roundings = if self.rounding.is_empty() { Rounding::ALL.to_vec() } else { self.rounding };
        let terms = Terms {
            catalog: &definitions.catalog,
            implied: &implied,
            episodes: &self.episodes,
            style: &style,
            roundings: &roundings,
        };
        let found = audit(&tables, terms).map_err(Failure::input)?;
        if self.json {
            output::print_json(&found)?;
        } else {
            std::io::stdout().lock().write_all(found.render(terminal::width()).as_bytes())?;
        }
        Ok(if found.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }
}

fn table(path: &Path) -> Result<NamedTable, Failure> {
    let published = published::read(path).map_err(Failure::input)?;
    let name = path.file_name().map_or_else(|| path.to_string_lossy(), |name| name.to_string_lossy());
    Ok(NamedTable { name: name.into_owned(), published })
}

fn rounding_parser() -> impl clap::builder::TypedValueParser<Value = Rounding> {
    let names = Rounding::ALL.map(Rounding::name);
    PossibleValuesParser::new(names).map(|name| {
        let rounding = Rounding::ALL.into_iter().find(|rounding| rounding.name() == name);
        rounding.expect("only names of roundings are possible")
    })
}

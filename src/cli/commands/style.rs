//! `style`: show a built-in style, or check a style file.

use std::path::{Path, PathBuf};

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::suggest::hint;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_report::style::{Style, built_in, built_in_names};
use mirrorstats_score::vocabulary::schema_columns;

/// Show and check styles: how tables look
#[derive(Clone, Debug, clap::Subcommand)]
pub enum StyleCommand {
    /// Print a built-in style, to start your own from
    Show {
        /// `default` or `paper`
        #[arg(value_name = "NAME", default_value = "default")]
        name: String,
    },
    /// Show every fault of a style file, underlined, with a suggestion
    Check {
        /// `default`, `paper`, or a TOML file
        #[arg(value_name = "NAME|FILE")]
        file: PathBuf,
        /// The definitions whose metrics it may name: `paper`, `extended`, or a TOML file
        #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
        definitions: PathBuf,
    },
}

impl StyleCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Show { name } => show(&name),
            Self::Check { file, definitions } => check(&file, &definitions),
        }
    }
}

fn show(name: &str) -> Result<Outcome, Failure> {
    let Some(text) = built_in(name) else {
        let names = built_in_names();
        let (known, hint) = (names.join(", "), hint(name, names));
        return Err(Failure::input(format!("no built-in style `{name}`; there are {known}{hint}")));
    };
    output::plain(text)
}

fn check(file: &Path, definitions: &Path) -> Result<Outcome, Failure> {
    let style = Style::load(file)?;
    let catalog = Definitions::load(definitions, &schema_columns())?.catalog;
    style.check_against(&catalog)?;
    let tables = style.sheet.table.iter();
    let tables = tables.map(|(name, table)| format!("  table {name}: {}\n", visible(&table.columns.join(", "))));
    let (file, tables) = (visible(&file.display().to_string()), tables.collect::<String>());
    output::plain(format!("{file}: no fault\n{tables}  sha256 {}\n", style.hash))
}

//! `mirrorstats schema`: what a trace is.

use std::io::{self, Write};

use comfy_table::{ContentArrangement, Table};

use crate::cli::listing::listing;
use crate::cli::outcome::{Failure, Outcome};
use crate::trace::describe::SchemaDocument;

/// Print what a trace is: columns, footer metadata, rules
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct SchemaCommand {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Columns of a terminal that text is wrapped to, wherever it goes.
const WIDTH: u16 = 110;

impl SchemaCommand {
    /// Prints the schema.
    ///
    /// # Errors
    /// When the output cannot be written.
    pub fn run(self) -> Result<Outcome, Failure> {
        let schema = SchemaDocument::current();
        let mut out = io::stdout().lock();
        if self.json {
            writeln!(out, "{:#}", serde_json::json!(schema))?;
        } else {
            print(&mut out, &schema)?;
        }
        Ok(Outcome::Done)
    }
}

fn print(out: &mut impl Write, schema: &SchemaDocument) -> io::Result<()> {
    let sentences = schema.description.replace(". ", ".\n");
    writeln!(out, "{}, schema version {}\n\n{sentences}\n", schema.title, schema.version)?;
    let mut columns = wrapped(["column", "type", "unit", "presence", "may be", "per", "meaning"]);
    for column in schema.columns {
        let meaning = match column.values {
            [] => column.doc.to_owned(),
            values => format!("{} One of {}.", column.doc, values.join(", ")),
        };
        columns.add_row([
            column.name,
            column.stored.name(),
            column.unit.unwrap_or(""),
            if column.required { "required" } else { "optional" },
            if column.nullable { "null" } else { "" },
            if column.constant { "episode" } else { "step" },
            &meaning,
        ]);
    }
    let mut metadata = wrapped(["footer key", "meaning"]);
    metadata.add_rows(schema.metadata.iter().map(|entry| [entry.key, entry.doc]));
    let mut rules = wrapped(["code", "rule"]);
    rules.add_rows(schema.rules.iter().map(|rule| [rule.code.name(), rule.rule]));
    writeln!(out, "{}\n\n{}\n\n{}", columns.trim_fmt(), metadata.trim_fmt(), rules.trim_fmt())
}

fn wrapped<const N: usize>(header: [&str; N]) -> Table {
    let mut table = listing(header);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    table
}

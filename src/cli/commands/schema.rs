//! `mirrorstats schema`: what a trace is.

use std::io::{self, Write};

use comfy_table::{ContentArrangement, Table, presets};

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
    writeln!(out, "{}, schema version {}\n\n{}\n", schema.title, schema.version, schema.description)?;
    let mut columns = table(["column", "type", "unit", "required", "null", "per", "meaning"]);
    for column in schema.columns {
        let meaning = match column.values {
            [] => column.doc.to_owned(),
            values => format!("{} One of {}.", column.doc, values.join(", ")),
        };
        columns.add_row([
            column.name,
            column.stored.name(),
            column.unit.unwrap_or(""),
            if column.required { "yes" } else { "" },
            if column.nullable { "yes" } else { "no" },
            if column.constant { "episode" } else { "step" },
            &meaning,
        ]);
    }
    let mut metadata = table(["footer key", "meaning"]);
    metadata.add_rows(schema.metadata.iter().map(|entry| [entry.key, entry.doc]));
    let mut rules = table(["code", "rule"]);
    rules.add_rows(schema.rules.iter().map(|rule| [rule.code.name(), rule.rule]));
    writeln!(out, "{columns}\n\n{metadata}\n\n{rules}")
}

fn table<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    table
}

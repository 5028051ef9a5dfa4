//! `mirrorstats trace schema`: the schema of traces, and the JSON Schemas of files that other programs write.

use std::io::{self, Write};

use clap::ValueEnum as _;
use schemars::schema_for;
use serde_json::{Value, json};

use crate::cli::{Failure, Outcome, terminal};
use mirrorstats_agents::reply;
use mirrorstats_experiment::schema::ExperimentFile;
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_import;
use mirrorstats_tables::Table;
use mirrorstats_trace::schema::Column;
use mirrorstats_trace::schema::describe::SchemaDocument;

/// Print the trace schema: columns, footer metadata, rules; or a JSON Schema by name
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct SchemaCommand {
    /// The schema to describe; all but `trace` are printed as JSON Schema
    #[arg(value_enum, value_name = "NAME", default_value_t)]
    name: Name,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Name {
    /// A trace: its columns, footer and rules
    #[default]
    Trace,
    /// A line of the JSON lines that `mirrorstats import` reads
    Step,
    /// A file of experiments, for `record --experiment`
    Experiments,
    /// An experiment as traces carry it in their footer
    Experiment,
    /// A model's reply in E1 to E4
    ReplyCubes,
    /// A model's reply in E5
    ReplyExploration,
}

impl Name {
    /// The document, as in the file of this name in `schemas/`.
    pub fn document(self) -> Value {
        match self {
            Self::Trace => json!(SchemaDocument::current()),
            Self::Step => mirrorstats_import::schema::document(),
            Self::Experiments => json!(schema_for!(ExperimentFile)),
            Self::Experiment => json!(schema_for!(Spec)),
            Self::ReplyCubes => reply::schema("Reply in E1 to E4", &Experiment::E1),
            Self::ReplyExploration => reply::schema("Reply in E5", &Experiment::E5),
        }
    }
}

/// The width to which text is wrapped, except on narrower terminals.
const WIDTH: usize = 110;

impl SchemaCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        let mut out = io::stdout().lock();
        if self.json || self.name != Name::Trace {
            writeln!(out, "{:#}", self.name.document())?;
        } else {
            print(&mut out, &SchemaDocument::current())?;
        }
        Ok(Outcome::Done)
    }
}

fn print(out: &mut impl Write, schema: &SchemaDocument) -> io::Result<()> {
    let sentences = schema.description.replace(". ", ".\n");
    writeln!(out, "{}, schema version {}\n\n{sentences}\n", schema.title, schema.version)?;
    let mut columns = Table::of_texts(["column", "type", "unit", "presence", "may be", "per", "meaning"]);
    for column in schema.columns {
        columns.push([
            column.name,
            column.stored.name(),
            column.unit.unwrap_or(""),
            if column.required { "required" } else { "optional" },
            if column.nullable { "null" } else { "" },
            if column.constant { "episode" } else { "step" },
            &meaning(column),
        ]);
    }
    let metadata = schema.metadata.iter().map(|entry| [&*entry.key, &*entry.doc]);
    let metadata = Table::of_texts(["footer key", "meaning"]).with(metadata);
    let rules = schema.rules.iter().map(|rule| [rule.code.name(), rule.rule]);
    let rules = Table::of_texts(["code", "rule"]).with(rules);
    let [columns, metadata, rules] = [columns, metadata, rules].map(|table| table.wrapped(width()));
    writeln!(out, "{columns}\n{metadata}\n{rules}")?;
    let mut others = Table::of_texts(["JSON Schema", "of"]);
    for name in Name::value_variants().iter().filter(|name| **name != Name::Trace) {
        if let Some(value) = name.to_possible_value() {
            let of = value.get_help().map(ToString::to_string).unwrap_or_default();
            others.push([format!("mirrorstats trace schema {}", value.get_name()), of]);
        }
    }
    write!(out, "{}", others.wrapped(width()))
}

fn meaning(column: &Column) -> String {
    let values = (!column.values.is_empty()).then(|| format!("One of {}.", column.values.join(", ")));
    let default = column.default.map(|default| format!("No value means {default}."));
    let doc = Some(column.doc.to_owned());
    [doc, values, default].into_iter().flatten().collect::<Vec<_>>().join(" ")
}

fn width() -> usize {
    terminal::width().unwrap_or(WIDTH).min(WIDTH)
}

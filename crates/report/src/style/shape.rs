//! The shape of a style file, for its JSON Schema: `read` reads the same keys.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{ColumnSheet, PrintSheet};
use crate::figures::shown::FigureSheets;

/// A style file. With an include only what differs has to be said.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StyleFile {
    /// Styles that come first, by name or by path relative to this file; what this file says replaces what they say.
    pub include: Vec<String>,
    /// The models in the order of their rows; others come after them, by name.
    pub row_order: Vec<String>,
    /// What stands where a value is undefined.
    pub undefined: String,
    /// The sentence that explains emphasis, under tables where something is emphasised.
    pub emphasis_note: String,
    /// How cells print in every table, unless the table says otherwise.
    pub print: PrintSheet,
    /// Headers and arrows, by metric.
    pub column: IndexMap<String, ColumnSheet>,
    /// The tables by name; a name becomes a file name. `main` must be one of them, here or in an include.
    pub table: IndexMap<String, TableShape>,
    /// The metrics and the captions of figures, by the name of the figure.
    pub figure: FigureSheets,
}

/// One table of a style file.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableShape {
    /// The first words of the caption, without a full stop.
    pub title: Option<String>,
    /// The sentences after them.
    pub note: Option<String>,
    /// The LaTeX label; none if absent.
    pub label: Option<String>,
    /// The metrics, in the order of the columns. Those that the scores have not are left out.
    pub columns: Option<Vec<String>>,
    /// What prints otherwise than in the other tables.
    pub print: PrintSheet,
    /// The metrics whose undefined cells print as zero and compete as zero (a quirk of the published main table).
    pub undefined_as_zero: Option<Vec<String>>,
}

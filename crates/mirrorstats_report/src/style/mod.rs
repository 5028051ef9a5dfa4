//! Presentation as data: the tables, their columns and order, how cells print, what is emphasised.
//!
//! Rule: a style changes how a number looks, never the number. Styles are TOML and are checked against the catalog
//! before anything prints. `default` and `paper` are built in; any other name is a file. `read.rs` reads them.

mod read;

use std::io;
use std::path::{Path, PathBuf};

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::suggest::nearest;
use mirrorstats_figures::shown::FigureSheets;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Kind};
use mirrorstats_toml_spec::{Fault, Faults, Place};

/// The table that every report has.
pub const MAIN_TABLE: &str = "main";
/// The table of the metrics that a style does not name.
pub const OTHER_TABLE: &str = "other";

#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// The built-in name, or the file's name without its extension; never a path.
    pub name: String,
    /// SHA-256 of the text, 64 hexadecimal digits; with includes, of the hashes of all texts, one per line, in reading
    /// order.
    pub hash: String,
    pub sheet: StyleSheet,
    pub is_built_in: bool,
    /// Metrics named by the user's files, with locations.
    named: Vec<(String, Place)>,
}

/// A style file. It starts from `include`, or from the style `default`, and states only what differs.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "StyleFile")]
pub struct StyleSheet {
    /// Styles that come first, by name or by path relative to this file; what this file says replaces what they say.
    /// `default` if absent, unless the including file lists styles before this one; an empty list starts from nothing.
    pub include: Vec<String>,
    /// The models in the order of their rows; others come after them, by name.
    pub row_order: Vec<String>,
    /// The text for an undefined value.
    pub undefined: String,
    /// The sentence that explains emphasis, under tables where something is emphasised; follows from the rule of emphasis
    /// if absent, none if empty.
    pub emphasis_note: Option<String>,
    /// The defaults for cells of every table.
    pub print: PrintSheet,
    /// Headers and arrows, by metric.
    pub column: IndexMap<String, ColumnSheet>,
    /// The tables by name; a name becomes a file name. `main` must be one of them, here or in an include.
    pub table: IndexMap<String, TableSheet>,
    /// The metrics and the captions of figures, by the name of the figure.
    pub figure: FigureSheets,
}

/// One table of a style file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableSheet {
    /// The first words of the caption, without a full stop.
    pub title: String,
    /// The sentences after them; in `main`, a sentence about the form of the cells if absent.
    pub note: Option<String>,
    /// The LaTeX label; none if absent.
    pub label: Option<String>,
    /// The metrics, in the order of the columns. Those that the scores have not are left out.
    pub columns: Vec<String>,
    /// The rows and columns of the table.
    pub layout: TableLayout,
    /// True to add the mean of the experiments of each model, where every experiment has a value; not in `grouped`.
    pub mean: bool,
    /// The settings of this table's cells that differ from the defaults.
    pub print: PrintSheet,
    /// The metrics whose undefined cells print as zero and compete as zero (a quirk of the published main table).
    pub undefined_as_zero: Vec<String>,
}

/// The rows and columns of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TableLayout {
    /// Models in rows, metrics in columns, a group of rows for each experiment.
    #[default]
    Grouped,
    /// Models in rows, experiments in columns, a group of rows for each metric.
    ModelsByExperiments,
    /// Experiments in rows, models in columns, a group of rows for each metric.
    ExperimentsByModels,
}

impl Default for StyleSheet {
    fn default() -> Self {
        Self {
            include: Vec::new(),
            row_order: Vec::new(),
            undefined: "--".to_owned(),
            emphasis_note: None,
            print: PrintSheet::default(),
            column: IndexMap::new(),
            table: IndexMap::new(),
            figure: FigureSheets::new(),
        }
    }
}

/// The heading of a metric's column.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnSheet {
    /// The header; if absent, the metric's title, or its name in the domain of the mirror.
    pub header: Option<String>,
    /// The header as LaTeX source, written unchanged; the escaped name if absent.
    pub latex: Option<String>,
    /// The direction to print and emphasise by; the definition's own if absent.
    pub better: Option<Better>,
}

/// The settings of printed cells; an absent one is inherited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrintSheet {
    /// The form of a cell.
    pub cell: Option<CellForm>,
    /// The rounding of its numbers.
    pub rounding: Option<Rounding>,
    /// Digits behind the point.
    pub decimals: Option<Decimals>,
    /// The cells that stand out.
    pub emphasis: Option<EmphasisRule>,
    /// The standard error of a single value, where the sample form has none.
    pub single_se: Option<SingleSe>,
    /// Cells with fewer defined episodes than this are marked with a dagger.
    pub mark_n_below: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Print {
    pub cell: CellForm,
    pub rounding: Rounding,
    pub decimals: Decimals,
    pub emphasis: EmphasisRule,
    pub single_se: SingleSe,
    pub mark_n_below: u64,
}

/// The form of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CellForm {
    /// `0.57 ± 0.11`.
    MeanSe,
    /// `12/21 [.37, .76]` for a rate, `47.7 [30.7, 64.7]` for a quantity.
    CountInterval,
}

/// The rounding of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rounding {
    /// The exact value once, ties to even.
    Once,
    /// The binary float once, ties to even, as C and Python print it.
    OnceBinary,
    /// The binary float to one digit more, then that text with halves away from zero.
    Twice,
}

/// Digits behind the point, at most nine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Decimals {
    /// Of a rate.
    #[schemars(range(max = 9))]
    pub rate: u32,
    /// Of anything else.
    #[schemars(range(max = 9))]
    pub quantity: u32,
}

/// Which cells of a column stand out within their group. Only models compete: where rows are anything else,
/// nothing is emphasised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EmphasisRule {
    /// Nothing.
    None,
    /// The best exact mean is bold, the next underlined, with all that tie; nothing where all tie.
    ExactMean,
    /// The same by the means as printed; where all tie, all are bold.
    PrintedMean,
    /// Those that no test shows to be worse than another are bold; nothing where that is so of all.
    Tied,
}

/// The standard error of a single value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SingleSe {
    /// Not printed.
    Undefined,
    /// Printed as zero.
    Zero,
}

#[derive(Debug, thiserror::Error)]
pub enum StyleError {
    #[error("no style `{name}`: expected `default`, `paper` or the path of a style file{hint}")]
    Unknown { name: String, hint: String },
    #[error("style {}: cannot read the file: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Faults(#[from] Faults),
}

pub fn built_in_names() -> Vec<&'static str> {
    read::KIND.built_in_names()
}

pub fn built_in(name: &str) -> Option<&'static str> {
    read::KIND.built_in_text(name)
}

impl Style {
    /// The built-in style with this name, or else the style in this file.
    pub fn load(name_or_path: impl AsRef<Path>) -> Result<Self, StyleError> {
        read::read(name_or_path.as_ref())
    }

    /// Checks that the style names only metrics of the definitions. A built-in style may name others.
    pub fn check_against(&self, catalog: &Catalog) -> Result<(), StyleError> {
        let strange = self.named.iter().filter(|(metric, _)| !catalog.metric.contains_key(metric));
        let fault = |(metric, place): &(String, Place)| {
            let known: Vec<&str> = catalog.metric.keys().map(String::as_str).collect();
            let help = match nearest(metric, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("metrics are {}", known.join(", ")),
            };
            let message = format!("the definitions `{}` have no metric `{metric}`", catalog.name);
            Fault::new(place.clone(), message).help(help)
        };
        let faults: Vec<Fault> = strange.map(fault).collect();
        if faults.is_empty() { Ok(()) } else { Err(Faults(faults).in_order().into()) }
    }
}

impl StyleSheet {
    pub fn print_of(&self, table: &TableSheet) -> Print {
        let (own, all) = (&table.print, &self.print);
        Print {
            cell: own.cell.or(all.cell).unwrap_or(CellForm::CountInterval),
            rounding: own.rounding.or(all.rounding).unwrap_or(Rounding::Once),
            decimals: own.decimals.or(all.decimals).unwrap_or(Decimals { rate: 2, quantity: 1 }),
            emphasis: own.emphasis.or(all.emphasis).unwrap_or(EmphasisRule::ExactMean),
            single_se: own.single_se.or(all.single_se).unwrap_or(SingleSe::Undefined),
            mark_n_below: own.mark_n_below.or(all.mark_n_below).unwrap_or(0),
        }
    }

    /// The sentence that explains emphasis by this rule.
    pub fn emphasis_note(&self, rule: EmphasisRule) -> &str {
        self.emphasis_note.as_deref().unwrap_or_else(|| rule.note())
    }

    pub fn better(&self, metric: &str, catalog: &Catalog) -> Better {
        let own = self.column.get(metric).and_then(|column| column.better);
        own.or_else(|| catalog.metric.get(metric).map(|m| m.better)).unwrap_or(Better::Neither)
    }
}

impl TableSheet {
    /// The sentences after the title of the table `name` with cells of this form.
    pub(crate) fn note(&self, name: &str, form: CellForm) -> &str {
        let own = if name == MAIN_TABLE { form.note() } else { "" };
        self.note.as_deref().unwrap_or(own)
    }
}

impl CellForm {
    fn note(self) -> &'static str {
        match self {
            Self::MeanSe => "Values are mean ± standard error.",
            Self::CountInterval => {
                "Rates are counts of the episodes where the metric is defined, with Wilson 95 % intervals; other values \
                 are means with Student's 95 % intervals, n given where it is not all episodes, or where the interval is \
                 withheld."
            }
        }
    }
}

impl EmphasisRule {
    fn note(self) -> &'static str {
        match self {
            Self::None => "",
            Self::ExactMean | Self::PrintedMean => "The best means are in bold, the second-best are underlined.",
            Self::Tied => {
                "In bold: models that no test shows to be worse than another in the experiment, after Holm's adjustment; \
                 nothing where that is so of all."
            }
        }
    }
}

impl Decimals {
    pub fn of(self, kind: Kind) -> u32 {
        match kind {
            Kind::Rate => self.rate,
            Kind::Quantity => self.quantity,
        }
    }
}

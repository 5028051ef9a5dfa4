//! Style files as written: TOML in, every key accounted for, faults with their places.
//!
//! An included file comes first, and what the including file says replaces what it said: key by key in tables, whole lists.
//! Rule: nothing that an included file says is shown, for a path of someone else's style may lead to a secret.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use indexmap::IndexMap;

use super::{
    BUILT_IN, CellForm, ColumnSheet, Decimals, EmphasisRule, MAIN_TABLE, OTHER_TABLE, PrintSheet, Rounding, Sheet,
    SingleSe, StyleError, TableSheet, default_undefined,
};
use crate::figures::shown::{FigureSheets, SHOWN};
use crate::figures::{FigureError, FigureName};
use exact::budget::Limit;
use exact::suggest::{hint, nearest};
use exact::{hash, input};
use metric::catalog::Better;
use toml_spec::{Fault, Faults, Place, Source};
use toml_spec::{IncludeKind, Includes};
use toml_spec::{Keys, key_count, parse_toml};

/// A style is written by hand.
const LARGEST: Limit = Limit::new("bytes of a style", 1 << 20);
/// Keys of a file, tables included.
const MOST_KEYS: Limit = Limit::new("keys in a style", 10_000);
const INCLUDED: IncludeKind = IncludeKind {
    name: "style",
    check: "mirrorstats style check FILE",
    most: Limit::new("includes of a style, those of included files counted", 32),
};
const MOST_DECIMALS: u32 = exact::number::MOST_PLACES;

/// A style file and all that it includes.
pub(super) struct Read {
    pub sheet: Sheet,
    /// Every metric that a file of the user's names, and where.
    pub named: Vec<(String, Place)>,
    /// The SHA-256 of the text; with includes, of the hashes of all texts, one a line, in the order in which they are read.
    pub hash: String,
}

/// A style's text, and where it is.
struct StyleFile {
    source: Source,
    folder: Option<PathBuf>,
    /// Its one place on disk, whatever it is called; `None` if it is built in.
    place: Option<PathBuf>,
    is_built_in: bool,
}

pub(super) fn read(path: &Path) -> Result<Read, StyleError> {
    let file = match find(path, path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let name = path.display().to_string();
            let hint = hint(&name, BUILT_IN.map(|(name, _)| name));
            return Err(StyleError::Unknown { name, hint });
        }
        Err(source) => return Err(StyleError::Unreadable { path: path.to_owned(), source }),
    };
    let whole = Place {
        source: Arc::new(Source { name: file.source.name.clone(), text: file.source.text.clone() }),
        span: 0..0,
    };
    let mut reading = Reading::new();
    reading.file(file);
    reading.finish(&whole).map_err(|faults| StyleError::Faults(Faults(faults).in_order()))
}

fn find(name: &Path, path: &Path) -> io::Result<StyleFile> {
    if let Some((name, text)) = BUILT_IN.into_iter().find(|(known, _)| name == Path::new(known)) {
        let source = Source { name: format!("{name}.toml"), text: text.to_owned() };
        return Ok(StyleFile { source, folder: None, place: None, is_built_in: true });
    }
    let source = Source { name: path.display().to_string(), text: input::text(path, LARGEST)? };
    let (folder, place) = (path.parent().map(Path::to_owned), fs::canonicalize(path).ok());
    Ok(StyleFile { source, folder, place, is_built_in: false })
}

/// A table before it is whole.
#[derive(Default)]
struct TableDraft {
    title: Option<String>,
    note: Option<String>,
    label: Option<String>,
    columns: Option<Vec<String>>,
    print: PrintSheet,
    undefined_as_zero: Option<Vec<String>>,
    place: Option<Place>,
}

struct Reading {
    row_order: Option<Vec<String>>,
    undefined: Option<String>,
    emphasis_note: Option<String>,
    print: PrintSheet,
    column: IndexMap<String, ColumnSheet>,
    table: IndexMap<String, TableDraft>,
    figure: FigureSheets,
    named: Vec<(String, Place)>,
    faults: Vec<Fault>,
    includes: Includes,
    hashes: Vec<String>,
}

impl Reading {
    fn new() -> Self {
        Self {
            row_order: None,
            undefined: None,
            emphasis_note: None,
            print: PrintSheet::default(),
            column: IndexMap::new(),
            table: IndexMap::new(),
            figure: SHOWN.clone(),
            named: Vec::new(),
            faults: Vec::new(),
            includes: Includes::new(INCLUDED),
            hashes: Vec::new(),
        }
    }

    fn finish(mut self, whole: &Place) -> Result<Read, Vec<Fault>> {
        if self.faults.is_empty() && !self.table.contains_key(MAIN_TABLE) {
            let message = format!("there is no table `{MAIN_TABLE}`: every report needs one");
            let help = format!("add `[table.{MAIN_TABLE}]`, or `include = [\"default\"]`");
            self.faults.push(Fault::new(whole.clone(), message).help(help));
        }
        let mut tables = IndexMap::new();
        for (name, draft) in std::mem::take(&mut self.table) {
            // What an included file says is not shown, nor are its faults told twice.
            let own = draft.place.clone().filter(|place| place.source == whole.source);
            let place = own.unwrap_or_else(|| whole.clone());
            match draft.whole() {
                Ok(sheet) => drop(tables.insert(name, sheet)),
                Err(_) if !self.faults.is_empty() => {}
                Err(key) => self.faults.push(
                    Fault::new(place, format!("a table needs `{key}`")).help("add it, or include a style that has it"),
                ),
            }
        }
        if !self.faults.is_empty() {
            return Err(self.faults);
        }
        let sheet = Sheet {
            row_order: self.row_order.unwrap_or_default(),
            undefined: self.undefined.unwrap_or_else(default_undefined),
            emphasis_note: self.emphasis_note.unwrap_or_default(),
            print: self.print,
            column: self.column,
            table: tables,
            figure: self.figure,
        };
        let hash = match self.hashes.as_slice() {
            [one] => one.clone(),
            several => hash::of_bytes(several.join("\n").as_bytes()),
        };
        Ok(Read { sheet, named: self.named, hash })
    }

    fn file(&mut self, file: StyleFile) {
        self.hashes.push(hash::of_bytes(file.source.text.as_bytes()));
        let source = Arc::new(file.source);
        let (table, faults) = parse_toml(&source);
        if !faults.is_empty() {
            self.faults.extend(faults);
            return;
        }
        if let Err(exceeded) = MOST_KEYS.check(key_count(table.get_ref())) {
            self.faults.push(Fault::new(Place { source, span: 0..0 }, exceeded.to_string()));
            return;
        }
        self.includes.enter(&source.name, file.place);
        let mut root = Keys::new(&source, table.get_ref(), "a style");
        for (name, place) in root.texts("include", &mut self.faults).unwrap_or_default() {
            self.include(&name, place, file.folder.as_deref());
        }
        let before = self.named.len();
        self.contents(&mut root);
        if file.is_built_in {
            // What came with the program may name metrics that the definitions do not have.
            self.named.truncate(before);
        }
        root.refuse_the_rest(&mut self.faults);
        self.includes.leave();
    }

    fn contents(&mut self, root: &mut Keys) {
        let faults = &mut self.faults;
        let order = root.texts("row_order", faults);
        self.row_order = order.map(without_places).or(self.row_order.take());
        self.undefined = root.text("undefined", faults).map(|(text, _)| text).or(self.undefined.take());
        self.emphasis_note = root.text("emphasis_note", faults).map(|(text, _)| text).or(self.emphasis_note.take());
        self.print = over(printing(root, faults), self.print);
        for (metric, place, keys) in root.tables("column", faults) {
            let read = column(keys, faults);
            let sheet = self.column.entry(metric.clone()).or_default();
            sheet.latex = read.latex.or(sheet.latex.take());
            sheet.better = read.better.or(sheet.better);
            self.named.push((metric, place));
        }
        for (name, place, keys) in root.tables("table", faults) {
            let draft = self.table.entry(name.clone()).or_default();
            read_table(&name, place, keys, draft, &mut self.named, faults);
        }
        for (name, place, keys) in root.tables("figure", faults) {
            read_figure(&name, &place, keys, (&mut self.figure, &mut self.named), faults);
        }
    }

    fn include(&mut self, name: &str, place: Place, folder: Option<&Path>) {
        let Self { includes, faults, .. } = self;
        let Some(path) = includes.follow(name, &place, folder, faults) else { return };
        match find(Path::new(name), &path) {
            Ok(file) if includes.leads_back(&file.source.name, file.place.as_deref(), &place, faults) => {}
            Ok(file) => {
                let before = faults.len();
                self.file(file);
                self.includes.conceal(before, place, &mut self.faults);
            }
            Err(error) => {
                let names = BUILT_IN.map(|(name, _)| name);
                let help = match nearest(name, names) {
                    Some(near) => format!("did you mean the built-in `{near}`?"),
                    None => format!("a path is relative to this file; built-in styles are {}", names.join(", ")),
                };
                let message = format!("cannot read the style `{}`: {error}", path.display());
                includes.tell(Fault::new(place, message).help(help), faults);
            }
        }
    }
}

impl TableDraft {
    fn whole(self) -> Result<TableSheet, &'static str> {
        Ok(TableSheet {
            title: self.title.ok_or("title")?,
            note: self.note.unwrap_or_default(),
            label: self.label,
            columns: self.columns.ok_or("columns")?,
            print: self.print,
            undefined_as_zero: self.undefined_as_zero.unwrap_or_default(),
        })
    }
}

fn read_table(
    name: &str,
    place: Place,
    mut keys: Keys,
    draft: &mut TableDraft,
    named: &mut Vec<(String, Place)>,
    faults: &mut Vec<Fault>,
) {
    let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-' || b == b'_';
    if name.is_empty() || !name.bytes().all(is_plain) || name == OTHER_TABLE {
        let message = format!(
            "`{name}` cannot name a table: expected lowercase letters, digits, `-` and `_`, and not `{OTHER_TABLE}`"
        );
        faults.push(Fault::new(place.clone(), message).help("the name becomes that of a file"));
    }
    let text = |keys: &mut Keys, key, faults: &mut Vec<Fault>| keys.text(key, faults).map(|(text, _)| text);
    draft.title = text(&mut keys, "title", faults).or(draft.title.take());
    draft.note = text(&mut keys, "note", faults).or(draft.note.take());
    draft.label = text(&mut keys, "label", faults).or(draft.label.take());
    let whole = keys.value_place("columns");
    if let Some(columns) = keys.texts("columns", faults) {
        if columns.is_empty() {
            let message = format!("table `{name}` has no columns");
            faults.push(Fault::new(whole.unwrap_or(place.clone()), message).help("name at least one metric"));
        }
        refuse_repeated(name, &columns, faults);
        named.extend(columns.iter().cloned());
        draft.columns = Some(without_places(columns));
    }
    if let Some(zero) = keys.texts("undefined_as_zero", faults) {
        named.extend(zero.iter().cloned());
        draft.undefined_as_zero = Some(without_places(zero));
    }
    draft.print = over(printing(&mut keys, faults), draft.print);
    draft.place = Some(place);
    keys.refuse_the_rest(faults);
}

fn read_figure(
    name: &str,
    place: &Place,
    mut keys: Keys,
    (figures, named): (&mut FigureSheets, &mut Vec<(String, Place)>),
    faults: &mut Vec<Fault>,
) {
    let figure: FigureName = match name.parse() {
        Ok(figure) => figure,
        Err(unknown) => return faults.push(Fault::new(place.clone(), FigureError::to_string(&unknown))),
    };
    let sheet = figures.entry(name.to_owned()).or_default();
    let whole = keys.value_place("metrics").unwrap_or_else(|| place.clone());
    if let Some(metrics) = keys.texts("metrics", faults) {
        if let Err(wrong) = figure.check_count(metrics.len()) {
            faults.push(Fault::new(whole, FigureError::to_string(&wrong)));
        }
        named.extend(metrics.iter().cloned());
        sheet.metrics = Some(without_places(metrics));
    }
    let caption = keys.text("caption", faults).map(|(text, _)| text);
    sheet.caption = caption.or(sheet.caption.take());
    keys.refuse_the_rest(faults);
}

fn refuse_repeated(table: &str, columns: &[(String, Place)], faults: &mut Vec<Fault>) {
    for (at, (metric, place)) in columns.iter().enumerate() {
        if columns[..at].iter().any(|(before, _)| before == metric) {
            let message = format!("table `{table}`: the metric `{metric}` is listed twice");
            faults.push(Fault::new(place.clone(), message));
        }
    }
}

fn without_places(texts: Vec<(String, Place)>) -> Vec<String> {
    texts.into_iter().map(|(text, _)| text).collect()
}

fn column(mut keys: Keys, faults: &mut Vec<Fault>) -> ColumnSheet {
    let better = [("higher", Better::Higher), ("lower", Better::Lower), ("neither", Better::Neither)];
    let latex = keys.text("latex", faults).map(|(text, _)| text);
    let better = keys.choice("better", &better, faults);
    keys.refuse_the_rest(faults);
    ColumnSheet { latex, better }
}

fn printing(root: &mut Keys, faults: &mut Vec<Fault>) -> PrintSheet {
    let Some(mut keys) = root.table("print", faults) else { return PrintSheet::default() };
    let cell = [("mean_se", CellForm::MeanSe), ("count_interval", CellForm::CountInterval)];
    let rounding = [("once", Rounding::Once), ("once_binary", Rounding::OnceBinary), ("twice", Rounding::Twice)];
    let emphasis = [
        ("none", EmphasisRule::None),
        ("exact_mean", EmphasisRule::ExactMean),
        ("printed_mean", EmphasisRule::PrintedMean),
        ("tied", EmphasisRule::Tied),
    ];
    let single = [("undefined", SingleSe::Undefined), ("zero", SingleSe::Zero)];
    let sheet = PrintSheet {
        cell: keys.choice("cell", &cell, faults),
        rounding: keys.choice("rounding", &rounding, faults),
        decimals: decimals(&mut keys, faults),
        emphasis: keys.choice("emphasis", &emphasis, faults),
        single_se: keys.choice("single_se", &single, faults),
        mark_n_below: keys.count("mark_n_below", [0, u32::MAX], faults).map(|(count, _)| count.into()),
    };
    keys.refuse_the_rest(faults);
    sheet
}

fn decimals(print: &mut Keys, faults: &mut Vec<Fault>) -> Option<Decimals> {
    let whole = print.key_place("decimals");
    let mut keys = print.table("decimals", faults)?;
    let is_there = ["rate", "quantity"].map(|name| keys.has(name));
    let [rate, quantity] =
        ["rate", "quantity"].map(|name| keys.count(name, [0, MOST_DECIMALS], faults).map(|(count, _)| count));
    if is_there.contains(&false) {
        faults.push(Fault::new(whole, "`decimals` needs `rate` and `quantity`"));
    }
    keys.refuse_the_rest(faults);
    Some(Decimals { rate: rate?, quantity: quantity? })
}

/// What one file says over what those before it said.
fn over(new: PrintSheet, old: PrintSheet) -> PrintSheet {
    PrintSheet {
        cell: new.cell.or(old.cell),
        rounding: new.rounding.or(old.rounding),
        decimals: new.decimals.or(old.decimals),
        emphasis: new.emphasis.or(old.emphasis),
        single_se: new.single_se.or(old.single_se),
        mark_n_below: new.mark_n_below.or(old.mark_n_below),
    }
}

//! Maps the keys of steps to columns: those of the schema, which are checked against it, and own columns, whose types
//! follow from the values of all lines.
//!
//! Rule: a value is taken unchanged or refused: texts never become numbers, and numbers stay equal.

use std::collections::{BTreeMap, BTreeSet};

use arrow::array::{Array as _, ArrayRef, RecordBatch};
use indexmap::IndexMap;

use super::arrays::{array, changes, repeated, table};
use super::error::{Fault, Location};
use super::mapping::Order;
use super::value::Cell;
use super::{Limits, spelling};
use mirrorstats_exact::suggest::nearest;
use mirrorstats_identification::Reading;
use mirrorstats_trace::schema::rules::{Known, Requirement, Rule, rules_of};
use mirrorstats_trace::schema::{COLUMNS, Column, DeclaredColumn, Kind, Stored};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Own {
    pub name: String,
    /// The type of its values; `None` if they are all null.
    pub kind: Option<Kind>,
}

#[derive(Debug, Default)]
pub(super) struct Columns {
    known: Vec<&'static str>,
    own: IndexMap<String, Inferred>,
    /// True if attributions are read from texts.
    pub(super) is_derived: bool,
    /// The columns that mappings declare absent, by experiment.
    pub(super) absent: BTreeMap<String, BTreeSet<String>>,
}

#[derive(Debug, Default)]
struct Inferred {
    kind: Option<Kind>,
    first: Option<Location>,
    /// True if a value has a type of its own, which cells of CSV must fit.
    is_typed: bool,
    wide: Option<(Location, i64)>,
    /// The first cell that marks a missing value or is a number that floats do not hold. It is a text only among texts.
    odd: Option<(Location, String)>,
}

/// More than the own columns of any harness, but far fewer than keys that are data.
const MOST_OWN: usize = 1000;
/// 64-bit floats represent every integer up to this one.
const EXACT: u64 = 1 << 53;
const ABSENT: &str = "leave the cell empty where there is no value, or write null in JSON";
const UNHELD: &str = "write it as text in every line, or with fewer digits";
/// The attribution, and the text from which it is read if a step has no key for it.
pub(super) const ATTRIBUTION: &str = "self_color";
pub(super) const TEXT: &str = "identification";
const SEE: &str = "`mirrorstats trace schema step` prints what a step may hold";

impl Columns {
    /// The rows with the columns in the names of folders, and with attributions that are read from texts; a different
    /// value in a row is a fault.
    pub(super) fn completed(
        &mut self,
        rows: &RecordBatch,
        folders: &[(String, Option<String>)],
        limits: Limits<'_>,
    ) -> (RecordBatch, Vec<(usize, Fault)>) {
        let (mut faults, mut added) = (Vec::new(), Vec::new());
        let has = |name: &str| rows.column_by_name(name).is_some();
        if let Some(texts) = rows.column_by_name(TEXT)
            && limits.expected.domain.column(ATTRIBUTION).is_some()
            && !has(ATTRIBUTION)
        {
            self.is_derived = true;
            let colors = array((0..texts.len()).map(|row| attribution(Cell::at(texts, row))));
            added.push((ATTRIBUTION.to_owned(), colors));
        }
        for (name, value) in folders {
            let value = value.as_ref().map_or(Cell::Null, |value| Cell::Spelled(value.into()));
            let Some(values) = rows.column_by_name(name) else {
                added.push((name.clone(), repeated(value, rows.num_rows())));
                continue;
            };
            let kind = limits.kind(name);
            let value = value.typed(kind);
            for row in 0..values.len() {
                let found = Cell::at(values, row).typed(kind);
                if !is_same(&found, &value) {
                    let expected = format!("{}, as in the name of the folder `{name}=...`", value.shown());
                    let help = "move the file to the folder of its values, or correct the column";
                    faults.push((row, Fault::new(expected, found.shown(), help).of_key(name)));
                }
            }
        }
        let own =
            rows.schema_ref().fields().iter().map(|field| field.name().clone()).zip(rows.columns().iter().cloned());
        (table(own.chain(added).collect(), rows.num_rows()), faults)
    }

    /// The faults of these rows, each with its row.
    pub(super) fn check(
        &mut self,
        rows: &RecordBatch,
        place: &dyn Fn(usize) -> Location,
        (order, absent): (Order, &[String]),
        limits: Limits<'_>,
    ) -> Vec<(usize, Fault)> {
        let mut faults = Vec::new();
        self.declare_absent(rows, absent);
        for (field, values) in rows.schema_ref().fields().iter().zip(rows.columns()) {
            let (key, known) = (field.name(), limits.expected.domain.column(field.name()));
            if let Some(column) = known.filter(|column| !self.known.contains(&column.name)) {
                self.known.push(column.name);
            }
            let found = match known {
                Some(column) => misfits(column, values, order, limits),
                None => self.check_own(key, values, place, limits),
            };
            faults.extend(found.into_iter().map(|(row, fault)| (row, fault.of_key(key))));
        }
        let domain = limits.expected.domain;
        let has = |column: &Column| rows.column_by_name(column.name).is_some();
        let is_absent = |column: &Column| absent.iter().any(|name| name == column.name);
        let is_missing = |column: &&Column| column.required && domain.has(column) && !has(column) && !is_absent(column);
        for column in COLUMNS.iter().filter(is_missing) {
            let fault = missing(column, rows, limits);
            faults.extend((0..rows.num_rows()).map(|row| (row, fault.clone())));
        }
        faults
    }

    fn declare_absent(&mut self, rows: &RecordBatch, absent: &[String]) {
        let Some(experiments) = rows.column_by_name("experiment").filter(|_| !absent.is_empty()) else { return };
        for name in (0..rows.num_rows()).filter_map(|row| Some(Cell::at(experiments, row).text()?.into_owned())) {
            self.absent.entry(name).or_default().extend(absent.iter().cloned());
        }
    }

    pub(super) fn faults(&self) -> Vec<Fault> {
        let odd = |(name, inferred): (&String, &Inferred)| {
            let (place, cell) = inferred.odd.as_ref()?;
            let kind = inferred.kind.filter(|kind| *kind != Kind::String)?;
            let help = if spelling::is_absent(cell) { ABSENT } else { UNHELD };
            let found = Cell::Spelled(cell.into()).shown();
            Some(Fault::new(format!("{}, as in other rows", named(kind)), found, help).of_key(name).at(place))
        };
        let lossy = |(name, inferred): (&String, &Inferred)| {
            let (place, value) = inferred.wide.as_ref().filter(|_| inferred.kind == Some(Kind::Float))?;
            let expected = format!("a number that is exact beside those with fractions, at most {EXACT}");
            let help = "write the large numbers as text in every line, or the fractions under another key";
            Some(Fault::new(expected, value.to_string(), help).of_key(name).at(place))
        };
        self.own.iter().filter_map(odd).chain(self.own.iter().filter_map(lossy)).collect()
    }

    pub(super) fn known(&self) -> impl Iterator<Item = &'static Column> + '_ {
        COLUMNS.iter().filter(|column| self.known.contains(&column.name))
    }

    pub(super) fn own(&self) -> Vec<Own> {
        self.own.iter().map(|(name, inferred)| Own { name: name.clone(), kind: inferred.kind() }).collect()
    }

    fn check_own(
        &mut self,
        key: &str,
        values: &ArrayRef,
        place: &dyn Fn(usize) -> Location,
        limits: Limits<'_>,
    ) -> Vec<(usize, Fault)> {
        let refused = if key.is_empty() {
            Some(Fault::new("a key with a name", "an empty one", "give the key a name, or leave it out"))
        } else if !self.own.contains_key(key) && self.own.len() == MOST_OWN {
            let help = "keys are the same in all lines; write what changes from line to line as a value";
            Some(Fault::new(format!("at most {MOST_OWN} keys that the schema does not know"), "one more", help))
        } else {
            None
        };
        if let Some(fault) = refused {
            // Rows without the key have a null too.
            let given = (0..values.len()).filter(|row| Cell::at(values, *row) != Cell::Null);
            return given.map(|row| (row, fault.clone())).collect();
        }
        let declared = limits.declared(key);
        let inferred = self.own.entry(key.to_owned()).or_default();
        if declared.is_none() && inferred.is_of(values) {
            return Vec::new();
        }
        each_change(values, |row| {
            let value = Cell::at(values, row).typed(declared.map(|declared| declared.kind));
            let fault = declared.and_then(|declared| misdeclared(declared, &value));
            fault.or_else(|| inferred.take(&value, &|| place(row)))
        })
    }
}

impl Inferred {
    fn kind(&self) -> Option<Kind> {
        self.kind.or(self.odd.as_ref().map(|_| Kind::String))
    }

    /// Returns true if the values are of the type so far, and all of them are held by it.
    fn is_of(&self, values: &ArrayRef) -> bool {
        let is_simple = matches!(self.kind, Some(Kind::Bool | Kind::Float | Kind::String));
        is_simple && self.is_typed && self.kind.map(Kind::data_type).as_ref() == Some(values.data_type())
    }

    fn take(&mut self, value: &Cell<'_>, place: &dyn Fn() -> Location) -> Option<Fault> {
        let now = match kind_of(value) {
            Ok(now) => now?,
            Err(fault) => return Some(*fault),
        };
        if let Cell::Spelled(cell) = value
            && spelling::is_odd(cell)
        {
            self.odd.get_or_insert_with(|| (place(), cell.to_string()));
            return None;
        }
        let is_cell = matches!(value, Cell::Spelled(_));
        if let Some(value) = integer(value).filter(|value| value.unsigned_abs() > EXACT && self.wide.is_none()) {
            self.wide = Some((place(), value));
        }
        let are_cells = !self.is_typed && is_cell;
        self.is_typed |= !is_cell;
        let Some((before, first)) = self.kind.zip(self.first.as_ref()) else {
            (self.kind, self.first) = (Some(now), Some(place()));
            return None;
        };
        match (before, now) {
            (before, now) if before == now => None,
            (Kind::String, _) if is_cell => None,
            (before, now) if are_cells => {
                self.kind = Some(spelling::joined(before, now));
                None
            }
            (Kind::Int, Kind::Float) | (Kind::Float, Kind::Int) => {
                self.kind = Some(Kind::Float);
                None
            }
            _ => {
                let expected = format!("{}, as in {first}", named(before));
                Some(Fault::new(expected, value.shown(), "write the key with values of one type in all lines"))
            }
        }
    }
}

fn attribution(text: Cell<'_>) -> Cell<'static> {
    let Cell::Text(text) = text.typed(Kind::String) else { return Cell::Null };
    Reading::of(&text).self_color().map_or(Cell::Null, |color| Cell::Text(color.to_owned().into()))
}

/// Returns true if a value equals that of a folder's name, whose type may be unknown.
fn is_same(value: &Cell<'_>, folder: &Cell<'_>) -> bool {
    value == folder || value.kind().is_some_and(|kind| folder.clone().typed(kind) == value.clone().typed(kind))
}

fn integer(value: &Cell<'_>) -> Option<i64> {
    match value {
        Cell::Int(value) => Some(*value),
        Cell::Spelled(text) => text.parse().ok(),
        _ => None,
    }
}

fn named(kind: Kind) -> &'static str {
    match kind {
        Kind::Bool => "true or false",
        Kind::Int | Kind::Float => "a number",
        Kind::String | Kind::Unsupported => "a text",
    }
}

fn kind_of(value: &Cell<'_>) -> Result<Option<Kind>, Box<Fault>> {
    match value {
        Cell::Unheld(_) => Err(Box::new(Fault::new(spelling::held(), value.shown(), UNHELD))),
        Cell::List | Cell::Object => {
            let help = "give its parts keys of their own, write it as text, or leave it out";
            Err(Box::new(Fault::new("null, true or false, a number or a text", value.shown(), help)))
        }
        value => Ok(value.kind()),
    }
}

fn misfits(column: &Column, values: &ArrayRef, order: Order, limits: Limits<'_>) -> Vec<(usize, Fault)> {
    let Limits { expected, palette, .. } = limits;
    let rules = rules_of(column, Known { palette, experiments: expected.experiments });
    let is_ordered = column.name == "t" && order != Order::Numbers;
    each_change(values, |row| {
        let value = Cell::at(values, row).typed(column.stored.kind());
        if is_ordered && value.int().is_some() { None } else { misfit(column, &value, &rules) }
    })
}

/// The faults of all rows, given the check of a row. A value that repeats the one before is not checked again.
fn each_change(values: &ArrayRef, mut fault: impl FnMut(usize) -> Option<Fault>) -> Vec<(usize, Fault)> {
    let (mut faults, mut last) = (Vec::new(), None);
    for (row, is_new) in changes(values).iter().enumerate() {
        if is_new {
            last = fault(row);
        }
        faults.extend(last.clone().map(|fault| (row, fault)));
    }
    faults
}

fn misfit(column: &Column, value: &Cell<'_>, rules: &[Rule<'_>]) -> Option<Fault> {
    let refused = |help: &str| Some(Fault::new(expected(column), value.shown(), help));
    match (column.stored.kind(), value) {
        (_, Cell::Null) if column.nullable => None,
        (_, Cell::Null) => refused("give the step its value; nothing is filled in"),
        (Kind::Bool, Cell::Bool(_)) => None,
        (Kind::Int, Cell::Int(value)) if *value < lowest(column) => {
            refused(if column.name == "t" { "number the steps from 1" } else { "correct the number" })
        }
        (Kind::Int, Cell::Int(value)) if column.stored.range().is_none_or(|(_, highest)| *value <= highest) => None,
        (Kind::Int, Cell::Float(value)) if value.fract() != 0.0 => refused("write a whole number"),
        (Kind::Int, Cell::Int(_) | Cell::Unheld(_) | Cell::Float(_)) => {
            refused("correct the number, or use smaller ones")
        }
        (Kind::Float, _) if is_held(column, value) => None,
        (Kind::Float, Cell::Unheld(_)) => refused("64-bit floats do not hold it: write fewer digits"),
        (Kind::Float, Cell::Int(_) | Cell::Float(_)) => refused("correct the number"),
        (Kind::String, Cell::Text(text)) => {
            rules.iter().find(|rule| !rule.allows(text)).map(|rule| odd_text(column, rule, text, value.shown()))
        }
        _ if is_absent(value) => refused(ABSENT),
        _ => refused(SEE),
    }
}

fn misdeclared(declared: &DeclaredColumn, value: &Cell<'_>) -> Option<Fault> {
    let is_of_kind = matches!(
        (declared.kind, value),
        (_, Cell::Null)
            | (Kind::Bool, Cell::Bool(_))
            | (Kind::Int, Cell::Int(_))
            | (Kind::Float, Cell::Int(_) | Cell::Float(_))
            | (Kind::String, Cell::Text(_))
    );
    let help = "correct the value, or declare the column as the lines have it, under `[column.NAME]`";
    let is_held = !matches!(value, Cell::Unheld(_)) && !matches!(value, Cell::Int(number) if !is_exact(*number));
    if declared.kind == Kind::Float && !is_held {
        let expected = format!("a number that 64-bit floats hold exactly, as the integers up to {EXACT}");
        return Some(Fault::new(expected, value.shown(), help));
    }
    if !is_of_kind {
        let what = if declared.kind == Kind::Int { "an integer of 64 bits" } else { named(declared.kind) };
        let (or_null, help) = if is_absent(value) { (", or null", ABSENT) } else { ("", help) };
        let expected = format!("{what}, as the definitions declare it{or_null}");
        return Some(Fault::new(expected, value.shown(), help));
    }
    let Cell::Text(text) = value else { return None };
    let is_known = declared.values.is_empty() || declared.values.iter().any(|value| value == text);
    let near =
        || nearest(text, declared.values.iter().map(String::as_str)).map(|like| format!("did you mean `{like}`?"));
    let expected = || format!("one of {}, or null", declared.values.join(", "));
    (!is_known).then(|| Fault::new(expected(), value.shown(), near().unwrap_or_else(|| help.to_owned())))
}

fn is_absent(value: &Cell<'_>) -> bool {
    matches!(value, Cell::Text(text) if spelling::is_absent(text))
}

#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "that is the question")]
fn is_exact(number: i64) -> bool {
    (number as f64) as i128 == i128::from(number)
}

pub(super) fn lowest(column: &Column) -> i64 {
    match column.stored.range() {
        _ if column.name == "t" => 1,
        _ if column.counts => 0,
        Some((lowest, _)) => lowest,
        None => i64::MIN,
    }
}

#[expect(clippy::cast_precision_loss, reason = "it is exact")]
#[expect(clippy::cast_possible_truncation, reason = "that is the question")]
fn is_held(column: &Column, value: &Cell<'_>) -> bool {
    let number = match value {
        Cell::Int(value) if is_exact(*value) => *value as f64,
        Cell::Float(value) => *value,
        _ => return false,
    };
    let fits = column.stored != Stored::Float32 || (number as f32).is_finite();
    fits && !(column.counts && number < 0.0)
}

pub(super) fn expected(column: &Column) -> String {
    let what = match column.stored.kind() {
        Kind::Bool => "true or false".to_owned(),
        Kind::Int => {
            let highest = column.stored.range().map_or(i64::MAX, |(_, highest)| highest);
            format!("an integer from {} to {highest}", lowest(column))
        }
        Kind::Float if column.counts => "a number from 0".to_owned(),
        Kind::Float => "a number".to_owned(),
        _ if !column.values.is_empty() => format!("one of {}", column.values.join(", ")),
        _ if column.names() => "a text that is not empty".to_owned(),
        _ => "a text".to_owned(),
    };
    if column.nullable { format!("{what}, or null") } else { what }
}

fn odd_text(column: &Column, rule: &Rule<'_>, text: &str, found: String) -> Fault {
    match rule.asks {
        Requirement::Color(color, palette) => Fault::new(color.expected(palette), found, color.help(text, palette)),
        Requirement::Experiment(known) => {
            let like = nearest(text, known.iter().map(String::as_str));
            let like = like.map(|like| format!("did you mean `{like}`? Otherwise ")).unwrap_or_default();
            let help = format!("{like}name the definition file that knows it with --definitions");
            Fault::new(rule.expected(), found, help)
        }
        Requirement::OneOf(names) => {
            let like = nearest(text, names.iter().copied()).map(|like| format!("did you mean `{like}`?"));
            Fault::new(expected(column), found, like.unwrap_or_else(|| SEE.to_owned()))
        }
        _ => Fault::new(expected(column), found, "give the name, or null where allowed"),
    }
}

fn missing(column: &Column, rows: &RecordBatch, limits: Limits<'_>) -> Fault {
    let is_own = |key: &&str| limits.expected.domain.column(key).is_none();
    let strangers = rows.schema_ref().fields().iter().map(|field| field.name().as_str()).filter(is_own);
    let found =
        nearest(column.name, strangers).map_or("none".to_owned(), |key| format!("none, though there is `{key}`"));
    let help = match column.name {
        "model" | "experiment" | "seed" | "run" => {
            "name the key that has it with --map, or give it to every step with --set"
        }
        _ if column.nullable => "write null where the reply gave none",
        _ => SEE,
    };
    Fault::new(expected(column), found, help).of_key(column.name)
}

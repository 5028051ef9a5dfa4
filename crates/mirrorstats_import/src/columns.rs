//! Maps the keys of steps to columns: those of the schema, which are checked against it, and own columns, whose types
//! follow from the values of all lines.
//!
//! Rule: a value is taken unchanged or refused: texts never become numbers, and numbers stay equal.

use indexmap::IndexMap;

use super::error::{Fault, Location};
use super::value::{LineValue, Members, whole};
use super::{Limits, cell};
use mirrorstats_exact::suggest::nearest;
use mirrorstats_trace::episodes::identification::normal_form;
use mirrorstats_trace::schema::rules::{Known, Requirement, Rule, rules_of};
use mirrorstats_trace::schema::{COLUMNS, Column, Kind, Stored};

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
    /// The values with the types that the schema or the definitions give their columns: cells of CSV, and whole numbers
    /// with a point, which data frames write beside missing values.
    ///
    /// Columns in the names of folders are added; a different value in the row is a fault.
    pub(super) fn typed(members: Members, folders: &Members, limits: Limits<'_>) -> (Members, Option<Fault>) {
        let mut members = Self::with_types(members, limits);
        if Self::lacks_attribution(&members, limits) {
            let text = members.iter().find(|(key, _)| key == TEXT).and_then(|(_, value)| attribution(value));
            members.push((ATTRIBUTION.to_owned(), text.map_or(LineValue::Null, LineValue::Text)));
        }
        let mut fault = None;
        for (key, value) in Self::with_types(folders.clone(), limits) {
            match members.iter().find(|(name, _)| *name == key) {
                None => members.push((key, value)),
                Some((_, found)) if is_same(found, &value) => {}
                Some((_, found)) => {
                    let expected = format!("{}, as in the name of the folder `{key}=...`", value.shown());
                    let help = "move the file to the folder of its values, or correct the column";
                    fault = Some(Fault::new(expected, found.shown(), help).of_key(&key));
                }
            }
        }
        (members, fault)
    }

    /// Returns true if the attribution is read from the text of the reply, since the step has no other.
    pub(super) fn lacks_attribution(members: &Members, limits: Limits<'_>) -> bool {
        let has = |name: &str| members.iter().any(|(key, _)| key == name);
        limits.expected.domain.column(ATTRIBUTION).is_some() && has(TEXT) && !has(ATTRIBUTION)
    }

    fn with_types(mut members: Members, limits: Limits<'_>) -> Members {
        let Limits { expected, .. } = limits;
        let declared = |key: &str| expected.declared.iter().find(|declared| declared.name == key);
        for (key, value) in &mut members {
            let known = expected.domain.column(key).map(|column| column.stored.kind());
            let Some(kind) = known.or_else(|| Some(declared(key)?.kind)) else { continue };
            match value {
                LineValue::Cell(text) => *value = cell::typed(text, kind),
                LineValue::Unheld(text) if kind == Kind::Float => *value = cell::typed(text, kind),
                LineValue::Float(number) if kind == Kind::Int => {
                    *value = whole(*number).map_or(LineValue::Float(*number), LineValue::Int);
                }
                _ => {}
            }
        }
        members
    }

    pub(super) fn with_cells(&self, mut members: Members) -> Members {
        for (key, value) in &mut members {
            if let (LineValue::Cell(text), Some(kind)) = (&*value, self.own.get(key).and_then(Inferred::kind)) {
                *value = cell::typed(text, kind);
            }
        }
        members
    }

    pub(super) fn check(&mut self, members: &Members, place: &Location, limits: Limits<'_>) -> Vec<Fault> {
        let mut faults = Vec::new();
        for (key, value) in members {
            let fault = match limits.expected.domain.column(key) {
                Some(column) => {
                    if !self.known.contains(&column.name) {
                        self.known.push(column.name);
                    }
                    misfit(column, value, limits)
                }
                None => misdeclared(key, value, limits).or_else(|| self.check_own(key, value, place)),
            };
            faults.extend(fault.map(|fault| fault.of_key(key).at(place)));
        }
        let has = |name: &str| members.iter().any(|(key, _)| key == name);
        let domain = limits.expected.domain;
        for column in COLUMNS.iter().filter(|column| column.required && domain.has(column) && !has(column.name)) {
            faults.push(missing(column, members, limits).at(place));
        }
        faults
    }

    pub(super) fn faults(&self) -> Vec<Fault> {
        let odd = |(name, inferred): (&String, &Inferred)| {
            let (place, cell) = inferred.odd.as_ref()?;
            let kind = inferred.kind.filter(|kind| *kind != Kind::String)?;
            let help = if cell::is_absent(cell) { ABSENT } else { UNHELD };
            let found = LineValue::Cell(cell.clone()).shown();
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

    fn check_own(&mut self, key: &str, value: &LineValue, place: &Location) -> Option<Fault> {
        if key.is_empty() {
            return Some(Fault::new("a key with a name", "an empty one", "give the key a name, or leave it out"));
        }
        let kind = match kind_of(value) {
            Ok(kind) => kind,
            Err(fault) => return Some(*fault),
        };
        if !self.own.contains_key(key) && self.own.len() == MOST_OWN {
            let found = "one more";
            let help = "keys are the same in all lines; write what changes from line to line as a value";
            return Some(Fault::new(format!("at most {MOST_OWN} keys that the schema does not know"), found, help));
        }
        self.own.entry(key.to_owned()).or_default().take(kind, value, place)
    }
}

impl Inferred {
    fn kind(&self) -> Option<Kind> {
        self.kind.or(self.odd.as_ref().map(|_| Kind::String))
    }

    fn take(&mut self, kind: Option<Kind>, value: &LineValue, place: &Location) -> Option<Fault> {
        let now = kind?;
        if let LineValue::Cell(cell) = value
            && cell::is_odd(cell)
        {
            self.odd.get_or_insert_with(|| (place.clone(), cell.clone()));
            return None;
        }
        let is_cell = matches!(value, LineValue::Cell(_));
        if let Some(value) = integer(value).filter(|value| value.unsigned_abs() > EXACT && self.wide.is_none()) {
            self.wide = Some((place.clone(), value));
        }
        let are_cells = !self.is_typed && is_cell;
        self.is_typed |= !is_cell;
        let Some((before, first)) = self.kind.zip(self.first.as_ref()) else {
            (self.kind, self.first) = (Some(now), Some(place.clone()));
            return None;
        };
        match (before, now) {
            (before, now) if before == now => None,
            (Kind::String, _) if is_cell => None,
            (before, now) if are_cells => {
                self.kind = Some(cell::joined(before, now));
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

fn attribution(text: &LineValue) -> Option<String> {
    let LineValue::Text(text) = text else { return None };
    normal_form(text).map(str::to_owned)
}

/// Returns true if a value equals that of a folder's name, whose type may be unknown.
fn is_same(value: &LineValue, folder: &LineValue) -> bool {
    let cell = |text: &String| kind_of(value).ok().flatten().map(|kind| cell::typed(text, kind));
    value == folder || matches!(folder, LineValue::Cell(text) if cell(text).as_ref() == Some(value))
}

fn integer(value: &LineValue) -> Option<i64> {
    match value {
        LineValue::Int(value) => Some(*value),
        LineValue::Cell(text) => text.parse().ok(),
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

fn kind_of(value: &LineValue) -> Result<Option<Kind>, Box<Fault>> {
    match value {
        LineValue::Null => Ok(None),
        LineValue::Bool(_) => Ok(Some(Kind::Bool)),
        LineValue::Int(_) => Ok(Some(Kind::Int)),
        LineValue::Float(_) => Ok(Some(Kind::Float)),
        LineValue::Text(_) => Ok(Some(Kind::String)),
        LineValue::Cell(text) => Ok(Some(cell::kind_of(text))),
        LineValue::Unheld(_) => {
            let expected = format!("an integer of at most {}, or a number that 64-bit floats hold", i64::MAX);
            Err(Box::new(Fault::new(expected, value.shown(), UNHELD)))
        }
        LineValue::List | LineValue::Object(_) => {
            let help = "give its parts keys of their own, write it as text, or leave it out";
            Err(Box::new(Fault::new("null, true or false, a number or a text", value.shown(), help)))
        }
    }
}

fn misfit(column: &Column, value: &LineValue, limits: Limits<'_>) -> Option<Fault> {
    let refused = |help: &str| Some(Fault::new(expected(column), value.shown(), help));
    match (column.stored.kind(), value) {
        (_, LineValue::Null) if column.nullable => None,
        (_, LineValue::Null) => refused("give the step its value; nothing is filled in"),
        (Kind::Bool, LineValue::Bool(_)) => None,
        (Kind::Int, LineValue::Int(value)) if *value < lowest(column) => {
            refused(if column.name == "t" { "number the steps from 1" } else { "correct the number" })
        }
        (Kind::Int, LineValue::Int(value)) if column.stored.range().is_none_or(|(_, highest)| *value <= highest) => {
            None
        }
        (Kind::Int, LineValue::Float(value)) if value.fract() != 0.0 => refused("write a whole number"),
        (Kind::Int, LineValue::Int(_) | LineValue::Unheld(_) | LineValue::Float(_)) => {
            refused("correct the number, or use smaller ones")
        }
        (Kind::Float, _) if is_held(column, value) => None,
        (Kind::Float, LineValue::Unheld(_)) => refused("64-bit floats do not hold it: write fewer digits"),
        (Kind::Float, LineValue::Int(_) | LineValue::Float(_)) => refused("correct the number"),
        (Kind::String, LineValue::Text(text)) => {
            let Limits { expected, palette, .. } = limits;
            let rules = rules_of(column, Known { palette, experiments: expected.experiments });
            rules.iter().find(|rule| !rule.allows(text)).map(|rule| odd_text(column, rule, text, value.shown()))
        }
        _ if is_absent(value) => refused(ABSENT),
        _ => refused(SEE),
    }
}

fn misdeclared(key: &str, value: &LineValue, limits: Limits<'_>) -> Option<Fault> {
    let declared = limits.expected.declared.iter().find(|declared| declared.name == key)?;
    let is_of_kind = matches!(
        (declared.kind, value),
        (_, LineValue::Null)
            | (Kind::Bool, LineValue::Bool(_))
            | (Kind::Int, LineValue::Int(_))
            | (Kind::Float, LineValue::Int(_) | LineValue::Float(_))
            | (Kind::String, LineValue::Text(_))
    );
    let help = "correct the value, or declare the column as the lines have it, under `[column.NAME]`";
    let is_held =
        !matches!(value, LineValue::Unheld(_)) && !matches!(value, LineValue::Int(number) if !is_exact(*number));
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
    let LineValue::Text(text) = value else { return None };
    let is_known = declared.values.is_empty() || declared.values.contains(text);
    let near =
        || nearest(text, declared.values.iter().map(String::as_str)).map(|like| format!("did you mean `{like}`?"));
    let expected = || format!("one of {}, or null", declared.values.join(", "));
    (!is_known).then(|| Fault::new(expected(), value.shown(), near().unwrap_or_else(|| help.to_owned())))
}

fn is_absent(value: &LineValue) -> bool {
    matches!(value, LineValue::Text(text) if cell::is_absent(text))
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
fn is_held(column: &Column, value: &LineValue) -> bool {
    let number = match value {
        LineValue::Int(value) if is_exact(*value) => *value as f64,
        LineValue::Float(value) => *value,
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

fn missing(column: &Column, members: &Members, limits: Limits<'_>) -> Fault {
    let is_own = |key: &&str| limits.expected.domain.column(key).is_none();
    let strangers = members.iter().map(|(key, _)| key.as_str()).filter(is_own);
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

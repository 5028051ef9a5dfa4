//! Drafts the mapping and the definitions for a file whose columns have names of their own.
//!
//! Rule: a draft is text for a person to read. Each choice says which values made it, and what is not chosen is said.

mod rows;

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::LazyLock;

use indexmap::IndexMap;
use mirrorstats_exact::format::counted;
use mirrorstats_trace::schema::domain::is_general;
use mirrorstats_trace::schema::{Kind, column};
use serde::Deserialize;

use super::error::{Fault, ImportError};
use super::format::Format;
use super::mapping::Mapping;
use super::notes::Notes;
use super::spelling;
use super::text::Text;
use super::value::Cell;
use rows::{Rows, names_of};

/// A draft of one file for `--from` and `--definitions`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draft {
    pub text: String,
    /// What the choices rest on.
    pub reasons: Vec<String>,
}

/// More rows than these are not looked at.
const MOST_ROWS: usize = 100_000;
/// A draft with more metrics is no draft that a person reads.
const MOST_METRICS: usize = 12;
/// Digits after the point of a float whose values have more than a metric can have.
const ROUNDED: usize = 3;

/// The words of `assets/import/guess.toml`, which explains them.
#[derive(Deserialize)]
struct Words {
    model: Vec<String>,
    experiment: Vec<String>,
    episode: Vec<String>,
    seed: Vec<String>,
    run: Vec<String>,
    t: Vec<String>,
    success: Vec<String>,
    yes: Vec<String>,
    no: Vec<String>,
    lower: Vec<String>,
    higher: Vec<String>,
    summed: Vec<String>,
    units: IndexMap<String, String>,
}

static WORDS: LazyLock<Words> = LazyLock::new(|| {
    let text = include_str!("../../../../assets/import/guess.toml");
    toml::from_str(text).expect("the tests draft with the words in `assets/import`")
});

/// Drafts how this file is read and scored. Errors: a file that cannot be read, or that has no rows.
pub fn guess(path: &Path) -> Result<Draft, ImportError> {
    let mut text = Text::open(path)?;
    let (own_format, values) = text.sample(MOST_ROWS)?;
    let is_object = values.as_ref().is_some_and(|values| values.len() == 1);
    let rows = if let Some(values) = values {
        Rows::of_values(&values)
    } else {
        text.read(&Mapping::default(), None, &mut Notes::default())?;
        Rows::of_tables(&text)?
    };
    if let Some(path) = rows.only_lists() {
        let expected = "rows: an object per episode or step, in a list or one per line".into();
        let found = format!("an object of lists, such as `{path}`");
        let help = "write one object, or one line of CSV, for each item of the lists".into();
        return Err(Fault { expected, found, help, ..Fault::of_file(&text.name) }.into());
    }
    if rows.count == 0 {
        let help = "name a file with rows, or write the mapping by hand: docs/how-to/domains.md";
        return Err(Fault {
            expected: "rows".into(),
            found: "none".into(),
            help: help.into(),
            ..Fault::of_file(&text.name)
        }
        .into());
    }
    let stem = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let stem = stem.split('.').next().unwrap_or_default();
    let is_json = is_object && !rows.list.is_empty();
    let format = own_format.or_else(|| is_json.then_some(Format::Json));
    let is_mapped = own_format.is_some();
    Ok(Drafting { rows, format, is_mapped, stem: identifier(stem), reasons: Vec::new() }.draft())
}

fn identifier(text: &str) -> String {
    let name: String = text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let name = name.trim_matches('_').to_owned();
    if name.starts_with(|c: char| c.is_ascii_digit()) || name.is_empty() { format!("x_{name}") } else { name }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

struct Drafting {
    rows: Rows,
    format: Option<Format>,
    /// True if the format has a mapping, so that only values which it does not give need an entry.
    is_mapped: bool,
    stem: String,
    reasons: Vec<String>,
}

/// The paths of a file's hash and of the position of a row in the file: an id where no column is one.
const ROW_OF_FILE: [&str; 2] = ["file#", "#"];

/// The columns that every trace has: entries of the mapping by their names.
type Entries = IndexMap<String, String>;

impl Drafting {
    fn draft(mut self) -> Draft {
        let (mut entries, taken) = self.identity();
        let mut tables = String::new();
        self.columns(&mut entries, &taken, &mut tables);
        let mut text = format!(
            "# A draft: read it, correct it, then name it with --from and --definitions, or with --definitions alone\n\
             # where a command takes logs.\ndomain = {}\n\n[import]\n",
            quoted(&self.stem)
        );
        if let Some(format) = self.format {
            let _ = writeln!(text, "format = {}", quoted(format.name()));
        }
        if !self.rows.list.is_empty() {
            let _ = writeln!(text, "rows = {}", quoted(&self.rows.list));
        }
        text.push_str("\n[import.columns]\n");
        let is_written = |name: &str| !self.is_mapped || !self.rows.columns.contains_key(name);
        for (name, entry) in entries.iter().filter(|(name, _)| is_written(name)) {
            let _ = writeln!(text, "{name} = {entry}");
        }
        if self.rows.is_cut {
            self.reasons.push(format!("only the first {} rows were looked at", self.rows.count));
        }
        Draft { text: text + &tables, reasons: self.reasons }
    }

    /// The entries for identity and time, and the paths that they take.
    fn identity(&mut self) -> (Entries, HashSet<String>) {
        let is_integer = |values: &[Cell<'_>]| kind(values) == Some(Kind::Int) && !values.contains(&Cell::Null);
        let is_there = |values: &[Cell<'_>]| values.iter().all(|value| value.text().is_some());
        let rows = &self.rows;
        let mut found = [
            ("model", rows.named(&WORDS.model, is_there)),
            ("experiment", rows.named(&WORDS.experiment, is_there)),
            ("seed", rows.named(&WORDS.seed, is_integer)),
            ("run", rows.named(&WORDS.run, is_integer)),
        ];
        let (own_id, t) = (rows.named(&WORDS.episode, is_there), rows.named(&WORDS.t, is_integer));
        let is_open = found[0].1.is_none() && own_id.is_none() && t.is_none();
        if is_open {
            let others: Vec<String> = found.iter().filter_map(|(_, path)| path.clone()).collect();
            let is_text = |values: &[Cell<'_>]| kind(values) == Some(Kind::String) && is_there(values);
            found[0].1 = rows.distinguishing(&others, is_text).map(str::to_owned);
        }
        let parts: Vec<String> = found.iter().filter_map(|(_, path)| path.clone()).collect();
        let id = self.id(&parts, own_id);
        let known: Vec<String> = id.iter().filter(|path| !ROW_OF_FILE.contains(&path.as_str())).cloned().collect();
        let distinct = |paths: &[String]| rows.keys(paths).into_iter().collect::<HashSet<_>>().len();
        let episodes = if known.is_empty() { rows.count } else { distinct(&known) };
        let is_single = episodes == rows.count;
        let ordered = t.filter(|t| distinct(&[known.clone(), vec![t.clone()]].concat()) == rows.count);

        let mut entries = Entries::new();
        let own_id = match &*id {
            [path] => quoted(path),
            paths => quoted(&paths.iter().map(|path| format!("{{{path}}}")).collect::<Vec<_>>().join("/")),
        };
        entries.insert("episode_id".into(), own_id);
        for (name, path) in &found {
            let is_text = matches!(*name, "model" | "experiment");
            let constant = if is_text { format!("{{ value = {} }}", quoted(&self.stem)) } else { "1".to_owned() };
            entries.insert((*name).into(), path.as_deref().map_or(constant, quoted));
        }
        let (number, reason) = match &ordered {
            _ if is_single => ("1".to_owned(), "`t` is 1: each episode has one row".to_owned()),
            Some(t) => (format!("{{ from = {}, start = 1 }}", quoted(t)), format!("`t` counts `{t}` from 1")),
            None => {
                let reason = "`t` is the order of the rows: no integer numbers the rows of an episode";
                ("{ start = 1 }".to_owned(), reason.to_owned())
            }
        };
        entries.insert("t".into(), number);

        let names = |paths: &[String]| paths.iter().map(|path| format!("`{path}`")).collect::<Vec<_>>().join(", ");
        let mut reasons = vec![format!(
            "{} in {}: an episode has its own {}",
            counted(rows.count as u64, "row"),
            counted(episodes as u64, "episode"),
            if known.is_empty() { "row, for no column has the name of an id".to_owned() } else { names(&known) }
        )];
        reasons.extend(found.iter().map(|(name, path)| match path {
            Some(path) => {
                let values = distinct(std::slice::from_ref(path)) as u64;
                format!("`{name}` is `{path}`, with {}", counted(values, "value"))
            }
            None => format!("`{name}` is the same in all rows: no column has such a name"),
        }));
        if is_open && found[0].1.is_some() {
            let reason = "no column has the name of a model: this one tells apart rows that are otherwise one episode";
            reasons.push(reason.to_owned());
        }
        reasons.push(reason);
        self.reasons = reasons;
        let used = parts.into_iter().chain(id).chain(ordered).collect();
        (entries, used)
    }

    /// The paths whose values tell episodes apart, given those of identity and an id of the file.
    fn id(&self, parts: &[String], own: Option<String>) -> Vec<String> {
        // An id of the file is enough if everything else is constant in its episodes.
        let is_enough = |own: &String| {
            let mut by_id = HashMap::new();
            let ids = self.rows.keys(std::slice::from_ref(own)).into_iter();
            ids.zip(self.rows.keys(parts))
                .all(|(id, others)| *by_id.entry(id).or_insert_with(|| others.clone()) == others)
        };
        match own {
            Some(own) if is_enough(&own) => vec![own],
            Some(own) if !parts.contains(&own) => [parts, &[own]].concat(),
            _ if parts.is_empty() => ROW_OF_FILE.map(str::to_owned).to_vec(),
            _ => parts.to_vec(),
        }
    }

    /// The other columns: entries where their names are no names of columns, and their metrics.
    fn columns(&mut self, entries: &mut Entries, taken: &HashSet<String>, tables: &mut String) {
        let is_single = entries["t"] == "1";
        let (mut columns, mut metrics, mut left) = (String::new(), Vec::new(), Vec::new());
        if !is_single {
            metrics.push(metric("STEPS", "Steps", "length()", Some("lower")));
        }
        let mut has_success = false;
        // In capitals, as metrics are; `STEPS` is one already.
        let mut used = HashSet::from(["STEPS".to_owned()]);
        for (path, values) in &self.rows.columns {
            if taken.contains(path) {
                continue;
            }
            let is_renamed = identifier(path) != *path;
            let Some(found) = kind(values).filter(|_| !self.is_mapped || !is_renamed) else { continue };
            let [last, whole] = names_of(path);
            let mut name = identifier(path.rsplit('.').next().unwrap_or(path));
            if entries.contains_key(&name) || column(&name).is_some_and(|column| is_general(column.name)) {
                name = identifier(path);
            }
            if entries.contains_key(&name) {
                name.push_str("_of_row");
            }
            while used.contains(&name.to_ascii_uppercase()) {
                name.push_str("_2");
            }
            let is_named = |name: &String| WORDS.success.contains(name) || name.ends_with(&WORDS.success[0]);
            let is_success = !has_success && [&last, &whole].into_iter().any(is_named);
            let words = words(values).filter(|_| is_success && found == Kind::String);
            if found == Kind::String && words.is_none() {
                if path.contains('.') {
                    left.push(path.as_str());
                }
                continue;
            }
            let entry = words.as_ref().map(|words| format!("{{ from = {}, words = {{ {words} }} }}", quoted(path)));
            if entry.is_some() || name != *path {
                entries.insert(name.clone(), entry.unwrap_or_else(|| quoted(path)));
            }
            let kind = if words.is_some() { Kind::Bool } else { found };
            let decimals = (kind == Kind::Float).then(|| decimals(values));
            let unit = WORDS.units.iter().find(|(ending, _)| name.to_ascii_lowercase().ends_with(*ending));
            let _ = write!(columns, "\n[column.{name}]\ntype = \"{}\"\n", type_of(kind));
            if let Some((digits, is_rounded)) = decimals {
                let more = if is_rounded { " # its values have more; they are rounded" } else { "" };
                let _ = writeln!(columns, "decimals = {digits}{more}");
            }
            if let Some((_, unit)) = unit {
                let _ = writeln!(columns, "unit = {}", quoted(unit));
            }
            has_success |= is_success;
            used.insert(name.to_ascii_uppercase());
            let title = title(&name, unit.map(|(ending, _)| &**ending));
            let upper = name.to_ascii_uppercase();
            let goes = |parts: &[String]| parts.iter().any(|part| last.contains(part));
            let better = if goes(&WORDS.higher) { Some("higher") } else { goes(&WORDS.lower).then_some("lower") };
            let is_zero_or_one =
                || values.iter().all(|value| matches!(value.clone().typed(Kind::Int), Cell::Int(0 | 1) | Cell::Null));
            let (value, better) = match kind {
                Kind::Bool if is_success || is_single => (format!("any({name})"), is_success.then_some("higher")),
                Kind::Bool => (format!("count({name})"), better),
                _ if is_success && is_zero_or_one() => (format!("any({name} = 1)"), Some("higher")),
                _ if is_single => (format!("at({name}, 1)"), better),
                _ if goes(&WORDS.summed) => (format!("sum({name})"), better),
                _ => (format!("at({name}, length())"), better),
            };
            let text = metric(&upper, &title, &value, better);
            if is_success { metrics.insert(0, text) } else { metrics.push(text) }
        }
        if metrics.len() > MOST_METRICS {
            self.reasons.push(format!(
                "{} numbers have no metric: a draft has at most {MOST_METRICS}",
                metrics.len() - MOST_METRICS
            ));
            metrics.truncate(MOST_METRICS);
        }
        if !has_success {
            self.reasons.push("no column has a name such as `success`: add the metric that decides".to_owned());
        }
        if !left.is_empty() {
            self.reasons.push(format!("texts without an entry are left out: {}", left.join(", ")));
        }
        tables.push_str(&columns);
        tables.push_str(&metrics.concat());
    }
}

fn metric(name: &str, title: &str, value: &str, better: Option<&str>) -> String {
    let better = better.map(|better| format!("better = {}\n", quoted(better))).unwrap_or_default();
    format!("\n[metric.{name}]\ntitle = {}\nvalue = {}\n{better}", quoted(title), quoted(value))
}

/// `time_s` as `Time`.
fn title(name: &str, ending: Option<&str>) -> String {
    let name = ending.map_or(name, |ending| &name[..name.len() - ending.len()]);
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The name of a type in definitions.
const fn type_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Bool => "bool",
        Kind::Int => "int",
        Kind::Float => "float",
        Kind::String | Kind::Unsupported => "text",
    }
}

/// The type that fits all values; `None` for lists, and if all are null.
fn kind(values: &[Cell<'_>]) -> Option<Kind> {
    let kinds = values.iter().filter(|value| **value != Cell::Null).map(|value| match value {
        Cell::Float(number) if spelling::whole(*number).is_some() => Some(Kind::Int),
        value => value.kind(),
    });
    kinds.collect::<Option<Vec<Kind>>>()?.into_iter().reduce(spelling::joined)
}

/// The digits after the point of all values, and true if that is too many for a metric.
fn decimals(values: &[Cell<'_>]) -> (usize, bool) {
    let digits = |value: &Cell<'_>| {
        let number = value.clone().typed(Kind::Float).float()?;
        Some(number.to_string().split_once('.').map_or(0, |(_, digits)| digits.len()))
    };
    let most = values.iter().filter_map(digits).max().unwrap_or_default();
    if most > 9 { (ROUNDED, true) } else { (most, false) }
}

/// The truth values of the words in a column, such as `yes = true, no = false`; `None` if a word is neither.
fn words(values: &[Cell<'_>]) -> Option<String> {
    let mut found: IndexMap<String, bool> = IndexMap::new();
    for text in values.iter().filter_map(Cell::text) {
        let small = text.to_ascii_lowercase();
        let is_yes = WORDS.yes.contains(&small);
        if !is_yes && !WORDS.no.contains(&small) {
            return None;
        }
        found.insert(text.into_owned(), is_yes);
    }
    let entry = |(word, truth): (&String, &bool)| format!("{} = {truth}", quoted(word));
    (!found.is_empty()).then(|| found.iter().map(entry).collect::<Vec<_>>().join(", "))
}

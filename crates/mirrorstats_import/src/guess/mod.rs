//! Drafts the mapping and the definitions for a file whose columns have names of their own.
//!
//! Rule: a draft is text for a person to read. Each choice says which values made it, and what is not chosen is said.

mod rows;

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;
use std::path::Path;

use indexmap::IndexMap;
use mirrorstats_exact::format::counted;
use mirrorstats_trace::schema::domain::is_general;
use mirrorstats_trace::schema::{Kind, column};

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

/// Names by which other programs call the columns that every trace has, the most certain first.
const MODEL: [&str; 13] = [
    "model",
    "modelname",
    "modelid",
    "policy",
    "policyname",
    "agent",
    "agentname",
    "method",
    "checkpoint",
    "algorithm",
    "algo",
    "system",
    "robot",
];
const EXPERIMENT: [&str; 12] = [
    "experiment",
    "task",
    "taskname",
    "taskid",
    "env",
    "envname",
    "envid",
    "environment",
    "scenario",
    "benchmark",
    "suite",
    "level",
];
const EPISODE: [&str; 10] = [
    "episodeid",
    "runid",
    "trajectoryid",
    "rolloutid",
    "sampleid",
    "trialid",
    "uuid",
    "episode",
    "trajectory",
    "rollout",
];
const SEED: [&str; 3] = ["seed", "taskseed", "envseed"];
const RUN: [&str; 10] =
    ["run", "trial", "episodeindex", "episodeidx", "episodeix", "repetition", "repeat", "attempt", "epoch", "episode"];
const T: [&str; 8] = ["t", "step", "timestep", "stepindex", "stepidx", "frame", "frameindex", "turn"];

const SUCCESS: [&str; 10] =
    ["success", "succeeded", "solved", "passed", "correct", "exactmatch", "completed", "resolved", "result", "outcome"];
const YES: [&str; 10] = ["yes", "y", "true", "pass", "passed", "success", "succeeded", "solved", "correct", "c"];
const NO: [&str; 12] =
    ["no", "n", "false", "fail", "failed", "failure", "unsolved", "incorrect", "i", "timeout", "error", "wrong"];
const LOWER: [&str; 14] = [
    "time",
    "step",
    "dist",
    "error",
    "collision",
    "cost",
    "force",
    "intervention",
    "token",
    "latency",
    "length",
    "jerk",
    "retr",
    "loss",
];
const HIGHER: [&str; 5] = ["reward", "return", "score", "progress", "success"];
/// Amounts per step, of which an episode has the sum.
const SUMMED: [&str; 6] = ["reward", "cost", "token", "latency", "duration", "price"];
const UNITS: [(&str, &str); 5] = [("_s", "s"), ("_ms", "ms"), ("_m", "m"), ("_usd", "USD"), ("_n", "N")];

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
        let owned = |found: Option<&str>| found.map(str::to_owned);
        let [mut model, experiment] = [&MODEL[..], &EXPERIMENT].map(|names| owned(rows.named(names, is_there)));
        let [seed, run] = [&SEED[..], &RUN].map(|names| owned(rows.named(names, is_integer)));
        let t = owned(rows.named(&T, is_integer));
        let own_id = owned(rows.named(&EPISODE, is_there));
        let mut is_only_told_apart = false;
        if model.is_none() && own_id.is_none() && t.is_none() {
            let others: Vec<String> = [&experiment, &seed, &run].into_iter().flatten().cloned().collect();
            let is_text = |values: &[Cell<'_>]| kind(values) == Some(Kind::String) && is_there(values);
            model = owned(rows.distinguishing(&others, is_text));
            is_only_told_apart = model.is_some();
        }
        let parts: Vec<String> = [&model, &experiment, &seed, &run].into_iter().flatten().cloned().collect();
        // An id of the file is enough if everything else is constant in its episodes.
        let is_enough = |id: &String| {
            let mut by_id: HashMap<String, Vec<String>> = HashMap::new();
            let ids = rows.keys(std::slice::from_ref(id)).into_iter().map(|mut key| key.remove(0));
            ids.zip(rows.keys(&parts)).all(|(id, others)| *by_id.entry(id).or_insert_with(|| others.clone()) == others)
        };
        let mut id: Vec<String> = match own_id {
            Some(own) if is_enough(&own) => vec![own],
            Some(own) if !parts.contains(&own) => [parts.clone(), vec![own]].concat(),
            _ => parts.clone(),
        };
        if id.is_empty() {
            id = ["file#", "#"].map(str::to_owned).to_vec();
        }
        let known: Vec<String> = id.iter().filter(|path| !path.ends_with('#')).cloned().collect();
        let episodes = rows.keys(&known).into_iter().collect::<HashSet<_>>().len();
        let is_single = episodes == rows.count || known.is_empty();
        let episodes = if known.is_empty() { rows.count } else { episodes };
        let ordered = t.clone().filter(|t| {
            let all: HashSet<Vec<String>> = rows.keys(&[known.clone(), vec![t.clone()]].concat()).into_iter().collect();
            all.len() == rows.count
        });

        let mut entries = Entries::new();
        let joined = |paths: &[String]| match paths {
            [path] => quoted(path),
            paths => quoted(&paths.iter().map(|path| format!("{{{path}}}")).collect::<Vec<_>>().join("/")),
        };
        entries.insert("episode_id".into(), joined(&id));
        let constant = |value: &str| format!("{{ value = {} }}", quoted(value));
        let or = |path: &Option<String>, other: String| path.as_deref().map_or(other, quoted);
        entries.insert("model".into(), or(&model, constant(&self.stem)));
        entries.insert("experiment".into(), or(&experiment, constant(&self.stem)));
        entries.insert("seed".into(), or(&seed, "1".into()));
        entries.insert("run".into(), or(&run, "1".into()));
        let by_row = || if is_single { "1".to_owned() } else { "{ start = 1 }".to_owned() };
        entries.insert(
            "t".into(),
            match &ordered {
                Some(t) if !is_single => format!("{{ from = {}, start = 1 }}", quoted(t)),
                _ => by_row(),
            },
        );

        let names = |paths: &[String]| paths.iter().map(|path| format!("`{path}`")).collect::<Vec<_>>().join(", ");
        let mut reasons = vec![format!(
            "{} in {}: an episode has its own {}",
            counted(rows.count as u64, "row"),
            counted(episodes as u64, "episode"),
            if known.is_empty() { "row, for no column has the name of an id".to_owned() } else { names(&known) }
        )];
        for (name, path) in [("model", &model), ("experiment", &experiment), ("seed", &seed), ("run", &run)] {
            let found = |path: &String| {
                let values: HashSet<_> = rows.keys(std::slice::from_ref(path)).into_iter().collect();
                format!("`{name}` is `{path}`, with {}", counted(values.len() as u64, "value"))
            };
            let missing = || format!("`{name}` is the same in all rows: no column has such a name");
            reasons.push(path.as_ref().map_or_else(missing, found));
        }
        if is_only_told_apart {
            reasons.push(
                "no column has the name of a model: this one tells apart rows that are otherwise one episode".into(),
            );
        }
        reasons.push(match (&ordered, is_single) {
            (_, true) => "`t` is 1: each episode has one row".to_owned(),
            (Some(t), _) => format!("`t` counts `{t}` from 1"),
            (None, _) => "`t` is the order of the rows: no integer numbers the rows of an episode".to_owned(),
        });
        self.reasons = reasons;
        let used = parts.into_iter().chain(id).chain(ordered).collect();
        (entries, used)
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
            let is_named = |name: &String| SUCCESS.contains(&name.as_str()) || name.ends_with(SUCCESS[0]);
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
            let unit = UNITS.iter().find(|(ending, _)| name.to_ascii_lowercase().ends_with(ending));
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
            let title = title(&name, unit.map(|(ending, _)| *ending));
            let upper = name.to_ascii_uppercase();
            let goes = |names: &[&str]| names.iter().any(|part| last.contains(part));
            let better = if goes(&HIGHER) { Some("higher") } else { goes(&LOWER).then_some("lower") };
            let is_zero_or_one =
                || values.iter().all(|value| matches!(value.clone().typed(Kind::Int), Cell::Int(0 | 1) | Cell::Null));
            let (value, better) = match kind {
                Kind::Bool if is_success || is_single => (format!("any({name})"), is_success.then_some("higher")),
                Kind::Bool => (format!("count({name})"), better),
                _ if is_success && is_zero_or_one() => (format!("any({name} = 1)"), Some("higher")),
                _ if is_single => (format!("at({name}, 1)"), better),
                _ if goes(&SUMMED) => (format!("sum({name})"), better),
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
        Cell::Bool(_) => Some(Kind::Bool),
        Cell::Int(_) => Some(Kind::Int),
        Cell::Float(number) => Some(if spelling::whole(*number).is_some() { Kind::Int } else { Kind::Float }),
        Cell::Spelled(text) => Some(spelling::kind_of(text)),
        Cell::Text(_) => Some(Kind::String),
        Cell::Unheld(_) | Cell::List | Cell::Object | Cell::Null => None,
    });
    let kinds = kinds.collect::<Option<Vec<Kind>>>()?;
    kinds.into_iter().reduce(|before, now| match (before, now) {
        (Kind::Int, Kind::Float) | (Kind::Float, Kind::Int) => Kind::Float,
        (before, now) if before == now => now,
        _ => Kind::String,
    })
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
        let is_yes = YES.contains(&small.as_str());
        if !is_yes && !NO.contains(&small.as_str()) {
            return None;
        }
        found.insert(text.into_owned(), is_yes);
    }
    let entry = |(word, truth): (&String, &bool)| format!("{} = {truth}", quoted(word));
    (!found.is_empty()).then(|| found.iter().map(entry).collect::<Vec<_>>().join(", "))
}

//! Checks the rules for complete episodes on columns: a fast look, which is enough for most traces, then a search for
//! the row if it is not.
//!
//! Rule: a rule gives one finding per episode and column, at the first row that breaks it, with the number of others.

use arrow::array::{Array as _, ArrayRef, AsArray as _, Int64Array};
use arrow::datatypes::{Float64Type, Int32Type, Int64Type};

use crate::diagnostic::{Code, Finding};
use crate::episodes::episode_hash::same;
use crate::read::open::TraceFile;
use crate::read::parallel_scan::Episodes;
use crate::read::projection::{BODY_COLOR, EPISODE_ID, Layout, LayoutColumn, T};
use crate::schema::rules::{Known, Requirement, Rule, rules_of};
use crate::schema::{Kind, value_at};
use mirrorstats_exact::escape::exact;
use mirrorstats_exact::suggest::nearest;
use mirrorstats_parquet_pages::{Column as Held, text_at};

pub(crate) struct Located {
    pub(crate) row: usize,
    pub(crate) finding: Finding,
}

pub(crate) struct Rules<'a> {
    pub(crate) layout: &'a Layout,
    pub(crate) experiments: Option<&'a [String]>,
}

impl Rules<'_> {
    pub(crate) fn check(&self, file: &TraceFile, episodes: &Episodes) -> Vec<Located> {
        let mut found = Vec::new();
        let mut columns: Vec<(usize, &LayoutColumn)> = self.layout.columns.iter().enumerate().collect();
        // In the schema the body's colour comes before t.
        if columns.get(T + 1).is_some_and(|(_, column)| column.name == BODY_COLOR) {
            columns.swap(T, T + 1);
        }
        for (at, column) in columns {
            let held = &episodes.columns[at];
            let mut rules = self.of_column(at, column, file);
            rules.retain(|rule| may_break(rule, held, &episodes.offsets));
            if rules.is_empty() {
                continue;
            }
            match held.flat() {
                Ok(values) => {
                    let mut look = Look { file: file.name(), episodes, column, values: &values, found: &mut found };
                    for rule in &rules {
                        look.search(rule);
                    }
                }
                Err(why) => {
                    let finding =
                        Finding::new(Code::CorruptData, file.name(), "rows that fit into memory", why.to_string());
                    found.push(Located { row: 0, finding: finding.in_column(&column.name) });
                }
            }
        }
        found.sort_by_key(|located| located.row);
        found
    }

    fn of_column<'a>(&'a self, at: usize, column: &'a LayoutColumn, file: &'a TraceFile) -> Vec<Rule<'a>> {
        let known = Known { palette: file.palette(), experiments: self.experiments };
        let mut rules = column.known.map_or_else(Vec::new, |column| rules_of(column, known));
        // Only a file whose experiments declare the column absent may lack it.
        if file.column(&column.name).is_none() {
            rules.retain(|rule| rule.asks != Requirement::Present);
        }
        if !column.values.is_empty() && column.kind == Kind::String {
            rules.push(Rule { code: Code::UnknownValue, asks: Requirement::Among(&column.values) });
        }
        // A definition may require any column to be constant.
        let constant = Rule { code: Code::InconsistentConstant, asks: Requirement::Constant };
        if column.constant && at != EPISODE_ID && !rules.contains(&constant) {
            rules.push(constant);
        }
        rules
    }
}

/// The fast look: returns false only if no row breaks the rule.
fn may_break(rule: &Rule<'_>, held: &Held, offsets: &[usize]) -> bool {
    match (rule.asks, held) {
        (Requirement::Present, Held::Flat(values)) => values.null_count() > 0,
        (Requirement::Present, Held::Runs(runs)) => runs.values().null_count() > 0,
        (Requirement::Present, Held::Keys(keys)) => keys.keys().null_count() > 0,
        (Requirement::Constant, Held::Flat(values)) => !is_constant(values, offsets),
        (Requirement::Constant, Held::Runs(runs)) => !runs.start_only_at(offsets),
        (Requirement::Constant, Held::Keys(_)) => true,
        // One search finds all faults in the order of the steps.
        (Requirement::FromOne, held) => !counts_from_one(held, offsets),
        (Requirement::Once | Requirement::WithoutGap, _) => false,
        (_, held) => has_odd(rule, held.entries()),
    }
}

/// Returns true if the rule forbids one of the values, including those behind nulls. Counts without an early exit,
/// which compiles to few instructions.
fn has_odd(rule: &Rule<'_>, values: &ArrayRef) -> bool {
    if let Some(texts) = values.as_string_opt::<i32>() {
        return texts.iter().flatten().any(|text| !rule.allows(text));
    }
    if let Some(ints) = values.as_primitive_opt::<Int64Type>() {
        return ints.values().iter().filter(|value| !rule.allows_int(**value)).count() > 0;
    }
    let floats = values.as_primitive_opt::<Float64Type>();
    floats.is_some_and(|floats| floats.values().iter().any(|value| !rule.allows_float(*value)))
}

/// Returns true if all rows of each episode have the same bits; ignores nulls.
fn is_constant(values: &ArrayRef, offsets: &[usize]) -> bool {
    fn uniform<V: Copy + PartialEq>(values: &[V]) -> bool {
        let Some(first) = values.first() else { return true };
        values.iter().filter(|value| *value != first).count() == 0
    }
    let mut episodes = offsets.windows(2).map(|ends| ends[0]..ends[1]);
    match values.null_count() {
        0 => {}
        nulls => return nulls == values.len(),
    }
    if let Some(texts) = values.as_dictionary_opt::<Int32Type>() {
        return episodes.all(|rows| uniform(&texts.keys().values()[rows]));
    }
    let ints = values.as_primitive_opt::<Int64Type>();
    ints.is_some_and(|ints| episodes.all(|rows| uniform(&ints.values()[rows])))
}

fn counts_from_one(t: &Held, offsets: &[usize]) -> bool {
    match t {
        Held::Flat(t) => {
            let counts = |t: &[i64]| t.iter().zip(1..).filter(|(t, expected)| *t != expected).count() == 0;
            let t = t.as_primitive::<Int64Type>();
            t.null_count() == 0 && offsets.windows(2).all(|ends| counts(&t.values()[ends[0]..ends[1]]))
        }
        Held::Keys(keys) => keys.count_from_one(offsets),
        Held::Runs(_) => false,
    }
}

struct Look<'a> {
    file: &'a str,
    episodes: &'a Episodes,
    column: &'a LayoutColumn,
    values: &'a ArrayRef,
    found: &'a mut Vec<Located>,
}

impl Look<'_> {
    fn search(&mut self, rule: &Rule<'_>) {
        let values = self.values;
        match rule.asks {
            Requirement::Present => self.each_episode(rule, |row| values.is_null(row)),
            Requirement::Constant => self.constant(),
            Requirement::FromOne => self.sequence(),
            _ => {
                if let Some(texts) = values.as_dictionary_opt::<Int32Type>() {
                    let entries = texts.values().as_string::<i32>().iter();
                    let odd: Vec<bool> = entries.map(|text| text.is_some_and(|text| !rule.allows(text))).collect();
                    self.each_episode(rule, |row| texts.key(row).is_some_and(|key| odd[key]));
                } else if let Some(ints) = values.as_primitive_opt::<Int64Type>() {
                    self.each_episode(rule, |row| valid(ints, row).is_some_and(|value| !rule.allows_int(value)));
                } else if let Some(floats) = values.as_primitive_opt::<Float64Type>() {
                    self.each_episode(rule, |row| floats.is_valid(row) && !rule.allows_float(floats.value(row)));
                }
            }
        }
    }

    fn each_episode(&mut self, rule: &Rule<'_>, bad: impl Fn(usize) -> bool) {
        for ends in self.episodes.offsets.windows(2) {
            let mut rows = (ends[0]..ends[1]).filter(|row| bad(*row));
            let Some(row) = rows.next() else { continue };
            let found = match rows.count() {
                0 => shown(self.values, row),
                more => format!("{} (and {more} more rows of the episode break this rule)", shown(self.values, row)),
            };
            let help = self.help(rule, row);
            let finding = self.report(rule.code, row, rule.expected(), found);
            finding.help = help.unwrap_or(std::mem::take(&mut finding.help));
        }
    }

    fn help(&self, rule: &Rule<'_>, row: usize) -> Option<String> {
        let text = || text_at(self.values, row).unwrap_or_default();
        match rule.asks {
            Requirement::Color(column, palette) => Some(column.help(text(), palette)),
            Requirement::Among(values) => {
                nearest(text(), values.iter().map(String::as_str)).map(|like| format!("did you mean `{like}`?"))
            }
            Requirement::Experiment(known) => {
                let like = nearest(text(), known.iter().map(String::as_str))?;
                Some(format!("did you mean `{like}`? Otherwise {}", rule.code.help()))
            }
            _ => None,
        }
    }

    fn report(&mut self, code: Code, row: usize, expected: String, found: String) -> &mut Finding {
        let mut finding = Finding::new(code, self.file, expected, found)
            .in_row_group(self.episodes.row_group(row))
            .in_column(&self.column.name);
        finding.episode = self.episodes.id(row).map(str::to_owned);
        finding.t = self.episodes.columns[T].int(row);
        self.found.push(Located { row, finding });
        let last = self.found.len() - 1;
        &mut self.found[last].finding
    }

    fn constant(&mut self) {
        let values = self.values;
        let skip_nulls = self.column.known.is_some_and(|known| !known.nullable);
        for ends in self.episodes.offsets.windows(2) {
            let mut rows = (ends[0]..ends[1]).filter(|row| !skip_nulls || values.is_valid(*row));
            let Some(first) = rows.next() else { continue };
            let mut others = rows.filter(|row| !same(value_at(values, first), value_at(values, *row)));
            let Some(row) = others.next() else { continue };
            let expected = format!("{}, as in the episode's first row", shown(values, first));
            let found = match others.count() {
                0 => shown(values, row),
                more => format!("{} (and {more} more rows differ)", shown(values, row)),
            };
            self.report(Code::InconsistentConstant, row, expected, found);
        }
    }

    fn sequence(&mut self) {
        let t = self.values.as_primitive::<Int64Type>();
        for ends in self.episodes.offsets.windows(2) {
            let start = ends[0];
            if let Some(first) = valid(t, start).filter(|first| *first != 1) {
                self.report(Code::TStart, start, "t = 1 in the episode's first row".into(), format!("t = {first}"));
            }
            let mut reported = Vec::new();
            for row in start + 1..ends[1] {
                let (Some(before), Some(now)) = (valid(t, row - 1), valid(t, row)) else { continue };
                let code = match now {
                    now if before.checked_add(1) == Some(now) => continue,
                    now if now == before => Code::TDuplicate,
                    1 => Code::EpisodeTwice,
                    now if now < before => Code::TOrder,
                    _ => Code::TGap,
                };
                if !reported.contains(&code) {
                    reported.push(code);
                    let expected = format!("t = {}, one more than in the row before", before.saturating_add(1));
                    self.report(code, row, expected, format!("t = {now}"));
                }
            }
        }
    }
}

fn valid(values: &Int64Array, row: usize) -> Option<i64> {
    values.is_valid(row).then(|| values.value(row))
}

fn shown(values: &ArrayRef, row: usize) -> String {
    value_at(values, row).map_or_else(|| "null".to_owned(), |value| value.shown(exact))
}

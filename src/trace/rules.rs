//! The rules that whole episodes must keep, checked on columns: a fast look that most traces pass, and a slow one
//! that finds the row.
//!
//! Rule: a rule gives one finding an episode and column, at the first row that breaks it, and says how many more do.

use arrow::array::{Array as _, ArrayRef, AsArray as _, BooleanArray, Float64Array, Int64Array};
use arrow::datatypes::{Float64Type, Int32Type, Int64Type};

use super::colors::{self, palette::Palette};
use super::column::{Column as Held, Keys, Runs, text_at};
use super::finding::{Code, Finding};
use super::layout::{EPISODE_ID, EXPERIMENT, Layout, LayoutColumn, T};
use super::open::TraceFile;
use super::pass::Episodes;
use super::schema::{Column, Kind};
use crate::base::escape::exact;
use crate::base::suggest::nearest;

/// A finding and its row among the episodes'.
pub(super) struct Located {
    pub(super) row: usize,
    pub(super) finding: Finding,
}

/// The rules for one pass.
pub(super) struct Rules<'a> {
    pub(super) layout: &'a Layout,
    /// The experiments that the definitions know; any if `None`.
    pub(super) experiments: Option<&'a [String]>,
}

/// What a rule looks at: one column of some episodes.
struct Look<'a> {
    file: &'a str,
    episodes: &'a Episodes,
    name: &'a str,
    values: &'a ArrayRef,
    found: &'a mut Vec<Located>,
}

impl Rules<'_> {
    /// Everything that is wrong with these episodes, by row and then by column.
    pub(super) fn check(&self, file: &TraceFile, episodes: &Episodes) -> Vec<Located> {
        let mut found = Vec::new();
        let palette = file.palette();
        let file = file.name();
        for (at, column) in self.layout.columns.iter().enumerate() {
            let held = &episodes.columns[at];
            if let Held::Runs(runs) = held
                && self.keeps(at, runs, &episodes.offsets, palette)
            {
                continue;
            }
            if let Held::Keys(keys) = held
                && self.keeps_keyed(at, keys, &episodes.offsets, palette)
            {
                continue;
            }
            let values = &match held.flat() {
                Ok(values) => values,
                Err(why) => {
                    let corrupt = Finding::new(Code::CorruptData, file, "rows that fit into memory", why.to_string());
                    found.push(Located { row: 0, finding: corrupt.in_column(&column.name) });
                    continue;
                }
            };
            let mut look = Look { file, episodes, name: &column.name, values, found: &mut found };
            if let Some(known) = column.known {
                look.nulls(known);
                look.values(known);
                look.colors(known, palette);
                // That t counts from 1 says more than any range.
                if at != T {
                    look.range(known);
                }
            }
            if column.constant && at != EPISODE_ID {
                look.constant(column);
            }
            match at {
                T => look.sequence(),
                EXPERIMENT => look.experiments(self.experiments),
                _ => {}
            }
        }
        found.sort_by_key(|located| located.row);
        found
    }
}

impl Rules<'_> {
    /// The fast look at a column that is held as runs. May say no where the slow one finds nothing.
    fn keeps(&self, at: usize, runs: &Runs, offsets: &[usize], palette: Option<&Palette>) -> bool {
        let values = runs.values();
        // Only columns that are constant in an episode are held as runs.
        if at == T || values.null_count() > 0 || !runs.start_only_at(offsets) {
            return false;
        }
        let values = values.as_any_dictionary_opt().map_or(values, |texts| texts.values());
        let harmless = self.layout.columns[at].known.is_none_or(|known| harmless(known, values, palette));
        let experiments = self.experiments.filter(|_| at == EXPERIMENT);
        harmless && experiments.is_none_or(|known| !any_text(values, |text| !known.iter().any(|k| k == text)))
    }

    /// The fast look at a column that is held as keys. May say no where the slow one finds nothing.
    fn keeps_keyed(&self, at: usize, keys: &Keys, offsets: &[usize], palette: Option<&Palette>) -> bool {
        let column = &self.layout.columns[at];
        let nulls = keys.keys().null_count() > 0;
        match column.known {
            _ if column.constant => false,
            _ if at == T => keys.count_from_one(offsets),
            Some(known) => (known.nullable || !nulls) && harmless(known, keys.values(), palette),
            None => true,
        }
    }
}

/// Whether no value, an integer or a text, breaks a rule of its column.
fn harmless(known: &Column, values: &ArrayRef, palette: Option<&Palette>) -> bool {
    match known.stored.kind() {
        Kind::Int => {
            let (lowest, highest) = known.stored.range().unwrap_or((i64::MIN, i64::MAX));
            let (min, max) = extent(values.as_primitive::<Int64Type>().values());
            min >= lowest && max <= highest && !(known.counts() && min < 0)
        }
        Kind::String => {
            let colors = colors::column(known.name);
            odd_text(known).is_none_or(|(_, odd)| !any_text(values, odd))
                && colors.is_none_or(|colors| !any_text(values, |text| !colors.may_hold(text, palette)))
        }
        _ => false,
    }
}

/// What text a column may not hold, if there is a rule, and the code of its finding.
fn odd_text(known: &Column) -> Option<(Code, impl Fn(&str) -> bool)> {
    let code = match known.name {
        "action" => Code::UnknownAction,
        "reply_status" => Code::UnknownReplyStatus,
        _ if known.names() => Code::EmptyString,
        _ => return None,
    };
    let known = known.values;
    Some((code, move |text: &str| if known.is_empty() { text.is_empty() } else { !known.contains(&text) }))
}

/// Whether one of some texts is `odd`.
fn any_text(texts: &ArrayRef, odd: impl Fn(&str) -> bool) -> bool {
    texts.as_string::<i32>().iter().flatten().any(odd)
}

impl Look<'_> {
    /// One finding for each episode with a row that is `bad`.
    fn each_episode(
        &mut self,
        code: Code,
        expected: &str,
        bad: impl Fn(usize) -> bool,
        found: impl Fn(usize) -> String,
    ) {
        for ends in self.episodes.offsets.windows(2) {
            let mut rows = (ends[0]..ends[1]).filter(|row| bad(*row));
            let Some(row) = rows.next() else { continue };
            let found = match rows.count() {
                0 => found(row),
                more => format!("{} (and {more} more rows of the episode break this rule)", found(row)),
            };
            self.report(code, row, expected.to_owned(), found);
        }
    }

    fn report(&mut self, code: Code, row: usize, expected: String, found: String) {
        let mut finding = Finding::new(code, self.file, expected, found)
            .in_row_group(self.episodes.row_group(row))
            .in_column(self.name);
        finding.episode = self.episodes.id(row).map(str::to_owned);
        finding.t = self.episodes.columns[T].int(row);
        self.found.push(Located { row, finding });
    }

    fn nulls(&mut self, known: &Column) {
        if known.nullable || self.values.null_count() == 0 {
            return;
        }
        let values = self.values;
        self.each_episode(Code::NullInRequired, "a value", |row| values.is_null(row), |_| "null".into());
    }

    fn range(&mut self, known: &Column) {
        let values = self.values;
        let (lowest, highest) = known.stored.range().unwrap_or((i64::MIN, i64::MAX));
        match known.stored.kind() {
            Kind::Int => {
                let ints = values.as_primitive::<Int64Type>();
                let (min, max) =
                    if known.constant { self.extent_of_firsts(ints) } else { extent(ints.values().iter()) };
                if min < lowest || max > highest {
                    let expected = format!("{lowest} to {highest}, an {}", known.stored.name());
                    let bad = |row| valid(ints, row).is_some_and(|value| value < lowest || value > highest);
                    self.each_episode(Code::OutOfRange, &expected, bad, |row| ints.value(row).to_string());
                }
                if known.counts() && min < 0 {
                    let bad = |row| valid(ints, row).is_some_and(|value| value < 0);
                    self.each_episode(Code::NegativeCount, "0 or more", bad, |row| ints.value(row).to_string());
                }
            }
            Kind::Float if known.counts() => {
                let floats = values.as_primitive::<Float64Type>();
                if floats.values().iter().any(|value| is_no_count(*value)) {
                    let bad = |row| floats.is_valid(row) && is_no_count(floats.value(row));
                    self.each_episode(Code::NegativeCount, "0 or more", bad, |row| floats.value(row).to_string());
                }
            }
            _ => {}
        }
    }

    /// The extent of the first rows; that the others are the same is another rule.
    fn extent_of_firsts(&self, ints: &Int64Array) -> (i64, i64) {
        let firsts = &self.episodes.offsets[..self.episodes.len()];
        extent(firsts.iter().map(|row| &ints.values()[*row]))
    }

    /// Text that is none of the fixed values, and names that are empty.
    fn values(&mut self, known: &Column) {
        if known.stored.kind() != Kind::String {
            return;
        }
        let Some((code, odd)) = odd_text(known) else { return };
        let expected = if known.values.is_empty() { "a name".into() } else { known.values.join(", ") };
        self.odd_texts(code, &expected, odd);
    }

    fn odd_texts(&mut self, code: Code, expected: &str, odd: impl Fn(&str) -> bool) {
        let values = self.values;
        let texts = values.as_dictionary::<Int32Type>();
        let odd_keys: Vec<bool> = texts.values().as_string::<i32>().iter().map(|text| text.is_some_and(&odd)).collect();
        if odd_keys.contains(&true) {
            let bad = |row| texts.key(row).is_some_and(|key| odd_keys[key]);
            self.each_episode(code, expected, bad, |row| shown(values, row));
        }
    }

    /// Colours that the column may not hold.
    fn colors(&mut self, known: &Column, palette: Option<&Palette>) {
        let Some(column) = colors::column(known.name) else { return };
        let before = self.found.len();
        self.odd_texts(Code::InvalidColor, &column.expected(palette), |text| !column.may_hold(text, palette));
        for located in &mut self.found[before..] {
            located.finding.help = column.help(text_at(self.values, located.row).unwrap_or_default(), palette);
        }
    }

    fn experiments(&mut self, known: Option<&[String]>) {
        let Some(known) = known else { return };
        let before = self.found.len();
        let expected = format!("one of {}", known.join(", "));
        self.odd_texts(Code::UnknownExperiment, &expected, |text| !text.is_empty() && !known.iter().any(|k| k == text));
        for located in &mut self.found[before..] {
            let text = text_at(self.values, located.row).unwrap_or_default();
            if let Some(like) = nearest(text, known.iter().map(String::as_str)) {
                located.finding.help = format!("did you mean `{like}`? Otherwise {}", located.finding.help);
            }
        }
    }

    fn constant(&mut self, column: &LayoutColumn) {
        if self.is_constant() {
            return;
        }
        let values = self.values;
        let skip_nulls = column.known.is_some_and(|known| !known.nullable);
        for ends in self.episodes.offsets.windows(2) {
            let mut rows = (ends[0]..ends[1]).filter(|row| !skip_nulls || values.is_valid(*row));
            let Some(first) = rows.next() else { continue };
            let mut others = rows.filter(|row| !same(values, first, *row));
            let Some(row) = others.next() else { continue };
            let expected = format!("{}, as in the episode's first row", shown(values, first));
            let found = match others.count() {
                0 => shown(values, row),
                more => format!("{} (and {more} more rows differ)", shown(values, row)),
            };
            self.report(Code::InconsistentConstant, row, expected, found);
        }
    }

    /// The fast look: the same bits in all rows of each episode. May say no where the slow one finds nothing.
    fn is_constant(&self) -> bool {
        let nulls = self.values.null_count();
        if nulls == self.values.len() {
            return true;
        }
        let episodes = || self.episodes.offsets.windows(2).map(|ends| ends[0]..ends[1]);
        if nulls > 0 {
            return false;
        }
        if let Some(texts) = self.values.as_dictionary_opt::<Int32Type>() {
            let keys = texts.keys().values();
            return episodes().all(|rows| uniform(&keys[rows]));
        }
        match self.values.as_primitive_opt::<Int64Type>() {
            Some(ints) => episodes().all(|rows| uniform(&ints.values()[rows])),
            None => false,
        }
    }

    fn sequence(&mut self) {
        let t = self.values.as_primitive::<Int64Type>();
        let in_order = t.null_count() == 0
            && self.episodes.offsets.windows(2).all(|ends| counts_from_one(&t.values()[ends[0]..ends[1]]));
        if !in_order {
            for ends in self.episodes.offsets.windows(2) {
                self.sequence_of(t, ends[0], ends[1]);
            }
        }
    }

    fn sequence_of(&mut self, t: &Int64Array, start: usize, end: usize) {
        if let Some(first) = valid(t, start).filter(|first| *first != 1) {
            self.report(Code::TStart, start, "t = 1 in the episode's first row".into(), format!("t = {first}"));
        }
        let mut reported = Vec::new();
        for row in start + 1..end {
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

fn valid(values: &Int64Array, row: usize) -> Option<i64> {
    values.is_valid(row).then(|| values.value(row))
}

/// The smallest and largest value, counting also what stands in the place of nulls.
fn extent<'a>(values: impl IntoIterator<Item = &'a i64>) -> (i64, i64) {
    values.into_iter().fold((i64::MAX, i64::MIN), |(min, max), value| (min.min(*value), max.max(*value)))
}

fn is_no_count(value: f64) -> bool {
    value < 0.0 || value.is_nan()
}

/// Whether all are equal; counted without an early end, which the compiler turns into few instructions.
fn uniform<V: Copy + PartialEq>(values: &[V]) -> bool {
    let Some(first) = values.first() else { return true };
    values.iter().filter(|value| *value != first).count() == 0
}

fn counts_from_one(t: &[i64]) -> bool {
    t.iter().zip(1..).filter(|(t, expected)| *t != expected).count() == 0
}

fn same(values: &ArrayRef, one: usize, other: usize) -> bool {
    if values.is_null(one) || values.is_null(other) {
        return values.is_null(one) && values.is_null(other);
    }
    if values.as_dictionary_opt::<Int32Type>().is_some() {
        return text_at(values, one) == text_at(values, other);
    }
    if let Some(ints) = values.as_primitive_opt::<Int64Type>() {
        return ints.value(one) == ints.value(other);
    }
    if let Some(floats) = values.as_primitive_opt::<Float64Type>() {
        return floats.value(one).to_bits() == floats.value(other).to_bits();
    }
    values.as_boolean_opt().is_some_and(|bools| bools.value(one) == bools.value(other))
}

/// A value for a message.
fn shown(values: &ArrayRef, row: usize) -> String {
    if values.is_null(row) {
        return "null".into();
    }
    if values.as_dictionary_opt::<Int32Type>().is_some() {
        return format!("`{}`", exact(text_at(values, row).unwrap_or_default()));
    }
    let any = values.as_any();
    let number = any.downcast_ref::<Int64Array>().map(|ints| ints.value(row).to_string());
    let number = number.or_else(|| any.downcast_ref::<Float64Array>().map(|floats| floats.value(row).to_string()));
    let shown = number.or_else(|| any.downcast_ref::<BooleanArray>().map(|bools| bools.value(row).to_string()));
    shown.unwrap_or_else(|| "another value".into())
}

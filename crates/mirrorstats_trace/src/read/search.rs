//! Searches for words in replies, reasoning, notes and errors.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use arrow::array::{Array as _, AsArray as _, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type};

use super::open::TraceSet;
use super::steps::Steps;
use crate::error::TraceError;
use crate::schema::{Domain, Kind};

pub const SAID: [&str; 7] =
    ["reasoning", "reply", "view_description", "identification", "summary", "reply_fault", "reply_status"];

const AROUND: usize = 40;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    pub t: i64,
    pub column: String,
    pub excerpt: String,
    pub steps: usize,
}

/// The episodes with these words in a text of a step, by id; ignores case.
pub fn search(set: &TraceSet, words: &str, threads: NonZeroUsize) -> Result<BTreeMap<String, Found>, TraceError> {
    let words = words.to_lowercase();
    let known = set.column_names();
    let said: Vec<&str> = match set.domain() {
        Domain::Mirror => SAID.into_iter().filter(|name| known.contains(name)).collect(),
        Domain::Own => {
            let is_text = |name: &&str| set.column(name).is_some_and(|column| column.kind == Kind::String);
            known.into_iter().filter(|name| *name != "episode_id" && is_text(name)).collect()
        }
    };
    let names: Vec<String> = ["episode_id", "t"].into_iter().chain(said).map(str::to_owned).collect();
    let mut found: BTreeMap<String, Found> = BTreeMap::new();
    if words.is_empty() || names.len() == 2 {
        return Ok(found);
    }
    for batch in Steps::new(set, Some(&names), None, threads)? {
        let batch = batch?;
        let times = cast(batch.column(1), &DataType::Int64).map_err(TraceError::Memory)?;
        let times = times.as_primitive::<Int64Type>();
        let ids = cast(batch.column(0), &DataType::Utf8).map_err(TraceError::Memory)?;
        let columns: Vec<(&String, &StringArray)> = names[2..]
            .iter()
            .zip(&batch.columns()[2..])
            .filter_map(|(name, column)| Some((name, column.as_string_opt::<i32>()?)))
            .collect();
        for row in 0..batch.num_rows() {
            let has = |(name, column): &(&String, &StringArray)| {
                let text = column.is_valid(row).then(|| column.value(row))?;
                excerpt(text, &words).map(|excerpt| ((*name).clone(), excerpt))
            };
            let Some((column, excerpt)) = columns.iter().find_map(has) else { continue };
            let new = Found { t: times.value(row), column, excerpt, steps: 0 };
            found.entry(ids.as_string::<i32>().value(row).to_owned()).or_insert(new).steps += 1;
        }
    }
    Ok(found)
}

fn excerpt(text: &str, words: &str) -> Option<String> {
    let small = text.to_lowercase();
    let at = small.find(words)?;
    // Lower case may change the number of bytes, so positions are counted in characters.
    let from = small[..at].chars().count();
    let length = words.chars().count();
    let start = from.saturating_sub(AROUND);
    let cut: String = text.chars().skip(start).take(from - start + length + AROUND).collect();
    let cut = cut.split_whitespace().collect::<Vec<_>>().join(" ");
    let is_end = text.chars().count() <= from + length + AROUND;
    Some(format!("{}{cut}{}", if start > 0 { "…" } else { "" }, if is_end { "" } else { "…" }))
}

#[cfg(test)]
mod tests {
    use super::excerpt;

    #[test]
    fn an_excerpt_has_the_words_and_some_text_around() {
        assert_eq!(excerpt("I see a Mirror.", "mirror").unwrap(), "I see a Mirror.");
        assert_eq!(excerpt("nothing", "mirror"), None);
        let long = excerpt(&format!("{} MIRROR {}", "a ".repeat(100), "b ".repeat(100)), "mirror").unwrap();
        assert!(long.starts_with('…') && long.ends_with('…') && long.contains("MIRROR") && long.chars().count() < 100);
    }
}

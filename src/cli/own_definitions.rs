//! Commands for traces that name different definitions: one for each of them.

use std::borrow::Cow;
use std::ffi::OsString;

use crate::cli::{Failure, NAME};
use mirrorstats_exact::escape::visible;
use mirrorstats_report::html;
use mirrorstats_study::StudyError;
use mirrorstats_study::own_definitions::{OwnDefinitionsError, ScoredAlike};

pub fn with_commands(failure: Failure, typed: &[OsString]) -> Failure {
    let Failure::Input(error) = &failure else { return failure };
    let differing = error.downcast_ref().and_then(StudyError::cause);
    let Some(OwnDefinitionsError::Differ { groups }) = differing else { return failure };
    let words = error.to_string();
    let found = words.split('\n').next().unwrap_or_default();
    Failure::input(format!("{found}\n  help: ask for each by itself:\n    {}", commands(typed, groups).join("\n    ")))
}

fn as_typed(word: &str) -> String {
    let name = word.trim_start_matches('-');
    if name.len() < word.len() && html::word(name) == name { word.to_owned() } else { html::word(word) }
}

pub fn commands(typed: &[OsString], groups: &[ScoredAlike]) -> Vec<String> {
    let (mut kept, mut filter, mut words) = (Vec::new(), None, typed.iter().skip(1).map(|word| word.to_string_lossy()));
    while let Some(word) = words.next() {
        match word.strip_prefix("--where") {
            Some("") => filter = words.next().map(Cow::into_owned),
            Some(rest) => filter = rest.strip_prefix('=').map(str::to_owned),
            None => kept.push(as_typed(&word)),
        }
    }
    let has_out = typed.iter().any(|word| ["--out", "-o"].iter().any(|out| word.to_string_lossy().starts_with(out)));
    let command = |group: &ScoredAlike| {
        let condition =
            filter.as_ref().map_or_else(String::new, |filter| format!("({filter}) and ")) + &group.condition;
        let is_plain = visible(&condition) == condition && !condition.contains(['$', '`', '"', '\\', '!']);
        let condition = if is_plain { format!("\"{condition}\"") } else { html::word(&condition) };
        let definitions = html::word(&group.definitions);
        // Of two reports in one folder, only the last would remain.
        let is_report = kept.first().is_some_and(|verb| verb == "report") && !has_out;
        let out = if is_report { format!(" --out reports/{definitions}") } else { String::new() };
        format!("{NAME} {} --where {condition} --definitions {definitions}{out}", kept.join(" "))
    };
    groups.iter().map(command).collect()
}

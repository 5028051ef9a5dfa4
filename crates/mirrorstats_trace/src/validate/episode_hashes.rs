use arrow::array::{Array as _, ArrayRef};

use super::rules::Located;
use crate::diagnostic::{Code, Finding};
use crate::episodes::answers;
use crate::episodes::episode_hash::{CanonicalForm, EPISODE_HASH, IDENTIFICATION, SELF_COLOR, columns};
use crate::read::open::TraceFile;
use crate::read::parallel_scan::Episodes;
use crate::read::projection::Layout;
use crate::schema::value_at;

const HELP: &str =
    "the rows were changed: restore the file from its source; where the change is meant, leave the column out";

pub(crate) fn check(file: &TraceFile, layout: &Layout, episodes: &Episodes) -> Vec<Located> {
    let declared = |name: &str| layout.position(name).filter(|_| file.declares(name));
    let Some(hashes) = declared(EPISODE_HASH).map(|at| &episodes.columns[at]) else { return Vec::new() };
    let names: Vec<&str> = file.columns().iter().map(|column| column.name.as_str()).collect();
    let mut answers = answers::among(&names);
    answers.sort_unstable();
    let known = columns().map(|name: &str| name);
    let present: Vec<&str> = known.filter(|name| file.declares(name)).chain(answers).collect();
    if present.iter().any(|name| layout.position(name).is_none()) {
        return Vec::new();
    }
    let held = present.into_iter().filter_map(|name| {
        let values = episodes.columns[layout.position(name)?].flat();
        Some(values.map(|values| (name, values)))
    });
    let held: Vec<(&str, ArrayRef)> = match held.collect() {
        Ok(held) => held,
        Err(why) => {
            let finding = Finding::new(Code::CorruptData, file.name(), "rows that fit into memory", why.to_string());
            return vec![Located { row: 0, finding }];
        }
    };
    let starts = &episodes.offsets[..episodes.len()];
    let stated = hashes.texts(starts);
    let mut found = Vec::new();
    for (ends, stated) in episodes.offsets.windows(2).zip(stated) {
        let hash = hash(&held, ends[0]..ends[1]);
        if let Some(stated) = stated.filter(|stated| **stated != hash) {
            let mut finding =
                Finding::new(Code::CorruptData, file.name(), format!("the hash {hash} of its rows"), stated)
                    .in_row_group(episodes.row_group(ends[0]))
                    .in_column(EPISODE_HASH)
                    .with_help(HELP);
            finding.episode = episodes.id(ends[0]).map(str::to_owned);
            found.push(Located { row: ends[0], finding });
        }
    }
    found
}

fn hash(held: &[(&str, ArrayRef)], rows: std::ops::Range<usize>) -> String {
    let identification = held.iter().find(|(name, _)| *name == IDENTIFICATION).map(|(_, values)| values);
    let mut form = CanonicalForm::new();
    for (name, values) in held {
        let derived = |row: usize| *name == SELF_COLOR && identification.is_some_and(|texts| texts.is_valid(row));
        form.add(name, rows.clone().map(|row| value_at(values, row).filter(|_| !derived(row))));
    }
    form.finish()
}

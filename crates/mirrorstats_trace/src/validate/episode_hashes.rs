use arrow::array::Array as _;
use arrow::error::ArrowError;

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
    let hashes_of_rows = match all_hashes(&present, layout, episodes) {
        Ok(hashes) => hashes,
        Err(why) => {
            let finding = Finding::new(Code::CorruptData, file.name(), "rows that fit into memory", why.to_string());
            return vec![Located { row: 0, finding }];
        }
    };
    let starts = &episodes.offsets[..episodes.len()];
    let stated = hashes.texts(starts);
    let mut found = Vec::new();
    for ((row, hash), stated) in starts.iter().copied().zip(hashes_of_rows).zip(stated) {
        if let Some(stated) = stated.filter(|stated| **stated != hash) {
            let mut finding =
                Finding::new(Code::CorruptData, file.name(), format!("the hash {hash} of its rows"), stated)
                    .in_row_group(episodes.row_group(row))
                    .in_column(EPISODE_HASH)
                    .with_help(HELP);
            finding.episode = episodes.id(row).map(str::to_owned);
            found.push(Located { row, finding });
        }
    }
    found
}

/// The hash of each episode. One column at a time has a value per row: all at once took 900 MB for a file of 0.4 MB.
fn all_hashes(names: &[&str], layout: &Layout, episodes: &Episodes) -> Result<Vec<String>, ArrowError> {
    let flat = |name: &str| layout.position(name).map(|at| episodes.columns[at].flat()).transpose();
    let identification = names.contains(&IDENTIFICATION).then(|| flat(IDENTIFICATION)).transpose()?.flatten();
    let mut forms: Vec<CanonicalForm> = (0..episodes.len()).map(|_| CanonicalForm::new()).collect();
    let mut lines = Vec::new();
    for name in names {
        let Some(values) = flat(name)? else { continue };
        let derived =
            |row: usize| *name == SELF_COLOR && identification.as_ref().is_some_and(|texts| texts.is_valid(row));
        for (form, ends) in forms.iter_mut().zip(episodes.offsets.windows(2)) {
            let rows = ends[0]..ends[1];
            form.add(&mut lines, name, rows.map(|row| value_at(&values, row).filter(|_| !derived(row))));
        }
    }
    Ok(forms.into_iter().map(CanonicalForm::finish).collect())
}

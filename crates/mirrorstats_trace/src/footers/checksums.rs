//! Notes about traces without checksums or with those of another file.

pub use mirrorstats_parquet_pages::checksums::Checksums;

use crate::read::open::TraceFile;

pub fn stale_note(files: &[TraceFile]) -> Option<String> {
    let stale = named(files, Checksums::Stale)?;
    Some(format!(
        "{stale}: another program wrote the rows again and copied the checksums of the file that it read; they are not \
         checked, and damage is not found; use that file where you have it"
    ))
}

pub fn missing_note(files: &[TraceFile]) -> Option<String> {
    let missing = named(files, Checksums::None)?;
    Some(format!("{missing}: no checksums; damage to the data may not be found"))
}

fn named(files: &[TraceFile], state: Checksums) -> Option<String> {
    let mut of_state = files.iter().filter(|file| file.checksums() == state);
    let first = of_state.next()?.path().file_name()?.to_string_lossy();
    Some(match of_state.count() {
        0 => first.into_owned(),
        1 => format!("{first} and one other file"),
        more => format!("{first} and {more} other files"),
    })
}

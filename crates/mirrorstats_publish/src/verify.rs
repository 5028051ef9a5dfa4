//! Checks a bundle: hashes, then every derived file again from the sources under the published definitions.
//!
//! Rule: a change is found even if the manifest was rewritten to match it. Sources are named with their hashes in
//! `croissant.json` too; traces state hashes of their episodes and digests of their frames; the rest is made again.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::Path;

use mirrorstats_exact::replace::TemporaryFolder;
use mirrorstats_report::bundle::MANIFEST;
use mirrorstats_study::findings::findings;
use mirrorstats_study::inputs::InputError;
use mirrorstats_study::verify::{Difference, Kind, Verification, verify as verify_hashes};
use mirrorstats_trace::diagnostic::Severity;

use crate::compare::compare;
pub use crate::manifest::is_bundle;
use crate::manifest::{Manifest, list, read_text};
use crate::{Progress, PublishError, croissant, derive};

/// Verifies a bundle. Errors: a folder that cannot be read. A damaged file is a difference, not an error.
pub fn verify(folder: &Path, threads: NonZeroUsize, progress: Progress<'_>) -> Result<Verification, PublishError> {
    progress("hashes");
    let of_manifest = |found: String| {
        let difference =
            Difference::new(MANIFEST, Kind::Changed, "the manifest as `mirrorstats publish` wrote it", found);
        Verification { differences: vec![difference], ..Verification::default() }
    };
    let (manifest, text) = match read_text(folder) {
        Ok(read) => read,
        Err(error) => return Ok(of_manifest(error.to_string())),
    };
    let mut found = match verify_hashes(folder) {
        Ok(found) => found,
        Err(error) => return Ok(of_manifest(error.to_string())),
    };
    if !manifest.is_intact(&text) {
        found.differences.extend(of_manifest("other bytes".to_owned()).differences);
    }
    add_second_record(folder, &mut found)?;
    add_recomputed(folder, &manifest, threads, progress, &mut found)?;
    found.differences.sort_by(|a, b| (&a.path, &a.cell).cmp(&(&b.path, &b.cell)));
    Ok(found)
}

/// Compares the sources with the hashes in `croissant.json`.
fn add_second_record(folder: &Path, found: &mut Verification) -> Result<(), PublishError> {
    let text = std::fs::read(folder.join(croissant::NAME)).unwrap_or_default();
    let stated: std::collections::BTreeMap<_, _> = croissant::stated(&text).into_iter().collect();
    let sources = croissant::sources(folder)?;
    for path in stated.keys().filter(|path| sources.iter().all(|source| source.path != **path)) {
        if found.differences.iter().all(|difference| difference.path != *path) {
            let expected = format!("the source that {} states", croissant::NAME);
            found.differences.push(Difference::new(path, Kind::Missing, expected, "no such file"));
        }
    }
    for source in sources {
        let known = found.differences.iter().any(|difference| difference.path == source.path);
        let stated = stated.get(&source.path).map_or("no such file", String::as_str);
        if !known && stated != source.sha256 {
            let expected = format!("the SHA-256 {stated}, as {} states", croissant::NAME);
            let found_here = format!("the SHA-256 {}", source.sha256);
            found.differences.push(Difference::new(source.path, Kind::Changed, expected, found_here));
        }
    }
    Ok(())
}

/// Makes the derived files again and compares them.
fn add_recomputed(
    folder: &Path,
    manifest: &Manifest,
    threads: NonZeroUsize,
    progress: Progress<'_>,
    found: &mut Verification,
) -> Result<(), PublishError> {
    let base = std::fs::canonicalize(folder).map_err(PublishError::file(folder))?;
    let again = TemporaryFolder::private("verify").map_err(PublishError::file(folder))?;
    progress("traces");
    let made = add_findings(&base, manifest, threads, found)
        .and_then(|()| derive::derive(&base, again.path(), &manifest.settings, threads, progress));
    match made {
        Ok(derived) => found.episodes = Some(derived.episodes),
        // A file that another program writes to says nothing about the bundle.
        Err(PublishError::Study(error)) if matches!(error.cause(), Some(InputError::Changed { .. })) => {
            return Err(error.into());
        }
        Err(error) => {
            // Damage that the hashes show explains the failure.
            if found.holds() {
                let words = error.to_string();
                let expected = "a file from which the rest can be made again";
                found.differences.push(Difference::new(blamed(&base, &words)?, Kind::Changed, expected, words));
            } else {
                found.notes.push(format!("nothing was computed again: {error}"));
            }
            return Ok(());
        }
    }
    progress("comparison");
    let known: BTreeSet<String> = found.differences.iter().map(|difference| difference.path.clone()).collect();
    let made = list(again.path())?;
    let is_own_version = manifest.version == env!("CARGO_PKG_VERSION");
    if !is_own_version {
        found.notes.push(format!(
            "mirrorstats {} wrote the bundle: figures and pages were compared by their hashes alone",
            manifest.version
        ));
    }
    for path in &made {
        let (published, new) = (base.join(path), again.path().join(path));
        let is_data = [".csv", ".parquet", ".toml", ".txt", ".tex", ".md"].iter().any(|ending| path.ends_with(ending));
        if published.is_file() && (is_own_version || is_data) {
            found.differences.extend(compare(&published, &new, path)?);
        } else if !published.is_file() && !known.contains(path) {
            let expected = "the file that the sources give";
            found.differences.push(Difference::new(path, Kind::Missing, expected, "no such file"));
        }
    }
    let expected: BTreeSet<String> =
        made.into_iter().chain(croissant::sources(&base)?.into_iter().map(|file| file.path)).collect();
    for path in list(&base)?.into_iter().filter(|path| !expected.contains(path) && !known.contains(path)) {
        let found_here = "a file that the sources do not give";
        found.differences.push(Difference::new(path, Kind::Unexpected, "no such file", found_here));
    }
    Ok(())
}

/// Adds the errors that validation finds in the traces.
fn add_findings(
    base: &Path,
    manifest: &Manifest,
    threads: NonZeroUsize,
    found: &mut Verification,
) -> Result<(), PublishError> {
    let definitions = derive::question(base, &manifest.settings).definitions;
    for finding in findings(definitions.as_deref(), &derive::inputs(base)?, threads)?.findings {
        if finding.severity == Severity::Error {
            let at = [finding.episode, finding.t.map(|t| format!("t = {t}")), finding.column];
            let cell: Vec<String> = at.into_iter().flatten().collect();
            let cell = (!cell.is_empty()).then(|| cell.join(", "));
            let difference = Difference::new(finding.file, Kind::Changed, finding.expected, finding.found);
            found.differences.push(Difference { cell, ..difference });
        }
    }
    Ok(())
}

/// The file of the bundle that an error names, else the folder of the traces.
fn blamed(base: &Path, words: &str) -> Result<String, PublishError> {
    let files = list(base)?;
    let named = files.iter().filter(|path| words.contains(path.as_str())).max_by_key(|path| path.len());
    Ok(named.cloned().unwrap_or_else(|| crate::sources::TRACES.to_owned()))
}

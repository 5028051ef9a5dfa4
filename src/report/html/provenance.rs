//! Where the numbers of the page come from.

use serde::Serialize;

use crate::base::visible::visible;
use crate::report::bundle::Manifest;

/// The manifest for the templates.
#[derive(Debug, Serialize)]
pub(super) struct Provenance {
    version: String,
    schema_version: u32,
    definitions: Source,
    style: Source,
    filter: Option<String>,
    by: String,
    metrics: String,
    inputs: Vec<InputView>,
    /// The text of `manifest.json` without its outputs: the hash of the page is among them.
    manifest: String,
}

/// Something with a name and a hash.
#[derive(Debug, Serialize)]
struct Source {
    name: String,
    sha256: String,
    /// The first twelve digits of the hash.
    short: String,
}

/// A file that was read.
#[derive(Debug, Serialize)]
struct InputView {
    path: String,
    bytes: u64,
    sha256: String,
}

impl Provenance {
    /// The provenance that a manifest states.
    pub(super) fn of(manifest: &Manifest) -> Self {
        let names = |names: &[String]| names.iter().map(|name| visible(name)).collect::<Vec<_>>().join(", ");
        let input = |input: &crate::report::bundle::Input| InputView {
            path: visible(&input.path),
            bytes: input.bytes,
            sha256: input.sha256.clone(),
        };
        Self {
            version: manifest.version.clone(),
            schema_version: manifest.schema_version,
            definitions: Source::new(&manifest.definitions.name, &manifest.definitions.hash),
            style: Source::new(&manifest.style.name, &manifest.style.sha256),
            filter: manifest.filter.as_deref().map(visible),
            by: names(&manifest.by),
            metrics: names(&manifest.metrics),
            inputs: manifest.inputs.iter().map(input).collect(),
            manifest: manifest.json().lines().map(visible).collect::<Vec<_>>().join("\n"),
        }
    }
}

impl Source {
    fn new(name: &str, sha256: &str) -> Self {
        Self { name: visible(name), sha256: sha256.to_owned(), short: sha256.chars().take(12).collect() }
    }
}

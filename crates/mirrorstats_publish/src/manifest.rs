//! The manifest of a bundle: settings, withheld parts, and the hash of every file.

use std::io;
use std::path::Path;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::{hash, input};
use mirrorstats_metric::file;
use mirrorstats_report::bundle::{MANIFEST, Output};
use mirrorstats_report::style;
use mirrorstats_study::provenance::is_plain;
use mirrorstats_study::verify::entries;
use mirrorstats_trace::schema::SCHEMA_VERSION;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::PublishError;
use crate::about::About;

const FORMAT: &str = "mirrorstats bundle 1";
const LARGEST: Limit = Limit::new("bytes of a manifest", 64 << 20);

/// The frames of a bundle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Frames {
    None,
    /// The frames of the steps that decided a metric.
    Decisive,
    /// All frames, and the logs beside the traces.
    #[default]
    All,
}

/// A part that was left out, named by its hash.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Withheld {
    /// Its kind: `episode`, `log` or `prompt`.
    pub kind: String,
    /// SHA-256 of its content; of an episode without a hash, of its id.
    pub sha256: String,
    /// The reason.
    pub reason: String,
}

/// All that a bundle is made from, except its sources.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub(crate) struct Settings {
    /// Definitions: a built-in name, or a file in the bundle; absent for those that the traces name.
    pub definitions: Option<String>,
    /// The style of tables: a built-in name, or a file in the bundle.
    pub style: String,
    pub frames: Frames,
    /// The filter over episodes, as typed.
    #[serde(rename = "where")]
    pub filter: Option<String>,
    /// The columns that the cells are grouped by; absent for the default.
    pub by: Option<Vec<String>>,
    /// The metrics; absent for all.
    pub metrics: Option<Vec<String>>,
    /// True if a cell may mix episodes that were recorded differently.
    pub pool: bool,
    /// True if lost episodes count as failures.
    pub lost_as_failures: bool,
    pub about: About,
    pub withheld: Vec<Withheld>,
}

/// The manifest of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "BundleManifest")]
pub struct Manifest {
    /// The format of the folder.
    format: String,
    /// The version of mirrorstats.
    pub version: String,
    /// The version of the trace schema.
    schema_version: u32,
    /// The number of counted episodes.
    pub episodes: usize,
    pub(crate) settings: Settings,
    /// Every other file, ordered by path.
    pub outputs: Vec<Output>,
    /// SHA-256 of this manifest with an empty text here.
    sha256: String,
}

impl Manifest {
    pub(crate) fn of_folder(base: &Path, settings: Settings, episodes: usize) -> Result<Self, PublishError> {
        let outputs = list(base)?.into_iter().map(|path| output_of(base, path)).collect::<Result<_, _>>()?;
        let manifest = Self {
            format: FORMAT.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            schema_version: SCHEMA_VERSION,
            episodes,
            settings,
            outputs,
            sha256: String::new(),
        };
        Ok(Self { sha256: manifest.own_hash(), ..manifest })
    }

    /// The withheld parts, named by their hashes.
    pub fn withheld(&self) -> &[Withheld] {
        &self.settings.withheld
    }

    fn own_hash(&self) -> String {
        hash::of_bytes(Self { sha256: String::new(), ..self.clone() }.json().as_bytes())
    }

    pub(crate) fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a manifest holds only texts, integers and lists") + "\n"
    }

    /// Returns true if the text is exactly this manifest with its own hash.
    pub(crate) fn is_intact(&self, text: &[u8]) -> bool {
        self.sha256 == self.own_hash() && text == self.json().as_bytes()
    }
}

/// Returns true if the folder has the manifest of a bundle, valid or not.
pub fn is_bundle(folder: &Path) -> bool {
    let text = input::bytes(&folder.join(MANIFEST), LARGEST).unwrap_or_default();
    let is_one = |text: &str| text.contains("\"settings\"") || text.contains(FORMAT);
    is_one(&String::from_utf8_lossy(&text)) || folder.join("croissant.json").is_file()
}

/// The manifest and its text.
pub(crate) fn read_text(folder: &Path) -> Result<(Manifest, Vec<u8>), PublishError> {
    let path = folder.join(MANIFEST);
    let text = input::bytes(&path, LARGEST).map_err(PublishError::file(&path))?;
    let manifest: Manifest = serde_json::from_slice(&text).map_err(|error| {
        PublishError::Refused(format!("{}: expected the manifest of a bundle, found {error}", path.display()))
    })?;
    if manifest.format != FORMAT || manifest.schema_version > SCHEMA_VERSION {
        let (path, found) = (path.display(), &manifest.format);
        return Err(PublishError::Refused(format!(
            "{path}: expected `{FORMAT}` over trace schema {SCHEMA_VERSION}, found `{found}` over {}",
            manifest.schema_version
        )));
    }
    let settings = &manifest.settings;
    let named = [settings.definitions.as_deref(), Some(settings.style.as_str())];
    let is_inside = |name: &str| {
        let is_built_in = file::built_in(name).is_some() || style::built_in(name).is_some();
        is_built_in || (name.contains('/') && is_plain(name))
    };
    // Rule of `verify`: no name leads out of the folder.
    if let Some(name) = named.into_iter().flatten().find(|name| !is_inside(name)) {
        let (path, name) = (path.display(), visible(name));
        return Err(PublishError::Refused(format!(
            "{path}: expected a built-in name or a file of the bundle, found `{name}`"
        )));
    }
    Ok((manifest, text))
}

pub(crate) fn read(folder: &Path) -> Result<Manifest, PublishError> {
    read_text(folder).map(|(manifest, _)| manifest)
}

/// The files of a folder without its manifest, by path, `/` between their parts.
pub(crate) fn list(base: &Path) -> Result<Vec<String>, PublishError> {
    let found = entries(base).map_err(|(path, source)| PublishError::File { path, source })?;
    Ok(found.into_keys().filter(|path| path != MANIFEST).collect())
}

pub(crate) fn output_of(base: &Path, path: String) -> Result<Output, PublishError> {
    let at = base.join(&path);
    let read = || -> io::Result<_> {
        let file = input::open(&at)?;
        Ok((file.metadata()?.len(), hash::of_reader(file)?))
    };
    let (bytes, sha256) = read().map_err(PublishError::file(&at))?;
    Ok(Output { path, sha256, bytes })
}

//! Limits on the values of steps beyond the schema, and the trace's declarations about them.

use serde_json::{Value, json};

use super::error::ImportError;
use super::format::Format;
use super::text::Text;
use crate::declared::{Cluster, Origin};
use crate::schema::colors::palette::Palette;
use crate::validate::Expected;

#[derive(Clone, Copy, Debug, Default)]
pub struct Limits<'a> {
    /// The known experiments, the domain, and its declared columns.
    pub expected: Expected<'a>,
    /// The name of the domain; the mirror if `None`.
    pub domain: Option<&'a str>,
    /// The known colours, which the trace then declares; any if `None`.
    pub palette: Option<&'a Palette>,
    pub cluster: Option<Cluster>,
    /// True if the steps were rebuilt from published numbers, so that other values in them are arbitrary.
    pub is_reconstruction: bool,
}

impl Limits<'_> {
    pub(super) fn recording(&self, texts: &mut [Text]) -> Result<Value, ImportError> {
        let sources = texts.iter_mut().map(Text::hash).collect::<Result<Vec<_>, _>>()?;
        let origin = if self.is_reconstruction { Origin::Reconstruction } else { Origin::Import };
        let mut recording = json!({ "kind": origin.name(), "sources": sources });
        if let Some(domain) = self.domain {
            recording["domain"] = json!(domain);
        }
        if let Some(palette) = self.palette {
            recording["palette"] = json!(palette.names());
        }
        if let Some(cluster) = self.cluster {
            recording["design"] = json!({ "cluster": cluster });
        }
        if let Some(source) = texts.iter().find_map(Text::source) {
            recording["mapping"] = source.mapping.clone();
            let format = |text: &Text| text.source().map_or(Format::JsonLines, |source| source.format).name();
            recording["formats"] = texts.iter().map(format).collect();
        }
        Ok(recording)
    }
}

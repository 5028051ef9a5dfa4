//! The texts of a bundle for people and registries: the data card and the citation.

use std::fmt::Write as _;
use std::fs::File;
use std::path::Path;

use arrow::datatypes::DataType;
use mirrorstats_exact::format::counted;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value, json};

use crate::PublishError;
use crate::about::About;
use crate::frames::FRAMES;
use crate::manifest::{Settings, list};
use crate::sources::TRACES;

pub(crate) struct Card<'c> {
    pub settings: &'c Settings,
    pub base: &'c Path,
    pub out: &'c Path,
    pub episodes: usize,
    /// The main table as Markdown.
    pub table: &'c str,
    /// Whether episodes of one scene are pairs; `None` without scenes.
    pub pairs: Option<&'c str>,
    pub traces: &'c TraceSet,
}

impl Card<'_> {
    /// `README.md`: metadata as YAML for the Hub, then text for people.
    pub fn readme(&self) -> Result<String, PublishError> {
        let about = &self.settings.about;
        let (rows, has_frames) = (self.traces.files().iter().map(TraceFile::rows).sum::<u64>(), self.has_frames());
        let license = about.license.as_deref().unwrap_or("unknown").to_ascii_lowercase();
        let tags = ["mirrorstats", "evaluation", "embodied-ai", "agents"].map(str::to_owned);
        let tags: Vec<String> = tags.into_iter().chain(about.tags.iter().cloned()).collect();
        let (mut configs, mut infos) = (Vec::new(), Vec::new());
        for (name, files) in self.configs()? {
            let pattern = if name == "episodes" { "scores.parquet".to_owned() } else { format!("{name}/*.parquet") };
            let pattern = pattern.replace("steps/", &format!("{TRACES}/"));
            configs.push(json!({"config_name": name, "data_files": pattern}));
            infos.push(json!({"config_name": name, "features": features(name, &files)?}));
        }
        configs[0]["default"] = true.into();
        let front = json!({
            "pretty_name": about.title(), "license": license, "tags": tags, "size_categories": [size(rows)],
            "configs": configs, "dataset_info": infos,
        });
        // JSON is YAML: quoting is never in doubt.
        let mut text = format!("---\n{front:#}\n---\n\n# {}\n\n{}\n\n", about.title(), about.description());
        let episodes = counted(self.episodes as u64, "episode");
        let _ = writeln!(text, "{episodes}, {}.\n\n## Results\n\n{}\n", counted(rows, "step"), self.table.trim_end());
        if let Some(pairs) = self.pairs {
            let _ = writeln!(text, "Comparisons by scene: {pairs}.\n");
        }
        text.push_str(LAYOUT);
        let names: &[&str] = if has_frames { &["episodes", "steps", "frames"] } else { &["episodes", "steps"] };
        text.push_str("\n## Load\n\n```python\nfrom datasets import load_dataset\n\n");
        for name in names {
            let _ = writeln!(text, "{name} = load_dataset(\".\", \"{name}\", split=\"train\")");
        }
        text.push_str(CHECK);
        if !self.settings.withheld.is_empty() {
            text.push_str("\n## Withheld\n\n| what | SHA-256 | reason |\n|---|---|---|\n");
            for part in &self.settings.withheld {
                let _ = writeln!(text, "| {} | `{}` | {} |", part.kind, part.sha256, part.reason);
            }
        }
        Ok(text)
    }

    fn has_frames(&self) -> bool {
        self.out.join(FRAMES).is_dir()
    }

    /// The tables by name, with their files.
    fn configs(&self) -> Result<Vec<(&'static str, Vec<std::path::PathBuf>)>, PublishError> {
        let inside = |base: &Path, folder: &str| -> Result<Vec<_>, PublishError> {
            let folder = base.join(folder);
            let names = list(&folder)?.into_iter().filter(|name| name.ends_with(".parquet"));
            Ok(names.map(|name| folder.join(name)).collect())
        };
        let mut configs =
            vec![("episodes", vec![self.out.join("scores.parquet")]), ("steps", inside(self.base, TRACES)?)];
        if self.has_frames() {
            configs.push((FRAMES, inside(self.out, FRAMES)?));
        }
        Ok(configs)
    }
}

const LAYOUT: &str = include_str!("../../../assets/publish/files.md");
const CHECK: &str = include_str!("../../../assets/publish/check.md");

fn size(rows: u64) -> &'static str {
    match rows {
        0..1_000 => "n<1K",
        1_000..10_000 => "1K<n<10K",
        10_000..100_000 => "10K<n<100K",
        100_000..1_000_000 => "100K<n<1M",
        1_000_000..10_000_000 => "1M<n<10M",
        _ => "10M<n<100M",
    }
}

/// The columns of files together, each with its type as `datasets` names it.
fn features(config: &str, files: &[std::path::PathBuf]) -> Result<Value, PublishError> {
    let mut features: Vec<Value> = Vec::new();
    for path in files {
        let file = File::open(path).map_err(PublishError::file(path))?;
        let refused =
            |error: parquet::errors::ParquetError| PublishError::Refused(format!("{}: {error}", path.display()));
        for field in ParquetRecordBatchReaderBuilder::try_new(file).map_err(refused)?.schema().fields() {
            if features.iter().any(|known| known["name"] == *field.name()) {
                continue;
            }
            let dtype =
                if config == FRAMES && field.name() == "image" { "image".to_owned() } else { dtype(field.data_type()) };
            features.push(json!({"name": field.name(), "dtype": dtype}));
        }
    }
    Ok(features.into())
}

/// The type of a column as `datasets` names it.
pub(crate) fn dtype(kind: &DataType) -> String {
    match kind {
        DataType::Boolean => "bool".to_owned(),
        DataType::LargeUtf8 => "large_string".to_owned(),
        number if number.is_numeric() => number.to_string().to_lowercase(),
        _ => "string".to_owned(),
    }
}

/// `CITATION.cff`.
pub(crate) fn citation(about: &About) -> String {
    let mut text = format!(
        "cff-version: 1.2.0\nmessage: {}\ntype: dataset\ntitle: {}\nabstract: {}\nauthors:\n",
        json!("If you use this data set, please cite it as below."),
        json!(about.title()),
        json!(about.description()),
    );
    let anonymous = ["Anonymous".to_owned()];
    for author in if about.authors.is_empty() { &anonymous[..] } else { &about.authors } {
        let _ = match author.split_once(',') {
            Some((family, given)) => {
                writeln!(text, "  - family-names: {}\n    given-names: {}", json!(family.trim()), json!(given.trim()))
            }
            None => writeln!(text, "  - name: {}", json!(author)),
        };
    }
    for (key, value) in [("license", &about.license), ("url", &about.url), ("doi", &about.doi)] {
        if let Some(value) = value {
            let _ = writeln!(text, "{key}: {}", json!(value));
        }
    }
    text
}

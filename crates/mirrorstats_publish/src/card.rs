//! The texts of a bundle for people and registries: the data card and the citation.

use std::fmt::Write as _;
use std::fs::File;
use std::path::Path;

use arrow::datatypes::DataType;
use mirrorstats_exact::format::counted;
use mirrorstats_trace::read::open::TraceSet;
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
        let (rows, has_frames) = (self.traces.files().iter().map(|file| file.rows()).sum::<u64>(), self.has_frames());
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
        let mut text = format!("---\n{}---\n\n# {}\n\n{}\n\n", yaml(&front), about.title(), about.description());
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

const LAYOUT: &str = "\
## Files

| path | contents |
|---|---|
| `traces/` | one row per step, as recorded; logs with frames beside them, if they are published |
| `frames/` | the frames of steps as images, if they are published |
| `scores.parquet` | one row per episode, with every metric |
| `definitions/` | the definitions of the metrics |
| `experiments/`, `world/`, `prompts/` | what the agents were shown and asked, as the traces declare it |
| `report/` | tables and figures; open `report/report.html` |
| `viewer/` | each episode step by step; open `viewer/index.html` |
| `croissant.json`, `CITATION.cff` | metadata for registries |
| `manifest.json` | the settings, and the SHA-256 of every file |
";

const CHECK: &str = "\
```

## Check

```sh
pip install mirrorstats
mirrorstats verify .     # hashes; then every score, cell, table and figure again from the traces
```
";

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
            let dtype = if config == FRAMES && field.name() == "image" { "image" } else { dtype(field.data_type()) };
            features.push(json!({"name": field.name(), "dtype": dtype}));
        }
    }
    Ok(features.into())
}

fn dtype(kind: &DataType) -> &'static str {
    match kind {
        DataType::Boolean => "bool",
        DataType::Int8 => "int8",
        DataType::Int16 => "int16",
        DataType::Int32 => "int32",
        DataType::Int64 => "int64",
        DataType::UInt8 => "uint8",
        DataType::UInt16 => "uint16",
        DataType::UInt32 => "uint32",
        DataType::UInt64 => "uint64",
        DataType::Float32 => "float32",
        DataType::Float64 => "float64",
        DataType::LargeUtf8 => "large_string",
        DataType::Null => "null",
        _ => "string",
    }
}

/// Block style for the outer levels, which registries show; JSON for the rest.
fn yaml(front: &Value) -> String {
    let mut text = String::new();
    for (key, value) in front.as_object().into_iter().flatten() {
        match value.as_array().filter(|items| items.iter().all(Value::is_object)) {
            None => {
                let _ = writeln!(text, "{key}: {value}");
            }
            Some(items) => {
                let _ = writeln!(text, "{key}:");
                for item in items {
                    let lines = item.as_object().into_iter().flatten().map(|(key, value)| match value.as_array() {
                        None => format!("{key}: {value}"),
                        Some(parts) => {
                            let parts = parts.iter().map(|part| format!("\n    - {part}"));
                            format!("{key}:{}", parts.collect::<String>())
                        }
                    });
                    let _ = writeln!(text, "  - {}", lines.collect::<Vec<_>>().join("\n    "));
                }
            }
        }
    }
    text
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

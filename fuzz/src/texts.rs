//! Text files from a user or an older run: each parsed file prints, and parses again to the same.

use std::fs;
use std::io;
use std::sync::LazyLock;

use mirrorstats_analysis::plan::register::RegisteredPlan;
use mirrorstats_experiment::file;
use mirrorstats_experiment::spec::Spec;
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_report::bundle::{Manifest, check_old};
use mirrorstats_report::style::Style;
use mirrorstats_score::format::{self, Format, Partition};
use mirrorstats_score::vocabulary;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_toml_spec::Source;
use mirrorstats_trace::beside::lost;

use crate::depth::reached;
use crate::{episodes, scratch};

static PAPER: LazyLock<Catalog> = LazyLock::new(|| {
    let columns = vocabulary::trace_columns(episodes::open());
    Definitions::load("paper", &columns).expect("definitions that are built in").catalog
});

/// `manifest.json`, as `rescore` reads it and as a new report reads an older one.
pub fn manifest(data: &[u8]) {
    let folder = scratch::path("report");
    fs::create_dir_all(&folder).expect("a folder for temporary files");
    fs::write(folder.join("manifest.json"), data).expect("a folder for temporary files");
    let _ = check_old(&folder, &[]);
    let Ok(manifest) = serde_json::from_slice::<Manifest>(data) else { return };
    reached("parsed");
    let again: Manifest = serde_json::from_str(&manifest.json()).expect("a manifest that was printed");
    assert_eq!((&again, again.json()), (&manifest, manifest.json()));
    let columns = vocabulary::trace_columns(episodes::open());
    if let Ok(definitions) = Definitions::of_catalog(&manifest.definitions, &columns) {
        reached("definitions");
        assert_eq!(definitions.catalog.hash, manifest.definitions.hash);
    }
}

/// A style file.
pub fn style(data: &[u8]) {
    let path = scratch::file("style.toml", data);
    let Ok(style) = Style::load(path.to_str().expect("a path in UTF-8")) else { return };
    reached("parsed");
    let _ = style.check_against(&PAPER);
    assert!(style.sheet.table.contains_key("main"));
    for table in style.sheet.table.values() {
        assert!(style.sheet.print_of(table).decimals.rate <= 9);
        assert!(!table.columns.is_empty());
    }
}

/// A file of changes to the world's configuration: the result prints as a whole file that parses to the same.
pub fn world(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(config) = WorldConfig::from_toml(text) else { return };
    reached("parsed");
    let printed = toml::to_string(&config).expect("numbers and texts");
    let again = WorldConfig::from_toml(&printed).unwrap_or_else(|fault| panic!("{fault}\n{printed}"));
    assert_eq!((again.hash(), &again), (config.hash(), &config));
}

/// A file of experiments: each experiment survives being printed as a declaration and read again.
pub fn experiments(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let source = Source { name: "fuzzed.toml".into(), text: text.to_owned() };
    let entries = match file::read(source, None, &[]) {
        Ok(entries) => entries,
        Err(faults) => {
            assert!(!faults.to_string().is_empty());
            return;
        }
    };
    reached("parsed");
    assert!(!entries.is_empty());
    for entry in entries {
        let printed = serde_json::to_string(&*entry.experiment).expect("numbers, texts and lists");
        let again: Spec = serde_json::from_str(&printed).unwrap_or_else(|error| panic!("{error}: {printed}"));
        assert_eq!(again, *entry.experiment);
    }
}

/// A registered plan.
pub fn plan(data: &[u8]) {
    let Ok(plan) = serde_json::from_slice::<RegisteredPlan>(data) else { return };
    reached("parsed");
    let again: RegisteredPlan = serde_json::from_str(&plan.to_json()).expect("a plan that was printed");
    assert_eq!((again.to_json(), again.is_unchanged()), (plan.to_json(), plan.is_unchanged()));
}

/// `lost.jsonl`.
pub fn lost_episodes(data: &[u8]) {
    let Ok(lost) = lost::read(&scratch::file("lost.jsonl", data)) else { return };
    reached("parsed");
    let lines: Vec<String> = lost.iter().map(|lost| serde_json::to_string(lost).expect("texts and integers")).collect();
    let again = lost::read(&scratch::file("lost-again.jsonl", lines.join("\n").as_bytes()));
    assert_eq!(again.expect("a list that was printed"), lost);
}

/// Scores; the first byte chooses the format. What is read is written and read again.
pub fn scores(data: &[u8]) {
    let Some((first, data)) = data.split_first() else { return };
    let format = [Format::Csv, Format::JsonLines, Format::Parquet][usize::from(first % 3)];
    let read = |bytes: &[u8]| match format {
        Format::Parquet => {
            let file = std::fs::File::open(scratch::file("scores.parquet", bytes)).expect("a file that was written");
            format::read_parquet(file, &Partition::default())
        }
        _ => format::read_text(format, &PAPER, io::Cursor::new(bytes.to_vec())),
    };
    let Ok(table) = read(data) else { return };
    reached("parsed");
    let mut written = Vec::new();
    format::write(&table, format, &mut written).expect("memory takes any bytes");
    let again = read(&written).expect("scores that were written");
    let mut twice = Vec::new();
    format::write(&again, format, &mut twice).expect("memory takes any bytes");
    assert_eq!(again, table);
    assert!(twice == written, "scores that are written twice are not the same");
}

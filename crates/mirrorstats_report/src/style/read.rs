//! Style files: a file overrides its includes, key by key in tables, and replaces whole lists.
//!
//! Rule: a file that says nothing about a setting never changes its meaning. So a style starts from `default`, unless
//! it lists its includes.

use std::io;
use std::path::Path;

use toml::Value;

use super::{MAIN_TABLE, OTHER_TABLE, Style, StyleError, StyleSheet};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::hash;
use mirrorstats_exact::suggest::hint;
use mirrorstats_figures::shown::FIGURES;
use mirrorstats_figures::{FigureError, FigureName};
use mirrorstats_toml_spec::{At, Fault, FileKind, Place, Shape, lay};

/// The style that others start from.
const DEFAULT: &str = "default";

pub(super) const KIND: FileKind = FileKind {
    name: "style",
    names: "styles",
    check: "mirrorstats style check FILE",
    built_in: &[
        (DEFAULT, include_str!("../../../../assets/styles/default.toml")),
        ("paper", include_str!("../../../../assets/styles/paper.toml")),
    ],
    largest: Limit::new("bytes of a style", 1 << 20),
    most_keys: Limit::new("keys in a style", 10_000),
    most_includes: Limit::new("includes of a style, those of included files counted", 32),
};

pub(super) fn read(path: &Path) -> Result<Style, StyleError> {
    let file = KIND.open(path, path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => {
            let name = path.display().to_string();
            StyleError::Unknown { hint: hint(&name, KIND.built_in_names()), name }
        }
        _ => StyleError::Unreadable { path: path.to_owned(), source },
    })?;
    let figures: Value = toml::from_str(FIGURES).expect("the file comes with the program");
    let mut merged = Value::Table([("figure".to_owned(), figures)].into_iter().collect());
    let (shape, mut named) = (Shape::of::<StyleSheet>(), Vec::new());
    let (mut sheet, mut base, mut is_first) = (None, None, true);
    let texts = KIND.read(file, |at, part, faults| {
        if is_first && part.built_in.is_none() && at.get("include").is_none() {
            base = KIND.built_in_text(DEFAULT);
            lay(&mut merged, toml::from_str(base.expect("a built-in style")).expect("the file comes with the program"));
        }
        is_first = false;
        if let Some(own) = shape.value(at, "a style", faults) {
            lay(&mut merged, own);
        }
        check(at, faults);
        if part.built_in.is_none() {
            // Built-in files may name metrics that the definitions lack.
            named.extend(metrics(at));
        }
        if part.is_outermost && faults.is_empty() {
            let whole: StyleSheet = merged.clone().try_into().expect("values of the shape, over others of it");
            check_tables(&whole, at, faults);
            sheet = Some(whole);
        }
    })?;
    let texts = texts.iter().map(|source| source.text.as_str()).chain(base);
    let hashes: Vec<String> = texts.map(|text| hash::of_bytes(text.as_bytes())).collect();
    let hash = match hashes.as_slice() {
        [one] => one.clone(),
        several => hash::of_bytes(several.join("\n").as_bytes()),
    };
    let sheet = sheet.expect("without a fault, the outermost file is whole");
    let is_built_in = KIND.built_in_names().into_iter().any(|name| path == Path::new(name));
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(Style { name, hash, sheet, is_built_in, named })
}

fn metrics(at: &At<'_>) -> Vec<(String, Place)> {
    let lists = at.within("table").flat_map(|(_, table)| [table.get("columns"), table.get("undefined_as_zero")]);
    let lists = lists.chain(at.within("figure").map(|(_, figure)| figure.get("metrics"))).flatten();
    let listed = lists.flat_map(|list| list.items().collect::<Vec<_>>());
    let listed = listed.map(|at| (at.written().to_owned(), at.place()));
    at.within("column").map(|(metric, at)| (metric.to_owned(), at.name_place())).chain(listed).collect()
}

fn check(at: &At<'_>, faults: &mut Vec<Fault>) {
    for (name, table) in at.within("table") {
        let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-' || b == b'_';
        if name.is_empty() || !name.bytes().all(is_plain) || name == OTHER_TABLE {
            let message = format!(
                "`{name}` cannot name a table: expected lowercase letters, digits, `-` and `_`, and not `{OTHER_TABLE}`"
            );
            faults.push(Fault::new(table.name_place(), message).help("the name becomes that of a file"));
        }
        let Some(columns) = table.get("columns") else { continue };
        let listed: Vec<At<'_>> = columns.items().collect();
        if listed.is_empty() {
            let fault = columns.fault(format!("table `{name}` has no columns"));
            faults.push(fault.help("name at least one metric"));
        }
        for (n, metric) in listed.iter().enumerate() {
            if metric.is_text() && listed[..n].iter().any(|before| before.written() == metric.written()) {
                faults.push(metric.fault(format!("table `{name}`: the metric `{}` is listed twice", metric.written())));
            }
        }
    }
    for (name, figure) in at.within("figure") {
        let known: FigureName = match name.parse() {
            Ok(known) => known,
            Err(unknown) => {
                faults.push(Fault::new(figure.name_place(), FigureError::to_string(&unknown)));
                continue;
            }
        };
        let Some(metrics) = figure.get("metrics") else { continue };
        if let Err(wrong) = known.check_count(metrics.items().count()) {
            faults.push(metrics.fault(FigureError::to_string(&wrong)));
        }
    }
}

fn check_tables(sheet: &StyleSheet, at: &At<'_>, faults: &mut Vec<Fault>) {
    if !sheet.table.contains_key(MAIN_TABLE) {
        let message = format!("there is no table `{MAIN_TABLE}`: every report needs one");
        faults.push(at.fault(message).help(format!("add `[table.{MAIN_TABLE}]`, or leave `include` out")));
    }
    for (name, table) in &sheet.table {
        let missing = [("title", table.title.is_empty()), ("columns", table.columns.is_empty())];
        if let Some((key, _)) = missing.into_iter().find(|(_, is_missing)| *is_missing) {
            let place =
                at.get("table").and_then(|tables| tables.get(name)).map_or_else(|| at.place(), |t| t.name_place());
            let fault = Fault::new(place, format!("a table needs `{key}`"));
            faults.push(fault.help("add it, or include a style that has it"));
        }
    }
}

//! The rules of traces as one aggregation over `steps`: the checks that the native scan makes row by row.
//!
//! A rule is an aggregate over an episode's rows: null if the rule holds, else the offending value. Rules apply to the
//! columns that are read, as in the native scan. The position of rows in files is not checked: an episode's rows may be
//! anywhere, as long as each t of 1..T is there once.

use std::fmt::Write as _;

use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_metric::sql::Dialect;
use mirrorstats_trace::diagnostic::Code;
use mirrorstats_trace::schema::colors::Color;
use mirrorstats_trace::schema::colors::ColorColumn;
use mirrorstats_trace::schema::colors::palette::Palette;
use mirrorstats_trace::schema::colors::spelling::{MIXED, STRAY, WORDS};
pub use mirrorstats_trace::schema::rules::{Known, Requirement, rules_of};
use mirrorstats_trace::schema::{Column, Domain, Kind};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rule {
    pub code: Code,
    pub(super) column: String,
    pub(super) expected: String,
    found: String,
}

/// The rules for some columns, in the order of the columns. `palette` has the colours of the traces, if all of them
/// declare a palette.
pub(super) fn rules<'a>(
    columns: impl IntoIterator<Item = &'a str>,
    catalog: &Catalog,
    palette: Option<&Palette>,
) -> Vec<Rule> {
    let experiments: Option<Vec<String>> = (!catalog.open).then(|| catalog.experiment.keys().cloned().collect());
    let known = Known { palette, experiments: experiments.as_deref() };
    let mut rules = Vec::new();
    let domain = domain_of(catalog);
    for column in columns.into_iter().filter_map(|name| domain.column(name)) {
        rules.extend(rules_of(column, known).iter().map(|rule| {
            let found = found(column, rule.asks);
            Rule { code: rule.code, column: column.name.to_owned(), expected: rule.expected(), found }
        }));
    }
    rules
}

pub(super) const fn domain_of(catalog: &Catalog) -> Domain {
    if catalog.domain.is_some() { Domain::Own } else { Domain::Mirror }
}

/// The problem of an episode that breaks the requirement; null in every other episode.
fn found(column: &Column, asks: Requirement<'_>) -> String {
    let x = format!("s.{}", column.name);
    let distinct = format!("SIZE(COLLECT_SET({x}))");
    let first_bad = |bad: &str| format!("MIN(CASE WHEN {bad} THEN CONCAT('`', CAST({x} AS STRING), '`') END)");
    match asks {
        Requirement::Present => format!("CASE WHEN COUNT({x}) < COUNT(*) THEN 'null' END"),
        Requirement::Name => first_bad(&format!("{x} = ''")),
        Requirement::OneOf(values) => first_bad(&format!("{x} NOT IN ({})", texts(values))),
        Requirement::Among(values) => first_bad(&format!("{x} NOT IN ({})", texts(values))),
        Requirement::Color(color, palette) => first_bad(&no_color(&x, color, palette)),
        Requirement::Within(min, max, _) => first_bad(&format!("{x} < {min} OR {x} > {max}")),
        Requirement::Count if column.stored.kind() == Kind::Float => first_bad(&format!("{x} < 0 OR ISNAN({x})")),
        Requirement::Count => first_bad(&format!("{x} < 0")),
        Requirement::Experiment([]) => first_bad("TRUE"),
        Requirement::Experiment(known) => first_bad(&format!("{x} NOT IN ({})", texts(known))),
        Requirement::Constant => {
            let if_nullable = |text: String| if column.nullable { text } else { String::new() };
            let has_nulls = if_nullable(format!(" OR COUNT({x}) BETWEEN 1 AND COUNT(*) - 1"));
            let nulls = if_nullable(format!(", CASE WHEN COUNT({x}) < COUNT(*) THEN ' and null' ELSE '' END"));
            let extent =
                format!("CONCAT('`', CAST(MIN({x}) AS STRING), '` to `', CAST(MAX({x}) AS STRING), '`'{nulls})");
            format!("CASE WHEN MIN({x}) <> MAX({x}){has_nulls} THEN {extent} END")
        }
        Requirement::FromOne => format!("CASE WHEN MIN({x}) <> 1 THEN CONCAT('t = ', MIN({x})) END"),
        Requirement::Once => format!(
            "CASE WHEN COUNT({x}) > {distinct} THEN CONCAT(COUNT({x}), ' rows of ', {distinct}, ' timesteps') END"
        ),
        Requirement::WithoutGap => format!(
            "CASE WHEN MAX({x}) - MIN({x}) + 1 > {distinct} THEN CONCAT({distinct}, ' timesteps up to t = ', MAX({x})) END"
        ),
    }
}

fn no_color(x: &str, column: ColorColumn, palette: Option<&Palette>) -> String {
    if let Some(palette) = palette {
        let names = palette.names().iter().map(String::as_str).chain(column.word);
        return format!("{x} NOT IN ({})", texts(names));
    }
    let words = texts(WORDS.into_iter().filter(|word| column.word != Some(*word)));
    let [stray, mixed] = [STRAY, MIXED].map(|pattern| Dialect::Spark.pattern(pattern));
    let study = texts(Color::ALL.map(Color::name));
    format!(
        "{x} IN ({words}) OR {x} <> LOWER({x}) OR regexp_like({x}, {stray}) OR regexp_like({x}, {mixed}) OR ({x} LIKE '% %' AND REPLACE({x}, ' ', '') IN ({study}))"
    )
}

fn texts(values: impl IntoIterator<Item: AsRef<str>>) -> String {
    values.into_iter().map(|value| Dialect::Spark.text(value.as_ref())).collect::<Vec<_>>().join(", ")
}

/// The statement. Its one row has `steps`, `episodes`, `faults` (episodes that break a rule), and `fault`, the first by
/// id: its `episode`, the index of its `rule`, and the value `found`.
pub(super) fn statement(rules: &[Rule]) -> String {
    let (mut found, mut first) = (String::new(), String::new());
    for (at, rule) in rules.iter().enumerate() {
        let _ = write!(found, ",\n    {} AS r{at}", rule.found);
        let fault = format!("NAMED_STRUCT('episode', episode_id, 'rule', {at}, 'found', r{at})");
        let _ = write!(first, "\n      WHEN r{at} IS NOT NULL THEN {fault}");
    }
    format!(
        "WITH episodes AS (\n  SELECT s.episode_id AS episode_id,\n    COUNT(*) AS steps{found}\n  \
         FROM steps s\n  GROUP BY s.episode_id\n),\n\
         faults AS (\n  SELECT steps,\n    CASE{first}\n    END AS fault\n  FROM episodes\n)\n\
         SELECT COALESCE(SUM(steps), 0) AS steps, COUNT(*) AS episodes, COUNT(fault) AS faults, MIN(fault) AS fault\n\
         FROM faults\n"
    )
}

#[cfg(test)]
#[cfg(feature = "polars")]
mod tests {
    use std::collections::BTreeSet;
    use std::num::NonZeroUsize;
    use std::path::Path;

    use polars::prelude::{IntoLazy as _, LazyFrame, PlRefPath, PlSmallStr, df};
    use polars::sql::SQLContext;

    use super::{Rule, no_color, rules};
    use mirrorstats_metric::definitions::Definitions;
    use mirrorstats_score::vocabulary::schema_columns;
    use mirrorstats_trace::diagnostic::{Code, Finding};
    use mirrorstats_trace::inputs::Input;
    use mirrorstats_trace::schema::COLUMNS;
    use mirrorstats_trace::schema::colors::{columns, palette::Palette};
    use mirrorstats_trace::validate::validate;

    const TEXTS: [&str; 24] = [
        "r\u{435}d",
        "те\u{430}l",
        "red",
        "teal",
        "dark teal",
        "grün",
        "olive2",
        "dark-red",
        "none",
        "unknown",
        "None",
        "Unknown ",
        "Red",
        "GRÜN",
        " red",
        "red ",
        "red\u{a0}",
        "dark\u{a0}teal",
        "dark  teal",
        "r\u{200b}ed",
        "\u{feff}red",
        "red\n",
        "re d",
        "none ",
    ];

    /// Polars replaces Spark here: it has the same functions, and its patterns mean the same in this case.
    #[test]
    fn the_sql_condition_agrees_with_the_color_rule() {
        let palette = Palette::of_all([Some(&Palette::new(["teal".into(), "grün".into()]))].into_iter());
        for palette in [None, palette.as_ref()] {
            for column in columns() {
                let mut context = SQLContext::new();
                context.register("steps", df!["color" => TEXTS].unwrap().lazy());
                let condition = no_color("s.color", column, palette).replace("\\\\", "\\");
                let rows =
                    context.execute(&format!("SELECT {condition} AS bad FROM steps s")).unwrap().collect().unwrap();
                let bad: Vec<bool> =
                    rows.column("bad").unwrap().bool().unwrap().iter().map(|bad| bad.unwrap()).collect();
                let expected: Vec<bool> = TEXTS.map(|text| !column.may_hold(text, palette)).to_vec();
                assert_eq!(bad, expected, "{} {palette:?}", column.name);
            }
        }
    }

    /// The first rule that an episode of a file breaks. Polars replaces Spark here.
    fn first_broken(path: &Path, definitions: &Definitions) -> Option<Rule> {
        let path = PlRefPath::try_from_path(path).unwrap();
        let mut frame = LazyFrame::scan_parquet(path, polars::prelude::ScanArgsParquet::default()).unwrap();
        let schema = frame.collect_schema().unwrap();
        let mut context = SQLContext::new();
        context.register("steps", frame);
        rules(schema.iter_names().map(PlSmallStr::as_str), &definitions.catalog, None).into_iter().find(|rule| {
            let found = rule.found.replace("\\\\", "\\").replace("SIZE(COLLECT_SET(s.t))", "COUNT(DISTINCT s.t)");
            let statement = format!("SELECT {found} AS found FROM steps s GROUP BY s.episode_id");
            let found = context.execute(&statement).unwrap().collect().unwrap();
            let found = found.column("found").unwrap();
            found.null_count() < found.len()
        })
    }

    fn first_finding(path: &Path, definitions: &Definitions) -> Option<Finding> {
        let experiments: Vec<String> = definitions.catalog.experiment.keys().cloned().collect();
        let report = validate(&[Input::new(path)], Some(&experiments), NonZeroUsize::MIN).unwrap();
        report.findings.into_iter().next()
    }

    #[test]
    fn a_damaged_trace_breaks_the_same_rule_on_either_side() {
        let definitions = Definitions::load("paper", &schema_columns()).unwrap();
        let all = rules(COLUMNS.iter().map(|column| column.name), &definitions.catalog, None);
        let mut left: BTreeSet<Code> = all.iter().map(|rule| rule.code).collect();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/damaged");
        for file in std::fs::read_dir(folder).unwrap() {
            let path = file.unwrap().path();
            let native = first_finding(&path, &definitions).filter(|finding| left.contains(&finding.code));
            let Some(native) = native else { continue };
            let rule = first_broken(&path, &definitions).unwrap_or_else(|| panic!("no rule is broken: {native}"));
            assert_eq!((rule.code, Some(&rule.column)), (native.code, native.column.as_ref()), "{native}");
            let tells_of_rows = [Code::InconsistentConstant, Code::TDuplicate, Code::TGap].contains(&rule.code);
            assert!(tells_of_rows || rule.expected == native.expected, "{native}");
            left.remove(&rule.code);
        }
        assert_eq!(left, BTreeSet::new(), "no damaged trace breaks these");
    }
}

use super::episodes::Episodes;
use super::{Audit, NamedTable, Terms, audit};
use crate::published;
use crate::style::Style;
use exact::moments::{Moments, StandardError};
use exact::number::Decimal;
use exact::rounding::Rounding;
use metric::definitions::Definitions;
use metric::implied::implied;
use score::vocabulary::{has_value, schema_columns};

fn audited(files: &[(&str, &str)], style: &str) -> Audit {
    audited_under(files, style, &Rounding::ALL)
}

fn audited_under(files: &[(&str, &str)], style: &str, roundings: &[Rounding]) -> Audit {
    let folder = tempfile::tempdir().unwrap();
    let tables: Vec<NamedTable> = files
        .iter()
        .map(|(name, text)| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            NamedTable { name: (*name).to_owned(), published: published::read(&path).unwrap() }
        })
        .collect();
    let definitions = Definitions::load("paper", &schema_columns()).unwrap();
    let implied = implied(&definitions.plan, 100, has_value);
    let episodes: Episodes = "21".parse().unwrap();
    let style = Style::load(style).unwrap();
    let terms =
        Terms { catalog: &definitions.catalog, implied: &implied, episodes: &episodes, style: &style, roundings };
    audit(&tables, terms).unwrap()
}

const MAIN: (&str, &str) = ("main.csv", include_str!("../../../../fixtures/published/main_table.csv"));
const APPENDIX: (&str, &str) = ("appendix.csv", include_str!("../../../../fixtures/published/appendix_table.csv"));

#[test]
fn the_papers_tables_have_two_infeasible_cells_of_520() {
    let found = audited(&[MAIN, APPENDIX], "paper");
    insta::assert_snapshot!(found.render(None));
}

#[test]
fn without_the_papers_style_a_zero_is_a_zero() {
    let found = audited(&[MAIN, APPENDIX], "default");
    insta::assert_snapshot!(found.render(None));
}

fn row(cells: &str) -> String {
    let lines = cells.lines().map(|line| format!("E1,a,{},\n", line.trim()));
    audited_row(&lines.collect::<String>())
}

fn audited_row(lines: &str) -> String {
    let table = format!("experiment,model,metric,mean,se,emphasis\n{lines}");
    audited(&[("t.csv", &table)], "default").render(None)
}

#[test]
fn each_kind_of_fault_has_its_words() {
    let rows = [
        "TSA,0.58,0.11",
        "TSA,0.57,0.15",
        "TTD,0.50,0.00",
        "TTD,57.90,70.00",
        "TTD,,",
        "TSA,0.57,0.11\nMTATO,0.60,0.15",
        "TSA,0.00,0.00\nMTATO,1.00,0.00",
        "TSA,0.57,0.11\nMTATO,,",
        "TSA,0.57,0.11\nMCR,0.10,0.07\nMTATO,0.58,0.15",
        "TSA,0.57,0.11\nTSA-C,1.00,0.00",
        "TSA,0.57,0.11\nTSA-C,0.50,0.11",
        "AR_SC,0.10,0.06\nSC,0.67,0.33",
        "AR_SC,0.10,0.07",
    ];
    let told: Vec<String> = rows.map(|cells| format!("{cells}\n\n{}", row(cells))).into();
    insta::assert_snapshot!(told.join("\n"));
}

#[test]
fn two_tables_must_come_from_the_same_data() {
    let table = |se: &str| format!("experiment,model,metric,mean,se,emphasis\nE1,a,TTD,50.00,{se},\n");
    let found = audited(&[("a.csv", &table("5.00")), ("b.csv", &table("5.01"))], "default");
    assert!(found.holds(), "rounded twice, 5.0049 prints 5.01: {found:?}");
    let found = audited(&[("a.csv", &table("5.00")), ("b.csv", &table("5.02"))], "default");
    insta::assert_snapshot!(found.render(None));
}

/// Digits of a generator with constants from Knuth's MMIX.
fn draws(seed: u64) -> impl FnMut(u64) -> u64 {
    let mut state = seed;
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    }
}

/// The cells of one row of random episodes: metric, mean and standard error with two digits.
fn random_row(
    rounding: Rounding,
    draw: &mut impl FnMut(u64) -> u64,
) -> Vec<(&'static str, Option<Decimal>, Option<Decimal>)> {
    let mut columns: [(&str, Moments); 8] =
        ["TSA", "TTD", "MCR", "MTATO", "CAAL", "TSA-C", "MGD", "CR"].map(|metric| (metric, Moments::default()));
    let (able, quick) = (draw(10), 5 + draw(96));
    for _ in 0..21 {
        let mut rate = |of: u64| i64::from(draw(10) < of);
        let (success, consults, attributes, confabulates) = (rate(able), rate(7), rate(5), rate(2));
        let finished = success == 1 || rate(5) == 1;
        let steps = 1 + i64::try_from(draw(quick)).unwrap();
        let gaze = i64::try_from(draw(20)).unwrap();
        let values = [
            Some(success),
            Some(steps),
            Some(consults),
            (success == 1).then_some(consults),
            Some(attributes),
            finished.then_some(success),
            Some(gaze),
            Some(confabulates),
        ];
        for ((_, moments), value) in columns.iter_mut().zip(values) {
            *moments = value.map_or(*moments, |value| moments.with(value).unwrap());
        }
    }
    let printed = |(metric, moments): (&'static str, Moments)| {
        let mean = rounding.ratio(moments.sum, moments.n.into(), 2);
        let se = moments.se_squared(StandardError::Sample).and_then(|(above, below)| rounding.root(above, below, 2));
        (metric, mean, se)
    };
    columns.map(printed).to_vec()
}

fn infeasible(cells: &[(&'static str, Option<Decimal>, Option<Decimal>)], rounding: Rounding) -> usize {
    let text = |number: Option<Decimal>| number.map(|number| number.to_string()).unwrap_or_default();
    let line = |(metric, mean, se): &(&str, _, _)| format!("E1,a,{metric},{},{},\n", text(*mean), text(*se));
    let lines: String = cells.iter().map(line).collect();
    let table = format!("experiment,model,metric,mean,se,emphasis\n{lines}");
    audited_under(&[("t.csv", &table)], "default", &[rounding]).infeasible.len()
}

/// Tables of random data are feasible under any rounding. Forgeries raise one printed number by one to nine units of
/// its last digit; the shares asserted here are caught. A standard error of durations has too many digits to reveal a
/// forgery.
#[test]
fn data_passes_and_forgeries_are_caught() {
    let mut draw = draws(518);
    let [mut rates, mut means, mut spreads] = [(0, 0); 3];
    for at in 0..60 {
        let rounding = Rounding::ALL[at % 5];
        let honest = random_row(rounding, &mut draw);
        assert_eq!(infeasible(&honest, rounding), 0, "{honest:?} {rounding:?}");
        for _ in 0..4 {
            let mut cells = honest.clone();
            let (metric, mean, se) = &mut cells[usize::try_from(draw(8)).unwrap()];
            let is_mean = draw(2) == 0;
            let Some(number) = (if is_mean { mean } else { se }) else { continue };
            let (found, forged) = match (*metric, is_mean) {
                ("TTD" | "MGD", true) => &mut means,
                ("TTD" | "MGD", false) => &mut spreads,
                _ => &mut rates,
            };
            *number = Decimal::of_units(number.units() + 1 + i128::from(draw(9)), number.places());
            *forged += 1;
            *found += usize::from(infeasible(&cells, rounding) > 0);
        }
    }
    assert_eq!([rates, means, spreads], [(172, 175), (23, 32), (0, 32)], "found of forged");
}

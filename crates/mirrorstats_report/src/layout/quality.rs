//! The table of data quality: reply quality by experiment, model and condition, for people and in full.
//!
//! Rule: unrecorded values print as `--`, never as zero.

use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::fixed;
use mirrorstats_score::quality::{CellKey, Quality, QualityByCell, Total, statuses};
use mirrorstats_tables::{Column, ListTable, Look, Table, text_field};

const NAME: &str = "quality";
const UNKNOWN: &str = "--";
/// The shares of replies whose latency is reported.
const MEDIAN: f64 = 0.5;
const SLOW: f64 = 0.95;
const NANO: f64 = 1e9;

/// Data quality by experiment, model and condition; `None` without cells.
pub fn of_cells(cells: &QualityByCell) -> Option<ListTable> {
    let keys = if cells.has_conditions() { 3 } else { 2 };
    let table = || ListTable { name: NAME.to_owned(), printed: printed(cells, keys), records: records(cells, keys) };
    (!cells.0.is_empty()).then(table)
}

/// The table for a terminal, without title and notes; empty without cells.
pub fn text(cells: &QualityByCell, width: Option<usize>) -> String {
    of_cells(cells).map_or_else(String::new, |table| table.printed.lines(width))
}

const KEYS: [&str; 3] = ["experiment", "model", "condition"];

fn names(key: &CellKey) -> [String; 3] {
    [&key.experiment, &key.model, &key.condition].map(Clone::clone)
}

/// The first `keys` of the key columns, then the others.
fn keyed<T>(of: [T; 3], keys: usize, others: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    of.into_iter().take(keys).chain(others)
}

fn printed(cells: &QualityByCell, keys: usize) -> Table {
    let header = keyed(KEYS, keys, row(&Quality::default()).map(|(heading, _)| heading));
    let table = Table {
        title: "Data quality".to_owned(),
        sentences: notes(cells),
        label: Some("tab:quality".to_owned()),
        ..Table::list(Look::Ruled, keys, header.map(Column::left))
    };
    table.with(cells.0.iter().map(|(key, quality)| keyed(names(key), keys, row(quality).map(|(_, text)| text))))
}

/// The texts for people, each with its heading.
fn row(quality: &Quality) -> [(&'static str, String); 9] {
    let known = |is_known: bool, text: String| if is_known { text } else { UNKNOWN.to_owned() };
    let recorded = quality.replies() > 0;
    let repaired = match (quality.of_status("repaired"), listed(quality.repairs.iter())) {
        (count, kinds) if kinds.is_empty() => count.to_string(),
        (count, kinds) => format!("{count}: {kinds}"),
    };
    let latency = quality.latency(MEDIAN).zip(quality.latency(SLOW));
    let latency = latency.map(|(median, slow)| format!("{median}; 95 % within {slow}"));
    let tokens = [quality.prompt_tokens, quality.completion_tokens].map(Total::mean);
    let [prompt, completion] = tokens.map(|tokens| fixed(tokens, 0));
    [
        ("episodes", quality.episodes.to_string()),
        ("lost", quality.lost.map_or_else(|| UNKNOWN.to_owned(), |lost| lost.to_string())),
        ("steps", quality.steps.to_string()),
        ("no decision", known(recorded, share(quality.unusable(), quality.replies()))),
        ("reasons", known(recorded, listed(quality.unread()))),
        ("repaired", known(recorded, repaired)),
        ("latency, ms", latency.unwrap_or_else(|| UNKNOWN.to_owned())),
        ("tokens", known(tokens.iter().any(Option::is_some), format!("{prompt} + {completion}"))),
        ("cost, USD", known(quality.cost_nano_usd.replies > 0, cost(quality, 4))),
    ]
}

#[expect(clippy::cast_precision_loss, reason = "a share for people")]
fn share(count: u64, all: u64) -> String {
    let percent = 100.0 * count as f64 / all as f64;
    format!("{count}/{all} ({} %)", fixed(Some(percent), 1))
}

/// `refusal 4, truncated 2`; empty without any.
fn listed<'a>(counts: impl Iterator<Item = (&'a String, &'a u64)>) -> String {
    counts.map(|(name, count)| format!("{} {count}", visible(name))).collect::<Vec<_>>().join(", ")
}

#[expect(clippy::cast_precision_loss, reason = "at most nine decimal places of a cost")]
fn cost(quality: &Quality, places: usize) -> String {
    fixed(Some(quality.cost_nano_usd.sum as f64 / NANO), places)
}

fn notes(cells: &QualityByCell) -> Vec<String> {
    let mut notes =
        vec!["Replies without a decision and their reasons; repairs that made a reply readable.".to_owned()];
    if cells.0.values().any(|quality| quality.prompt_tokens.replies > 0) {
        notes.push("Tokens per request and per reply.".to_owned());
    }
    notes.extend(unread_identifications(cells));
    if !cells.is_recorded() {
        notes.push(format!("The traces do not record how replies came ({UNKNOWN})."));
    }
    notes
}

/// The identifications that no rule reads: their number and the first of them; `None` without any.
pub fn unread_identifications(cells: &QualityByCell) -> Option<String> {
    const SHOWN: usize = 3;
    const LONGEST: usize = 80;
    let whole = cells.whole();
    let count: u64 = whole.unread_identifications().map(|(_, replies)| replies).sum();
    let shown = whole.unread_identifications().take(SHOWN).map(|(text, _)| {
        let beginning: String = text.chars().take(LONGEST).collect();
        let end = if text.chars().nth(LONGEST).is_some() { "..." } else { "" };
        format!("\"{}{end}\"", visible(&beginning))
    });
    let texts: Vec<_> = shown.collect();
    (count > 0).then(|| format!("Identifications that could not be read: {count}, such as {}.", texts.join(", ")))
}

fn records(cells: &QualityByCell, keys: usize) -> Table {
    let header = keyed(KEYS, keys, record(&Quality::default()).into_iter().map(|(heading, _)| heading));
    let line = |(key, quality): (&CellKey, &Quality)| {
        let names = names(key).map(|name| text_field(&name));
        keyed(names, keys, record(quality).into_iter().map(|(_, text)| text))
    };
    Table::of_texts(header).with(cells.0.iter().map(line))
}

/// The texts for programs, each with its heading.
fn record(quality: &Quality) -> Vec<(&'static str, String)> {
    let known = |is_known: bool, text: String| if is_known { text } else { String::new() };
    let count = |count: u64| known(quality.replies() > 0, count.to_string());
    let optional = |number: Option<i64>| number.map_or_else(String::new, |number| number.to_string());
    let by_status = statuses().iter().map(|status| (*status, quality.of_status(status)));
    let other_status = quality.replies() - by_status.clone().map(|(_, count)| count).sum::<u64>();
    let repairs: Vec<_> = quality.repairs.iter().map(|(name, count)| format!("{name} {count}")).collect();
    let Quality { prompt_tokens, completion_tokens, cost_nano_usd, .. } = quality;
    let head = [
        ("episodes", quality.episodes.to_string()),
        ("lost", quality.lost.map_or_else(String::new, |lost| lost.to_string())),
        ("steps", quality.steps.to_string()),
        ("replies", count(quality.replies())),
    ];
    let tail = [
        ("unusable", count(quality.unusable())),
        ("other_status", count(other_status)),
        ("repairs", repairs.join("; ")),
        ("latency_median_ms", optional(quality.latency(MEDIAN))),
        ("latency_95_ms", optional(quality.latency(SLOW))),
        ("prompt_tokens", known(prompt_tokens.replies > 0, prompt_tokens.sum.to_string())),
        ("completion_tokens", known(completion_tokens.replies > 0, completion_tokens.sum.to_string())),
        ("cost_usd", known(cost_nano_usd.replies > 0, cost(quality, 9))),
    ];
    head.into_iter().chain(by_status.map(|(status, of)| (status, count(of)))).chain(tail).collect()
}

#[cfg(test)]
mod tests {
    use super::of_cells;
    use mirrorstats_score::quality::{CellKey, Quality, QualityByCell, Total};
    use mirrorstats_tables::ListTable;

    fn cells(condition: &str) -> QualityByCell {
        let key = |model: &str| CellKey { experiment: "E1".into(), model: model.into(), condition: condition.into() };
        let told = Quality {
            episodes: 2,
            steps: 40,
            lost: Some(1),
            statuses: [("ok".to_owned(), 30), ("repaired".to_owned(), 6), ("refusal".to_owned(), 4)].into(),
            repairs: [("fence".to_owned(), 5), ("case".to_owned(), 2)].into(),
            faults: [].into(),
            by_episode: [].into(),
            latencies: [(100, 30), (900, 10)].into(),
            prompt_tokens: Total { replies: 40, sum: 48_000 },
            completion_tokens: Total { replies: 40, sum: 3_240 },
            cost_nano_usd: Total { replies: 40, sum: 12_345_678 },
        };
        let untold = Quality { episodes: 1, steps: 7, ..Quality::default() };
        QualityByCell([(key("=m"), told), (key("n_1"), untold)].into())
    }

    #[test]
    fn unrecorded_quality_is_not_zero() {
        let table = of_cells(&cells("default")).unwrap().printed;
        let rows: Vec<Vec<&str>> =
            table.rows().map(|row| row.iter().map(|cell| cell.text.as_str()).collect()).collect();
        assert_eq!(rows[1][2..], ["1", "--", "7", "--", "--", "--", "--", "--", "--"]);
        assert_eq!(rows[0][5..8], ["4/40 (10.0 %)", "refusal 4", "6: case 2, fence 5"]);
        assert_eq!(rows[0][8..], ["100; 95 % within 900", "1200 + 81", "0.0123"]);
        assert!(of_cells(&QualityByCell::default()).is_none());
    }

    #[test]
    fn every_format_escapes_its_names() {
        let ListTable { printed, records, .. } = of_cells(&cells("near")).unwrap();
        insta::assert_snapshot!(records.csv(), @r"
        experiment,model,condition,episodes,lost,steps,replies,ok,repaired,parse_failed,schema_invalid,refusal,truncated,empty,rate_limited,server_error,timeout,unusable,other_status,repairs,latency_median_ms,latency_95_ms,prompt_tokens,completion_tokens,cost_usd
        E1,'=m,near,2,1,40,40,30,6,0,0,4,0,0,0,0,0,4,0,case 2; fence 5,100,900,48000,3240,0.012345678
        E1,n_1,near,1,,7,,,,,,,,,,,,,,,,,,,
        ");
        assert!(printed.latex().contains(r"n\_1 & near & 1 & "), "{}", printed.latex());
        assert!(printed.markdown().contains("| E1 | n\\_1 | near |"), "{}", printed.markdown());
    }
}

//! Two accepted inputs: a trace with definitions, groups, filters, queries or logs; scores with a style.
//!
//! The first two bytes are the length of the first input, and the rest is the second. An empty second input stands for
//! a sound trace. Rule: the cost of a pair is bounded, and each target measures its own.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::time::{Duration, Instant};

use mirrorstats_study::Study;
use mirrorstats_study::question::Question;
use mirrorstats_study::report::{ReportOptions, report};
use mirrorstats_trace::inputs::Input;
use mirrorstats_view::{Options, View};

use crate::depth::reached;
use crate::{episodes, scratch};

/// Limits for a pair of inputs smaller than 64 KiB together: additional memory in KiB, and time of an unoptimised
/// build.
const MEMORY: u64 = 512 << 10;
const TIME: Duration = Duration::from_secs(30);

/// Encodes a pair of inputs.
pub fn joined(first: &[u8], second: &[u8]) -> Vec<u8> {
    let length = u16::try_from(first.len()).unwrap_or(u16::MAX).to_le_bytes();
    [&length, first, second].concat()
}

/// The two inputs; `None` if the data is shorter than the first.
pub fn parted(data: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = data.split_first_chunk()?;
    rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))
}

/// A text and a trace; no bytes give a sound trace.
fn with_trace(data: &[u8]) -> Option<(&str, Vec<u8>)> {
    let (text, bytes) = parted(data)?;
    let bytes = if bytes.is_empty() { episodes::trace(6) } else { bytes.to_vec() };
    Some((std::str::from_utf8(text).ok()?, bytes))
}

fn study(name: &str, bytes: &[u8]) -> Option<Study> {
    Study::of(vec![Input::new(scratch::file(name, bytes))]).ok()
}

fn bounded<T>(run: impl FnOnce() -> T) -> T {
    let (begun, before) = (Instant::now(), memory("VmRSS:"));
    let given = run();
    let taken = memory("VmRSS:").saturating_sub(before);
    assert!(taken < MEMORY, "a pair of inputs takes {taken} KiB");
    assert!(begun.elapsed() < TIME, "a pair of inputs takes {:?}", begun.elapsed());
    given
}

/// A memory figure of this process in KiB; 0 where the system does not report it.
fn memory(key: &str) -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(key));
    line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse().ok()).unwrap_or_default()
}

/// Definitions over a trace: refused, or the same values on one thread and on two.
pub fn defined(data: &[u8]) {
    let Some((text, bytes)) = with_trace(data) else { return };
    if text.contains("include") {
        return;
    }
    let path = scratch::file("defined.toml", text.as_bytes());
    let scores = |threads: usize| {
        let threads = NonZeroUsize::new(threads).unwrap_or(NonZeroUsize::MIN);
        study("defined.parquet", &bytes)?.threads(threads).definitions(&path).ok()?.score().ok()
    };
    let (one, two) = (bounded(|| scores(1)), bounded(|| scores(2)));
    assert_eq!(
        one.as_ref().map(|one| &one.episodes),
        two.as_ref().map(|two| &two.episodes),
        "another number of threads"
    );
    if one.is_some() {
        reached("values");
    }
}

/// Columns to group by, separated by commas: refused, or each episode is in one cell.
pub fn grouped(data: &[u8]) {
    let Some((text, bytes)) = with_trace(data) else { return };
    let Some(study) = study("grouped.parquet", &bytes) else { return };
    let study = study.threads(NonZeroUsize::MIN).pool();
    let Some(all) = bounded(|| study.score().ok()) else { return };
    reached("values");
    let by: Vec<String> = text.split(',').map(str::to_owned).collect();
    if let Some(cells) = bounded(|| study.by(by).cells().ok()) {
        reached("cells");
        let sum: u64 = cells.groups.iter().map(|group| group.episodes).sum();
        assert_eq!(sum, all.episodes.len() as u64, "{text}");
    }
}

/// A condition on episodes: refused, or its negation keeps only other episodes.
pub fn filtered(data: &[u8]) {
    let Some((text, bytes)) = with_trace(data) else { return };
    let kept = |condition: &str| {
        let study = study("filtered.parquet", &bytes)?.threads(NonZeroUsize::MIN);
        let found = bounded(|| study.filter(condition).ok()?.score().ok())?;
        Some(found.episodes.keys.iter().map(|key| key.episode_id.to_owned()).collect::<Vec<_>>())
    };
    let (Some(all), Some(some)) = (kept("true"), kept(text)) else { return };
    reached("values");
    assert!(some.iter().all(|id| all.contains(id)));
    if let Some(others) = kept(&format!("not ({text})")) {
        assert!(others.iter().all(|id| !some.contains(id)), "{text}");
    }
}

fn options(run: &Path) -> Options {
    Options {
        runs: vec![run.into()],
        question: Question { each: true, ..Question::default() },
        against: None,
        style: "default".into(),
        coder: None,
        threads: NonZeroUsize::MIN,
    }
}

/// A query of the page as in its address, such as `episodes?sort=id`: answered, or refused with a message.
pub fn asked(data: &[u8]) {
    let Some((text, bytes)) = with_trace(data) else { return };
    let Ok(view) = bounded(|| View::open(options(&scratch::file("asked.parquet", &bytes)))) else { return };
    reached("open");
    ask(&view, text);
}

fn ask(view: &View, text: &str) {
    let (name, query) = text.split_once('?').unwrap_or((text, ""));
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    let query: Vec<(String, String)> = pairs.map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
    match bounded(|| view.ask(name, &query)) {
        Some(Ok(bytes)) => {
            reached("answered");
            assert!(!bytes.is_empty(), "{text}");
        }
        Some(Err(error)) => assert!(!error.to_string().is_empty(), "{text}"),
        None => {}
    }
}

/// A log beside a trace in a folder, and the page's answers about both.
pub fn logged(data: &[u8]) {
    let Some((log, bytes)) = parted(data) else { return };
    let bytes = if bytes.is_empty() { episodes::trace(3) } else { bytes.to_vec() };
    let folder = scratch::path("logged");
    fs::create_dir_all(&folder).expect("a folder for temporary files");
    for (name, bytes) in [("a.parquet", bytes.as_slice()), ("a.mcap", log)] {
        fs::write(folder.join(name), bytes).expect("a folder for temporary files");
    }
    let Ok(view) = bounded(|| View::open(options(&folder))) else { return };
    reached("open");
    for question in ["live", "episode?id=e0", "map?id=e0", "frame?id=e0&t=1", "compare?a=e0&b=e1"] {
        ask(&view, question);
    }
}

/// A style with scores in CSV: refused, or a report in memory.
pub fn styled(data: &[u8]) {
    let Some((style, scores)) = parted(data) else { return };
    let style = scratch::file("styled.toml", style);
    let Some(study) = study("styled.csv", scores) else { return };
    reached("open");
    let study = study.threads(NonZeroUsize::MIN).pool();
    if let Some(report) = bounded(|| report(&study, &ReportOptions { style, figures: false, png: false }).ok()) {
        reached("report");
        assert!(!report.tables.is_empty());
    }
}

//! Footers, whole traces, and steps to import.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::LazyLock;

use mirrorstats_import::{Limits, Text, import};
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::Projection;
use mirrorstats_trace::validate::validate;

use crate::depth::reached;
use crate::{episodes, scratch};

/// A sound trace, and the position of its footer.
static WHOLE: LazyLock<(Vec<u8>, usize)> = LazyLock::new(|| {
    let whole = episodes::trace(4);
    let at = whole.len() - 8;
    let length = whole[at..].first_chunk().map_or(0, |length| u32::from_le_bytes(*length) as usize);
    (whole, at - length)
});

/// The footer of a sound trace, which the target starts from.
pub fn sound_footer() -> &'static [u8] {
    let (whole, at) = &*WHOLE;
    &whole[*at..whole.len() - 8]
}

/// The bytes as the footer of a trace with sound pages: refused, or a scan and `validate` agree on it.
pub fn footer(data: &[u8]) {
    let (whole, at) = &*WHOLE;
    let mut file = whole[..*at].to_vec();
    file.extend(data);
    file.extend(u32::try_from(data.len()).unwrap_or(u32::MAX).to_le_bytes());
    file.extend(b"PAR1");
    scan_and_validate(&scratch::file("footer.parquet", &file));
}

/// The bytes as a whole trace.
pub fn trace(data: &[u8]) {
    scan_and_validate(&scratch::file("trace.parquet", data));
}

fn scan_and_validate(path: &Path) {
    let input = Input::new(path);
    let report = validate(std::slice::from_ref(&input), None, NonZeroUsize::MIN).expect("threads can be started");
    let Ok(set) = TraceSet::open(&[input]) else {
        assert!(report.count(Severity::Error) > 0, "a footer that is refused is no finding");
        return;
    };
    reached("footer");
    let of_one_kind = |name: &&str| set.column(name).is_some_and(|column| column.conflict.is_none());
    let steps = set.column_names().into_iter().filter(of_one_kind).map(str::to_owned).collect();
    let (mut rows, projection) = (0, Projection { steps, ..Projection::default() });
    let count = |found: u64| {
        rows += found;
        Ok(())
    };
    let each = |batch: mirrorstats_trace::scan::EpisodeBatch| Ok::<_, TraceError>(batch.steps.num_rows() as u64);
    if set.scan(&projection, NonZeroUsize::MIN, each, count).is_ok() {
        reached("rows");
        assert_eq!(report.count(Severity::Error), 0, "a scan reads what `validate` refuses: {:?}", report.findings);
        assert_eq!(report.files.iter().map(|file| file.steps).sum::<u64>(), rows);
    }
}

/// Lines of steps: refused, or imported as a valid trace with one row per line.
pub fn import_lines(data: &[u8]) {
    let (from, out) = (scratch::file("steps.jsonl", data), scratch::path("imported.parquet"));
    let _ = std::fs::remove_file(&out);
    let Ok(text) = Text::open(&from) else { return };
    match import(&mut [text], &out, Limits::default()) {
        Err(_) => assert!(!out.exists(), "a refused import leaves a file"),
        Ok(imported) => {
            reached("imported");
            let report = validate(&[Input::new(&out)], None, NonZeroUsize::MIN).expect("threads can be started");
            assert_eq!(report.count(Severity::Error), 0, "{:?}", report.findings);
            let lines =
                data.split(|byte| *byte == b'\n').filter(|line| line.iter().any(|byte| !byte.is_ascii_whitespace()));
            let lines = lines.filter(|line| *line != "\u{feff}".as_bytes() && *line != "\u{feff}\r".as_bytes()).count();
            assert_eq!((imported.steps, report.files[0].steps), (lines, lines as u64));
        }
    }
}

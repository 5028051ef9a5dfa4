//! Checks the colours of all inputs together: one spelling for each, and claims of a colour that nothing has.
//!
//! Rule: findings depend only on the rows and the order of the files, never on threads or unused dictionary entries.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::num::NonZeroUsize;

use arrow::array::AsArray as _;
use indexmap::map::Entry;
use indexmap::{IndexMap, IndexSet};

use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use crate::read::entry_use::EntryUse;
use crate::read::open::TraceFile;
use crate::read::parallel_scan::{Episodes, ScanEvent, pass};
use crate::read::projection::{Layout, T};
use crate::schema::colors::Color;
use crate::schema::colors::palette::Palette;
use crate::schema::colors::spelling::{WORDS, did_you_mean, meant_by, most_like, spelling_key};
use crate::schema::colors::{ColorColumn, column};
use mirrorstats_parquet_pages::Column;

/// Beyond this number of claims times colours, findings suggest no colour.
const MOST_COMPARED: usize = 1_000_000;

pub(crate) struct Sighting {
    column: ColorColumn,
    name: String,
    rows: u64,
    row: usize,
    row_group: usize,
    episode: Option<String>,
    t: Option<i64>,
}

#[derive(Default)]
pub(crate) struct Tally {
    declared: BTreeSet<String>,
    seen: IndexSet<String>,
    met: IndexMap<(&'static str, String), (usize, Sighting)>,
}

/// The colours of some episodes by column, in the order of their first rows.
pub(crate) fn sightings(file: &TraceFile, layout: &Layout, episodes: &Episodes) -> Vec<Sighting> {
    let mut found = Vec::new();
    for (held, column) in color_columns(layout, episodes) {
        let colors = distinct(held).into_iter().filter(|(name, _, _)| {
            !name.is_empty() && column.word != Some(name.as_str()) && column.may_hold(name, file.palette())
        });
        found.extend(colors.map(|(name, row, rows)| Sighting {
            column,
            name,
            rows,
            row,
            row_group: episodes.row_group(row),
            episode: episodes.id(row).map(str::to_owned),
            t: episodes.columns[T].int(row),
        }));
    }
    found.sort_by_key(|sighting| sighting.row);
    found
}

fn color_columns<'a>(
    layout: &'a Layout,
    episodes: &'a Episodes,
) -> impl Iterator<Item = (&'a Column, ColorColumn)> + 'a {
    let columns = layout.columns.iter().zip(&episodes.columns);
    columns.filter_map(|(of, held)| Some((held, column(of.known.map_or("", |known| known.name))?)))
}

fn distinct(column: &Column) -> Vec<(String, usize, u64)> {
    // A text may have two keys.
    let mut by_text: BTreeMap<String, (usize, u64)> = BTreeMap::new();
    if let Some(texts) = EntryUse::of_column(column) {
        for (text, row, count) in texts.first_rows(column) {
            let met = by_text.entry(text.to_owned()).or_insert((row, 0));
            *met = (met.0.min(row), met.1 + count);
        }
    }
    by_text.into_iter().map(|(text, (row, count))| (text, row, count)).collect()
}

impl Tally {
    pub(crate) fn new(files: &[TraceFile]) -> Self {
        let mut declared: BTreeSet<String> = Color::ALL.into_iter().map(|color| color.name().to_owned()).collect();
        declared.extend(files.iter().filter_map(TraceFile::palette).flat_map(Palette::names).cloned());
        Self { declared, ..Self::default() }
    }

    /// Adds the colours in some episodes of a file; files and rows must come in order.
    pub(crate) fn add(&mut self, files: &[TraceFile], file: usize, sightings: Vec<Sighting>) {
        for sighting in sightings {
            let is_seen = matches!(sighting.column.name, "body_color" | "selected_cube");
            if is_seen {
                self.seen.insert(sighting.name.clone());
            }
            if files[file].colors.has(&sighting.name) {
                continue;
            }
            match self.met.entry((sighting.column.name, sighting.name.clone())) {
                Entry::Occupied(mut first) => first.get_mut().1.rows += sighting.rows,
                Entry::Vacant(place) => drop(place.insert((file, sighting))),
            }
        }
    }

    /// The findings about colours together: errors for other spellings of a colour, notes for claims of one that
    /// nothing has. Each has the position of its file.
    pub(crate) fn findings(&self, files: &[TraceFile]) -> Vec<(usize, Finding)> {
        let mut spelled: HashMap<String, &str> = HashMap::new();
        for name in self.declared.iter().chain(&self.seen) {
            spelled.entry(spelling_key(name)).or_insert(name);
        }
        let found = self.met.values().filter_map(|(file, sighting)| {
            let right = spelled.get(&spelling_key(&sighting.name)).copied();
            let finding = respelled(sighting, &files[*file], right).or_else(|| self.unseen(sighting, &files[*file]));
            finding.map(|finding| (*file, finding))
        });
        found.collect()
    }

    fn unseen(&self, sighting: &Sighting, file: &TraceFile) -> Option<Finding> {
        if sighting.column.name != "self_color" || self.seen.contains(&sighting.name) {
            return None;
        }
        let rows = if sighting.rows == 1 { "1 row".to_owned() } else { format!("{} rows", sighting.rows) };
        let found = format!("`{}` in {rows}, first in this one", sighting.name.escape_debug());
        let expected = "the colour of a body or of a selected cube in these inputs";
        let finding = sighting.place(Finding::new(Code::UnseenColor, file.name(), expected, found));
        // Each claim is compared with each colour that was seen.
        let is_few = self.met.len().saturating_mul(self.seen.len()) <= MOST_COMPARED;
        let like = is_few.then(|| most_like(&sighting.name, self.seen.iter().map(String::as_str))).flatten();
        Some(match like {
            Some(like) => finding.with_help(format!("{} Otherwise {}", did_you_mean(like), Code::UnseenColor.help())),
            None => finding,
        })
    }
}

fn respelled(sighting: &Sighting, file: &TraceFile, right: Option<&str>) -> Option<Finding> {
    let right = right.filter(|right| *right != sighting.name)?;
    let more = if sighting.rows == 1 { String::new() } else { format!(" (in {} rows)", sighting.rows) };
    let found = format!("`{}`{more}", sighting.name.escape_debug());
    let finding = Finding::new(Code::InvalidColor, file.name(), "one spelling of a colour in all inputs", found);
    Some(sighting.place(finding).with_help(meant_by(&sighting.name, right)))
}

impl Sighting {
    fn place(&self, finding: Finding) -> Finding {
        let finding = finding.in_row_group(self.row_group).at(self.t).in_column(self.column.name);
        match &self.episode {
            Some(episode) => finding.in_episode(episode),
            None => finding,
        }
    }
}

/// The possible colours of some episodes beyond those of the study: all dictionary entries, used or not. The cost
/// depends on the number of entries, not of rows.
pub(crate) fn other_names(layout: &Layout, episodes: &Episodes) -> Vec<String> {
    let entries = color_columns(layout, episodes).flat_map(|(held, _)| held.entries().as_string::<i32>());
    let is_other = |name: &&str| Color::named(name).is_none() && !WORDS.contains(name);
    entries.flatten().filter(is_other).map(str::to_owned).collect()
}

/// Names that are not colours of the study, whether or not a row has them.
pub(crate) struct Spellings(BTreeSet<String>);

impl Spellings {
    pub(crate) fn new(files: &[TraceFile]) -> Self {
        Self(files.iter().filter_map(TraceFile::palette).flat_map(Palette::names).cloned().collect())
    }

    pub(crate) fn add(&mut self, names: Vec<String>) {
        self.0.extend(names);
    }

    /// Errors: the first row, by file, with another spelling of a colour in the set. The rows are read again only if two
    /// of the names are spellings of one colour.
    pub(crate) fn check(&self, files: &[TraceFile], layout: &Layout, threads: NonZeroUsize) -> Result<(), TraceError> {
        let keys: BTreeSet<String> = self.0.iter().map(|name| spelling_key(name)).collect();
        if keys.len() == self.0.len() {
            return Ok(());
        }
        let mut tally = Tally::new(files);
        let work = |episodes: Episodes| sightings(&files[episodes.file], layout, &episodes);
        pass(files, layout, threads, &work, |file, event| match event {
            ScanEvent::Whole(found) => {
                tally.add(files, file, found);
                Ok(())
            }
            ScanEvent::Fault(finding) => Err(TraceError::from(finding)),
        })?;
        let mut found = tally.findings(files).into_iter().map(|(_, finding)| finding);
        found.find(|finding| finding.code == Code::InvalidColor).map_or(Ok(()), |finding| Err(finding.into()))
    }
}

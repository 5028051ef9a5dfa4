//! `labels.jsonl` beside the traces: the labels and notes of coders, one JSON object per line.
//!
//! Rule: the list only grows. A later line replaces an earlier one of the same coder, episode, step and label, so two
//! lists can be concatenated.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::io::{self, BufWriter, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use indexmap::IndexSet;

use mirrorstats_exact::budget::{Budget, Limit};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::replace::NewFile;

use super::label_line::{LONGEST_LINE, LabelLine};
use super::{ListError, lines, numbered_lines};
use crate::inputs::Input;

/// The prefix of column names: the label `confabulates` is the column `label_confabulates`.
pub const PREFIX: &str = "label_";

const MOST_LINES: Limit = Limit::new("lines in a list of labels", 2_000_000);
const MOST_NOTES: Limit = Limit::new("bytes of notes in a list of labels", 32 << 20);
const MOST_CODERS: Limit = Limit::new("coders in a list of labels", 1000);
const MOST_WORDS: Limit = Limit::new("different labels in a list of labels", 200);

/// The folder of a recording's complete episodes that are not in its trace yet.
const PARTS: &str = ".parts";

/// The list beside a trace: in the trace's folder, or in the recording's.
pub fn list_beside(trace: &Path) -> PathBuf {
    let folder = trace.parent().unwrap_or(Path::new(""));
    let recording = folder.parent().filter(|_| folder.ends_with(PARTS));
    recording.unwrap_or(folder).join("labels.jsonl")
}

pub fn append(list: &Path, line: &LabelLine) -> Result<(), ListError> {
    let failed = |source| ListError::Write { path: list.to_owned(), source };
    let mut file = OpenOptions::new().create(true).append(true).read(true).open(list).map_err(failed)?;
    let mut text = serde_json::to_string(line).map_err(io::Error::from).map_err(failed)?;
    text.push('\n');
    // A list edited by hand may end without a line feed.
    if file.seek(SeekFrom::End(0)).map_err(failed)? > 0 {
        let mut end = [0];
        file.seek(SeekFrom::End(-1)).and_then(|_| file.read_exact(&mut end)).map_err(failed)?;
        if end != *b"\n" {
            text.insert(0, '\n');
        }
    }
    // A single write, so that lines of several programs do not mix.
    file.write_all(text.as_bytes()).map_err(failed)
}

/// Removes all lines about some episodes and returns their number. No program may add lines meanwhile.
pub fn remove(list: &Path, episodes: &BTreeSet<String>) -> Result<usize, ListError> {
    let writing = |source| ListError::Write { path: list.to_owned(), source };
    if !list.exists() {
        return Ok(0);
    }
    let mut file = NewFile::create(list).map_err(writing)?;
    let mut kept = BufWriter::new(file.as_file_mut());
    let mut removed = 0;
    for line in lines(list, LONGEST_LINE)? {
        let line = line?;
        // Invalid labels of these episodes go too.
        let label: serde_json::Value = serde_json::from_slice(&line).unwrap_or_default();
        if label["episode_id"].as_str().is_some_and(|id| episodes.contains(id)) {
            removed += 1;
        } else {
            kept.write_all(&line).map_err(writing)?;
        }
    }
    kept.flush().map_err(writing)?;
    drop(kept);
    if removed > 0 {
        file.commit().map_err(writing)?;
    }
    Ok(removed)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark<'l> {
    pub coder: &'l str,
    /// `None` for the whole episode.
    pub step: Option<u32>,
    /// `None` if the coder looked and gave no label.
    pub label: Option<&'l str>,
    pub note: Option<&'l str>,
}

/// The labels beside some traces. A million lines take about 20 MB.
#[derive(Clone, Debug, Default)]
pub struct Labels {
    episodes: IndexSet<String>,
    coders: IndexSet<String>,
    words: IndexSet<String>,
    /// Sorted, each once.
    marks: Vec<Key>,
    /// The notes. Few marks have one, so a place for each would double the memory.
    notes: BTreeMap<Key, Box<str>>,
}

/// The positions of names in their sets. The step is 0 for the whole episode; the word is [`NONE`] without a label.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    episode: u32,
    step: u32,
    word: u32,
    coder: u32,
}

const NONE: u32 = u32::MAX;

/// The position of a name in its set. A list has far fewer names than 32 bits count.
fn position(set: &mut IndexSet<String>, name: String) -> u32 {
    u32::try_from(set.insert_full(name).0).unwrap_or(NONE)
}

impl Labels {
    pub fn beside(traces: &[Input]) -> Result<Self, ListError> {
        let mut labels = Self::default();
        let lists: BTreeSet<PathBuf> = traces.iter().map(|input| list_beside(&input.path)).collect();
        let mut marks = BTreeSet::new();
        for list in lists {
            labels.read(&list, &mut marks)?;
        }
        labels.marks = marks.into_iter().collect();
        Ok(labels)
    }

    fn read(&mut self, list: &Path, marks: &mut BTreeSet<Key>) -> Result<(), ListError> {
        let exceeded = |source| ListError::Budget { path: list.to_owned(), source };
        let notes = Budget::new(MOST_NOTES);
        for line in numbered_lines(list, LONGEST_LINE)? {
            let (number, line) = line?;
            MOST_LINES.check(number as u64).map_err(exceeded)?;
            let help = "correct or remove the line; docs/how-to/view.md has examples";
            let wrong = |problem| ListError::Line { path: list.to_owned(), line: number, problem, help };
            let line: LabelLine = serde_json::from_slice(&line).map_err(|error| {
                let found = error.to_string();
                let found = found.split(" at line ").next().unwrap_or_default();
                wrong(format!(
                    "expected a label: `coder`, `episode_id`, `step`, `label`, `note`, found {}",
                    visible(found)
                ))
            })?;
            line.check().map_err(|invalid| wrong(invalid.to_string()))?;
            notes.spend(line.note.as_ref().map_or(0, |note| note.len() as u64)).map_err(exceeded)?;
            self.add(line, marks);
            MOST_CODERS.check(self.coders.len() as u64).map_err(exceeded)?;
            MOST_WORDS.check(self.words.len() as u64).map_err(exceeded)?;
        }
        Ok(())
    }

    fn add(&mut self, line: LabelLine, marks: &mut BTreeSet<Key>) {
        let key = Key {
            episode: position(&mut self.episodes, line.episode_id),
            step: line.step.unwrap_or(0),
            word: line.label.map_or(NONE, |word| position(&mut self.words, word)),
            coder: position(&mut self.coders, line.coder),
        };
        self.notes.remove(&key);
        if line.removed {
            marks.remove(&key);
        } else {
            marks.insert(key);
            self.notes.extend(line.note.filter(|note| !note.is_empty()).map(|note| (key, note.into())));
        }
    }

    pub fn is_empty(&self) -> bool {
        self.marks.is_empty()
    }

    pub fn words(&self) -> BTreeSet<&str> {
        self.marks.iter().filter_map(|key| self.words.get_index(key.word as usize)).map(String::as_str).collect()
    }

    pub fn columns(&self) -> Vec<String> {
        self.words().into_iter().map(|word| format!("{PREFIX}{word}")).collect()
    }

    pub fn episodes(&self) -> impl Iterator<Item = &str> {
        let mut last = None;
        let numbers = self.marks.iter().map(|key| key.episode);
        numbers
            .filter(move |number| last.replace(*number) != Some(*number))
            .map(|number| &*self.episodes[number as usize])
    }

    pub fn of_episode(&self, id: &str) -> impl Iterator<Item = Mark<'_>> {
        let known = self.episodes.get_index_of(id).and_then(|at| u32::try_from(at).ok());
        let marks = known.map(|episode| {
            let start = self.marks.partition_point(|key| key.episode < episode);
            self.marks[start..].iter().take_while(move |key| key.episode == episode)
        });
        marks.into_iter().flatten().map(|key| self.mark(*key))
    }

    /// The value of a column: true if a coder gave the label to the episode or a step, false if coders gave only
    /// others, null if no coder saw the episode.
    pub fn value(&self, column: &str, id: &str) -> Option<bool> {
        let word = column.strip_prefix(PREFIX);
        let mut marks = self.of_episode(id).peekable();
        marks.peek()?;
        Some(word.is_some() && marks.any(|mark| mark.label == word))
    }

    /// The labels of each coder by episode; an empty set if the coder gave none.
    pub fn by_coder(&self) -> BTreeMap<&str, BTreeMap<&str, BTreeSet<&str>>> {
        let mut coders: BTreeMap<&str, BTreeMap<&str, BTreeSet<&str>>> = BTreeMap::new();
        for key in &self.marks {
            let Mark { coder, label, .. } = self.mark(*key);
            coders.entry(coder).or_default().entry(&self.episodes[key.episode as usize]).or_default().extend(label);
        }
        coders
    }

    fn mark(&self, key: Key) -> Mark<'_> {
        let Key { step, word, coder, .. } = key;
        let label = self.words.get_index(word as usize).map(String::as_str);
        let note = self.notes.get(&key).map(AsRef::as_ref);
        Mark { coder: &self.coders[coder as usize], step: (step > 0).then_some(step), label, note }
    }
}

#[cfg(test)]
mod tests {
    use super::{LabelLine, Labels, Mark, append, list_beside};
    use crate::inputs::Input;
    use std::path::Path;

    fn line(coder: &str, step: Option<u32>, label: Option<&str>, note: Option<&str>) -> LabelLine {
        let [label, note] = [label, note].map(|text| text.map(str::to_owned));
        LabelLine { coder: coder.into(), episode_id: "E1/m/s1/r1".into(), step, label, note, removed: false }
    }

    fn read(text: &str) -> Result<Labels, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("labels.jsonl"), text).unwrap();
        Labels::beside(&[Input::new(folder.path().join("a.parquet"))]).map_err(|error| error.to_string())
    }

    #[test]
    fn a_later_line_replaces_an_earlier_one_and_a_removal_takes_it_back() {
        let folder = tempfile::tempdir().unwrap();
        let inputs = ["a.parquet", ".parts/b.parquet"].map(|name| Input::new(folder.path().join(name)));
        let list = list_beside(&inputs[0].path);
        assert_eq!(list, list_beside(&inputs[1].path));
        assert!(Labels::beside(&inputs).unwrap().is_empty());
        std::fs::write(&list, r#"{"coder":"bob","episode_id":"E1/m/s2/r1"}"#).unwrap();
        append(&list, &line("ann", None, Some("confabulates"), Some("first"))).unwrap();
        append(&list, &line("ann", Some(3), Some("loops"), None)).unwrap();
        append(&list, &line("ann", None, Some("confabulates"), Some("second"))).unwrap();
        let labels = Labels::beside(&inputs).unwrap();
        let marks: Vec<Mark<'_>> = labels.of_episode("E1/m/s1/r1").collect();
        let expected = [(None, Some("confabulates"), Some("second")), (Some(3), Some("loops"), None)];
        assert_eq!(marks, expected.map(|(step, label, note)| Mark { coder: "ann", step, label, note }));
        assert_eq!(labels.columns(), ["label_confabulates", "label_loops"]);
        let value = |column, episode| labels.value(column, episode);
        assert_eq!(value("label_loops", "E1/m/s1/r1"), Some(true));
        assert_eq!(value("label_loops", "E1/m/s2/r1"), Some(false), "bob looked and puts no label");
        assert_eq!(value("label_loops", "E1/m/s3/r1"), None, "nobody looked");
        append(&list, &LabelLine { removed: true, ..line("ann", Some(3), Some("loops"), None) }).unwrap();
        append(&list, &LabelLine { removed: true, ..line("ann", None, Some("confabulates"), None) }).unwrap();
        let labels = Labels::beside(&inputs).unwrap();
        assert_eq!((labels.columns().len(), labels.value("label_loops", "E1/m/s1/r1")), (0, None));
    }

    #[test]
    fn concatenated_lists_are_a_valid_list() {
        let of = |coder: &str| serde_json::to_string(&line(coder, None, Some("loops"), None)).unwrap() + "\n";
        let (both, turned) = (read(&(of("ann") + &of("bob"))).unwrap(), read(&(of("bob") + &of("ann"))).unwrap());
        assert_eq!(both.by_coder(), turned.by_coder());
        assert_eq!(both.by_coder().keys().copied().collect::<Vec<_>>(), ["ann", "bob"]);
    }

    #[test]
    fn an_invalid_line_is_named_with_what_is_expected() {
        let good = r#"{"coder":"ann","episode_id":"e","label":"loops"}"#;
        for (bad, expected, found) in [
            (r#"{"coder":"ann","label":"loops"}"#, "expected a label", "missing field `episode_id`"),
            (r#"{"coder":"ann","episode_id":"e","lable":"loops"}"#, "expected a label", "unknown field `lable`"),
            (r#"{"coder":"ann","episode_id":"e","label":"Loops!"}"#, "lowercase letters", "`Loops!`"),
            (r#"{"coder":"ann","episode_id":"e","step":0}"#, "a step from 1", "found 0"),
            (r#"{"coder":" ","episode_id":"e"}"#, "a coder's name", "found ` `"),
            ("[1", "expected a label", "found"),
        ] {
            let error = read(&format!("{good}\n\n{bad}\n")).unwrap_err();
            assert!(error.contains("labels.jsonl, line 3: ") && error.contains("help: "), "{error}");
            assert!(error.contains(expected) && error.contains(found), "{error}");
        }
        let long = format!(r#"{{"coder":"ann","episode_id":"e","note":"{}"}}"#, "x".repeat(2001));
        assert!(read(&long).unwrap_err().contains("a note of at most 2000 characters, found 2001"));
    }

    #[test]
    fn the_list_is_in_the_folder_of_the_trace() {
        assert_eq!(list_beside(Path::new("a.parquet")), Path::new("labels.jsonl"));
        assert_eq!(list_beside(Path::new("runs/.parts/a.parquet")), Path::new("runs/labels.jsonl"));
    }
}

//! People's answers, one per line in order of arrival, so that an interrupted recording continues where they were.
//!
//! Rule: only codes, links, times and answers of a person are stored. An answer is on disk before its step is done.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::json_lines;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::hash;
use mirrorstats_exact::replace;

const NAME: &str = "participants.jsonl";

/// An answer may be long, but not unlimited.
const LONGEST_LINE: Limit = Limit::new("bytes in a line of the journal of participants", 4 << 20);

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlayedStep {
    pub episode_id: String,
    pub t: i32,
    /// From the frame to the reply, ms.
    pub latency_ms: i32,
    pub reply: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Line {
    participant: String,
    #[serde(flatten)]
    event: Event,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
enum Event {
    Answer(PlayedStep),
    /// Somebody agreed to the consent text with this hash.
    Agreed {
        consent: String,
    },
    Practised {
        practised: bool,
    },
    Left {
        left: Leaving,
    },
    /// Somebody got a link, and a position among the participants, from 1.
    Enrolled {
        place: usize,
        link: String,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Leaving {
    Declined,
    /// They stopped; their data stays.
    Stopped,
    /// They stopped, and their data is deleted.
    Deleted,
}

#[derive(Debug)]
pub struct ParticipantJournal {
    /// The folder; `None` without a recording. The file is opened per line, since `participants remove` replaces it.
    folder: Option<PathBuf>,
    lines: Vec<Line>,
}

impl ParticipantJournal {
    pub fn open(folder: &Path) -> io::Result<Self> {
        replace::make_folder(folder)?;
        let path = folder.join(NAME);
        let lines = json_lines::read(&path, LONGEST_LINE)?;
        let mut file = appending(&path)?;
        if !lines.is_empty() {
            // Ends a line that was cut off, so that a new one begins.
            file.write_all(b"\n")?;
        }
        Ok(Self { folder: Some(folder.to_owned()), lines })
    }

    pub const fn none() -> Self {
        Self { folder: None, lines: Vec::new() }
    }

    /// The answers that existed when it was opened, with the codes of their participants.
    pub(super) fn answers(&self) -> impl Iterator<Item = (&str, &PlayedStep)> {
        self.lines.iter().filter_map(|line| match &line.event {
            Event::Answer(step) => Some((line.participant.as_str(), step)),
            _ => None,
        })
    }

    fn events(&self, code: &str) -> impl Iterator<Item = &Event> {
        self.lines.iter().filter(move |line| line.participant == code).map(|line| &line.event)
    }

    pub(super) fn has_agreed(&self, code: &str, words: Option<&str>) -> bool {
        let own = words.map(|words| hash::of_bytes(words.as_bytes()));
        self.events(code).any(|event| matches!(event, Event::Agreed { consent } if Some(consent) == own.as_ref()))
    }

    pub(super) fn has_practised(&self, code: &str) -> bool {
        self.events(code).any(|event| matches!(event, Event::Practised { .. }))
    }

    pub(super) fn left(&self, code: &str) -> Option<Leaving> {
        let left = |event: &Event| if let Event::Left { left } = event { Some(*left) } else { None };
        self.events(code).filter_map(left).last()
    }

    /// The position among the participants and the link of a person, if enrolled.
    pub fn enrolled(&self, code: &str) -> Option<(usize, &str)> {
        self.events(code).find_map(|event| match event {
            Event::Enrolled { place, link } => Some((*place, link.as_str())),
            _ => None,
        })
    }

    pub fn enrol(&self, code: &str, place: usize, link: &str) -> io::Result<()> {
        self.write(code, Event::Enrolled { place, link: link.to_owned() })
    }

    pub(super) fn keep(&self, code: &str, step: PlayedStep) -> io::Result<()> {
        self.write(code, Event::Answer(step))
    }

    pub(super) fn agreed(&self, code: &str, words: &str) -> io::Result<()> {
        self.write(code, Event::Agreed { consent: hash::of_bytes(words.as_bytes()) })
    }

    pub(super) fn practised(&self, code: &str) -> io::Result<()> {
        self.write(code, Event::Practised { practised: true })
    }

    pub(super) fn leave(&self, code: &str, left: Leaving) -> io::Result<()> {
        self.write(code, Event::Left { left })
    }

    /// Removes a person's answers; their withdrawal, position and link stay. Returns the folder, if there is one.
    pub(super) fn forget(&self, code: &str) -> io::Result<Option<PathBuf>> {
        let Some(folder) = &self.folder else { return Ok(None) };
        let stays =
            |line: &Line| line.participant != code || matches!(line.event, Event::Left { .. } | Event::Enrolled { .. });
        keep(folder, stays)?;
        Ok(Some(folder.clone()))
    }

    fn write(&self, code: &str, event: Event) -> io::Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let mut file = appending(&folder.join(NAME))?;
        file.write_all(&json_lines::line(&Line { participant: code.to_owned(), event })?)?;
        file.sync_data()
    }
}

pub fn remove(folder: &Path, code: &str) -> io::Result<usize> {
    keep(folder, |line| line.participant != code)
}

fn keep(folder: &Path, stays: impl Fn(&Line) -> bool) -> io::Result<usize> {
    let path = folder.join(NAME);
    let lines: Vec<Line> = json_lines::read(&path, LONGEST_LINE)?;
    let kept: Vec<&Line> = lines.iter().filter(|line| stays(line)).collect();
    let removed = lines.len() - kept.len();
    if removed > 0 {
        json_lines::replace(&path, &kept)?;
    }
    Ok(removed)
}

fn appending(path: &Path) -> io::Result<File> {
    OpenOptions::new().append(true).create(true).open(path)
}

#[cfg(test)]
mod tests {
    use super::{Leaving, ParticipantJournal, PlayedStep, remove};

    #[test]
    fn answers_come_back_and_a_person_can_be_removed() {
        let folder = tempfile::tempdir().unwrap();
        let step = |t| PlayedStep { episode_id: "E1/human/s1/r1".to_owned(), t, latency_ms: 5, reply: "{}".to_owned() };
        let journal = ParticipantJournal::open(folder.path()).unwrap();
        journal.agreed("P1", "words").unwrap();
        journal.keep("P1", step(1)).unwrap();
        journal.practised("P2").unwrap();
        journal.keep("P2", step(2)).unwrap();
        drop(journal);
        let journal = ParticipantJournal::open(folder.path()).unwrap();
        assert_eq!(journal.answers().collect::<Vec<_>>(), [("P1", &step(1)), ("P2", &step(2))]);
        assert!(journal.has_agreed("P1", Some("words")) && !journal.has_agreed("P1", Some("other words")));
        assert!(journal.has_practised("P2") && !journal.has_practised("P1"));
        assert_eq!(remove(folder.path(), "P1").unwrap(), 2);
        assert!(!std::fs::read_to_string(folder.path().join("participants.jsonl")).unwrap().contains("P1"));
        let journal = ParticipantJournal::open(folder.path()).unwrap();
        assert_eq!(journal.answers().collect::<Vec<_>>(), [("P2", &step(2))]);
    }

    #[test]
    fn forgetting_a_person_keeps_that_they_left() {
        let folder = tempfile::tempdir().unwrap();
        let journal = ParticipantJournal::open(folder.path()).unwrap();
        journal.enrol("P1", 1, "abc").unwrap();
        journal.agreed("P1", "words").unwrap();
        journal.leave("P1", Leaving::Deleted).unwrap();
        journal.forget("P1").unwrap();
        journal.practised("P2").unwrap();
        drop(journal);
        let journal = ParticipantJournal::open(folder.path()).unwrap();
        assert_eq!((journal.enrolled("P1"), journal.left("P1")), (Some((1, "abc")), Some(Leaving::Deleted)));
        assert!(
            !journal.has_agreed("P1", Some("words")) && journal.has_practised("P2") && journal.left("P2").is_none()
        );
    }
}

//! The standard error of a program: its end is kept for messages and for a file of the episode.
//!
//! Rule: no value of a variable that holds a key leaves this file, not even the rest of one whose beginning was cut
//! off. Everything else stays as the program wrote it, including control characters for terminals.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::{fs, io};

use crate::locked;
use crate::secrets::Secret;
use mirrorstats_exact::replace::{folder_of, make_folder, replace};

pub(crate) const IN_FILE: usize = 256 * 1024;
const IN_MESSAGE: usize = 2_000;
/// Extra bytes before those of the file: longer than any key, since the cut may split one.
const MARGIN: usize = 4_096;

#[derive(Debug, Default)]
pub(crate) struct Said(Mutex<Tail>);

#[derive(Debug, Default)]
struct Tail {
    bytes: VecDeque<u8>,
    is_cut: bool,
}

impl Said {
    pub fn add(&self, bytes: &[u8]) {
        let mut tail = locked(&self.0);
        tail.bytes.extend(bytes);
        let surplus = tail.bytes.len().saturating_sub(IN_FILE + MARGIN);
        tail.is_cut |= surplus > 0;
        tail.bytes.drain(..surplus);
    }

    /// The newest bytes without keys, at most [`IN_FILE`].
    pub fn bytes(&self, secrets: &[Secret]) -> Vec<u8> {
        let (raw, is_cut) = {
            let tail = locked(&self.0);
            (tail.bytes.iter().copied().collect::<Vec<_>>(), tail.is_cut)
        };
        let mut kept = Vec::with_capacity(raw.len());
        for chunk in raw.utf8_chunks() {
            kept.extend_from_slice(without(secrets, chunk.valid()).as_bytes());
            kept.extend_from_slice(chunk.invalid());
        }
        let least = if is_cut { MARGIN } else { 0 };
        kept.drain(..least.max(kept.len().saturating_sub(IN_FILE)).min(kept.len()));
        kept
    }

    /// The last lines, indented, each whole if there are several; `None` without output.
    pub(crate) fn last_words(&self, secrets: &[Secret]) -> Option<String> {
        let bytes = self.bytes(secrets);
        let text = String::from_utf8_lossy(last_lines(&bytes)).replace('\t', "    ");
        let lines = text.lines().map(str::trim_end).filter(|line| !line.is_empty());
        let lines: Vec<String> = lines.map(|line| format!("    {line}")).collect();
        (!lines.is_empty()).then(|| lines.join("\n"))
    }
}

fn last_lines(bytes: &[u8]) -> &[u8] {
    let cut = bytes.len().saturating_sub(IN_MESSAGE);
    let begins = |at: usize| at == 0 || bytes[at - 1] == b'\n';
    let first = (cut..bytes.len()).find(|&at| begins(at)).unwrap_or(cut);
    &bytes[first..]
}

pub fn without(secrets: &[Secret], text: &str) -> String {
    secrets.iter().fold(text.to_owned(), |text, secret| secret.without(&text))
}

/// The file of an episode, written on drop: whether the episode is recorded, lost or stopped.
#[derive(Debug)]
pub(crate) struct Kept {
    pub(super) said: Arc<Said>,
    path: PathBuf,
    secrets: Arc<[Secret]>,
}

impl Kept {
    pub fn new(folder: &Path, episode_id: &str, secrets: Arc<[Secret]>) -> Self {
        let path = folder.join(format!("{}.log", episode_id.replace('/', "-")));
        Self { said: Arc::default(), path, secrets }
    }

    fn write(&self) -> io::Result<()> {
        let bytes = self.said.bytes(&self.secrets);
        if bytes.is_empty() {
            // Output of an earlier attempt does not belong to this one.
            return fs::remove_file(&self.path);
        }
        make_folder(folder_of(&self.path))?;
        replace(&self.path, &bytes)
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        // Best effort: the episode does not depend on this file, and other writes report a full disk.
        let _ = self.write();
    }
}

#[cfg(test)]
mod tests {
    use super::{IN_FILE, IN_MESSAGE, Kept, MARGIN, Said, Secret};

    #[test]
    fn the_end_of_standard_error_is_kept() {
        let said = Said::default();
        assert_eq!((said.bytes(&[]), said.last_words(&[])), (Vec::new(), None));
        said.add(b" \n");
        assert_eq!(said.last_words(&[]), None);
        said.add(&vec![b'x'; IN_FILE]);
        said.add(b"\n\x1b[1mthe\tend\xff\n");
        assert_eq!(said.last_words(&[]).unwrap(), "    \u{1b}[1mthe    end\u{fffd}");
        let bytes = said.bytes(&[]);
        assert!(bytes.len() == IN_FILE && bytes.ends_with(b"x\n\x1b[1mthe\tend\xff\n"));
        said.add(&vec![b'y'; 3 * IN_FILE]);
        assert_eq!(said.bytes(&[]), vec![b'y'; IN_FILE]);
    }

    #[test]
    fn last_words_keep_their_lines() {
        let said = Said::default();
        said.add(b"Traceback (most recent call last):\r\n  File \"agent.py\", line 4, in f\n\n\tg()\nValueError: 12\n");
        let expected =
            ["Traceback (most recent call last):", "  File \"agent.py\", line 4, in f", "    g()", "ValueError: 12"];
        assert_eq!(said.last_words(&[]).unwrap(), expected.map(|line| format!("    {line}")).join("\n"));
        // Of a line longer than a message, only the end is kept.
        said.add(&vec![b'x'; 2 * IN_MESSAGE]);
        assert_eq!(said.last_words(&[]).unwrap(), format!("    {}", "x".repeat(IN_MESSAGE)));
    }

    #[test]
    fn a_key_cut_anywhere_is_removed_completely() {
        let key = "sk-0123456789abcdef";
        let secrets = [Secret::new(key.to_owned())];
        for after in (IN_FILE + MARGIN - key.len() - 1)..=(IN_FILE + MARGIN) {
            let said = Said::default();
            said.add(key.as_bytes());
            said.add(&vec![b'.'; after - 2 * key.len()]);
            said.add(key.as_bytes());
            said.add(&vec![b'.'; key.len()]);
            let text = String::from_utf8(said.bytes(&secrets)).unwrap();
            assert!(text.contains("[key]...") && !text.contains("cdef") && !text.contains("sk-"), "{after}");
        }
    }

    #[test]
    fn the_last_output_is_written_to_a_file_if_there_is_any() {
        let folder = tempfile::tempdir().unwrap();
        let of = |words: &[u8]| {
            let kept = Kept::new(&folder.path().join("stderr"), "E1/own/s1/r2", [].into());
            kept.said.add(words);
            drop(kept);
            std::fs::read(folder.path().join("stderr/E1-own-s1-r2.log")).ok()
        };
        assert_eq!(of(b""), None);
        assert_eq!(of(b"\x1b[1mone\r\n").as_deref(), Some(&b"\x1b[1mone\r\n"[..]));
        assert_eq!(of(b"two").as_deref(), Some(&b"two"[..]));
        assert_eq!(of(b""), None);
    }
}

//! The files that a command names: their contents shape the replies as much as the command does.
//!
//! Rule: a word that names a regular file, relative to the starting folder, counts by position and content hash, not by
//! path. Exempt are the word that the shell looks up on `PATH`, redirection targets, and files named within a word
//! (`--log=out.log`).

use std::fs::File;
use std::io;
use std::path::Path;

use mirrorstats_exact::hash;

/// The operators that end a command, so that the next word is a command again.
const OPERATORS: [&str; 6] = [";", "&", "&&", "|", "||", "("];

#[derive(Debug, thiserror::Error)]
#[error("cannot read `{word}`, which the command of --agent exec: names: {source}")]
pub struct Unreadable {
    word: String,
    source: io::Error,
}

/// The hash over the positions and contents of the files that a command names; `None` if it names none or the shell
/// cannot parse it.
pub(super) fn fingerprint(command: &str) -> Result<Option<String>, Unreadable> {
    let files = words(command).into_iter().filter(|(_, word)| Path::new(word).is_file());
    let line = |(place, word): (usize, String)| match File::open(&word).and_then(hash::of_reader) {
        Ok(contents) => Ok(format!("{place} {contents}\n")),
        Err(source) => Err(Unreadable { word, source }),
    };
    let lines: Vec<String> = files.map(line).collect::<Result<_, _>>()?;
    Ok((!lines.is_empty()).then(|| hash::of_bytes(lines.concat().as_bytes())))
}

/// The words of a command that may name files to read, each with its position from 1.
fn words(command: &str) -> Vec<(usize, String)> {
    let mut kept = Vec::new();
    let (mut is_command, mut is_output) = (true, false);
    for (place, word) in (1..).zip(shlex::split(command).unwrap_or_default()) {
        let (bare, ends) = without_operators(&word);
        let is_searched = is_command && !bare.contains('/');
        let is_redirected = std::mem::replace(&mut is_output, is_redirection(&word));
        if !is_searched && !is_redirected && !is_output && !bare.is_empty() {
            kept.push((place, bare.to_owned()));
        }
        is_command = ends || is_command && is_assignment(bare);
    }
    kept
}

/// A word without the operators attached to it, and whether it ends a command. A file with an operator in its name is
/// unchanged.
fn without_operators(word: &str) -> (&str, bool) {
    if OPERATORS.contains(&word) {
        return ("", true);
    }
    if Path::new(word).is_file() {
        return (word, false);
    }
    let bare = word.trim_start_matches(['(', '<']).trim_end_matches([';', '&', '|', ')']);
    (bare, word.ends_with([';', '&', '|']))
}

fn is_redirection(word: &str) -> bool {
    let operator = word.trim_start_matches(|c: char| c.is_ascii_digit() || c == '&');
    matches!(operator, ">" | ">>" | ">|")
}

fn is_assignment(word: &str) -> bool {
    let is_name = |name: &str| name.chars().all(|c| c == '_' || c.is_ascii_alphanumeric());
    word.split_once('=').is_some_and(|(name, _)| !name.is_empty() && is_name(name))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{fingerprint, words};
    use mirrorstats_exact::hash;

    #[test]
    fn possible_file_names_of_a_command_are_found() {
        for (command, expected) in [
            ("python3 agent.py", vec![(2, "agent.py")]),
            ("./agent --model 'my model.bin'", vec![(1, "./agent"), (2, "--model"), (3, "my model.bin")]),
            ("A=1 B_2=x python3 a.py", vec![(4, "a.py")]),
            ("cd there; python3 a.py", vec![(2, "there"), (4, "a.py")]),
            ("cat prompt.txt | python3 a.py && ls", vec![(2, "prompt.txt"), (5, "a.py")]),
            ("python3 a.py > out.log 2>> err.log", vec![(2, "a.py")]),
            ("agent <state.json # a.py", vec![(2, "state.json")]),
            ("agent 'open", vec![]),
            ("", vec![]),
        ] {
            let words = words(command);
            assert_eq!(words.iter().map(|(place, word)| (*place, word.as_str())).collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn the_hash_covers_positions_and_contents() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        fs::write(path("a"), "abc").unwrap();
        fs::write(path("b"), "").unwrap();
        // FIPS 180-2, appendix B.1, and the hash of nothing.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let nothing = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        let of = |command: String| fingerprint(&command).unwrap();
        let expected = hash::of_bytes(format!("2 {abc}\n4 {nothing}\n").as_bytes());
        assert_eq!(of(format!("sh {} -x {}", path("a"), path("b"))), Some(expected.clone()));
        assert_ne!(of(format!("sh {} -x {}", path("b"), path("a"))), Some(expected));
        assert_eq!(of(format!("sh {} > {}", folder.path().display(), path("a"))), None);
        assert_eq!(of(path("a")), Some(hash::of_bytes(format!("1 {abc}\n").as_bytes())));
    }
}

//! Opens and reads the user's input files.
//!
//! Rule: an input is a regular file. This is checked before it is opened, so that a pipe, a socket or a device cannot
//! block the program or feed it forever. Deliberate pipes (`/dev/stdin`, or `/dev/fd/3` from a shell's `<(...)`) are
//! accepted for texts, under the same limit.

use std::fs::{File, Metadata};
use std::io::{self, BufRead, BufReader, Read};
#[cfg(unix)]
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use super::budget::Limit;

pub fn open(path: &Path) -> io::Result<File> {
    check(&std::fs::metadata(path)?)?;
    let file = open_without_waiting(path)?;
    // The path may name another file by now.
    check(&file.metadata()?)?;
    Ok(file)
}

pub fn open_text(path: &Path) -> io::Result<File> {
    if is_piped(path) {
        File::open(path).and_then(|file| not_a_folder(&file.metadata()?).map(|()| file))
    } else {
        open(path)
    }
}

pub fn bytes(path: &Path, limit: Limit) -> io::Result<Vec<u8>> {
    bytes_of(open_text(path)?, limit)
}

pub fn bytes_of(reader: impl Read, limit: Limit) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.take(limit.most().saturating_add(1)).read_to_end(&mut bytes)?;
    limit.check(bytes.len() as u64)?;
    Ok(bytes)
}

pub fn text(path: &Path, limit: Limit) -> io::Result<String> {
    utf8(bytes(path, limit)?)
}

pub fn text_of(reader: impl Read, limit: Limit) -> io::Result<String> {
    utf8(bytes_of(reader, limit)?)
}

pub fn lines(path: &Path, longest: Limit) -> io::Result<Lines<BufReader<File>>> {
    Ok(Lines::new(BufReader::new(open_text(path)?), longest))
}

/// Lines of a reader, as bytes with their line feeds; the last line may have none.
#[derive(Debug)]
pub struct Lines<R> {
    reader: R,
    longest: Limit,
}

impl<R: BufRead> Lines<R> {
    pub const fn new(reader: R, longest: Limit) -> Self {
        Self { reader, longest }
    }
}

impl<R: BufRead> Iterator for Lines<R> {
    type Item = io::Result<Vec<u8>>;

    fn next(&mut self) -> Option<Self::Item> {
        match line(&mut self.reader, self.longest) {
            Ok(line) if line.is_empty() => None,
            line => Some(line),
        }
    }
}

/// The next line with its line feed; empty at the end.
pub fn line(reader: &mut impl BufRead, longest: Limit) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.take(longest.most().saturating_add(1)).read_until(b'\n', &mut bytes)?;
    longest.check(bytes.len() as u64)?;
    Ok(bytes)
}

pub fn utf8(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let found = error.as_bytes().get(at).copied().unwrap_or_default();
        let words = format!("expected text in UTF-8, found the byte {found:#04x} at byte {at}");
        io::Error::new(io::ErrorKind::InvalidData, words)
    })
}

fn is_piped(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd") || path.starts_with("/proc/self/fd")
}

fn not_a_folder(about: &Metadata) -> io::Result<()> {
    if about.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "expected a file, found a folder"));
    }
    Ok(())
}

fn check(about: &Metadata) -> io::Result<()> {
    not_a_folder(about)?;
    if about.is_file() {
        return Ok(());
    }
    #[cfg(unix)]
    let found = match about.file_type() {
        kind if FileTypeExt::is_fifo(&kind) => "a named pipe",
        kind if FileTypeExt::is_socket(&kind) => "a socket",
        _ => "a device",
    };
    #[cfg(not(unix))]
    let found = "a device";
    let words = format!("expected a file, found {found}; copy what it gives into a file, and name that");
    Err(io::Error::new(io::ErrorKind::InvalidInput, words))
}

/// Opens without blocking if a pipe has replaced the file since the check.
fn open_without_waiting(path: &Path) -> io::Result<File> {
    let mut options = std::fs::OpenOptions::new();
    #[cfg(target_os = "linux")]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    options.read(true).open(path)
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;
    use std::path::Path;

    use super::{Lines, bytes_of, open, text, utf8};
    use crate::budget::Limit;

    const FOUR: Limit = Limit::new("bytes", 4);

    #[test]
    fn a_text_is_as_long_as_its_limit_at_most() {
        assert_eq!(bytes_of(&b"1234"[..], FOUR).unwrap(), b"1234");
        assert!(bytes_of(&b"12345"[..], FOUR).unwrap_err().to_string().contains("at most 4 bytes"));
        assert!(bytes_of(std::io::repeat(0), FOUR).is_err());
    }

    #[test]
    fn lines_have_a_limit_each() {
        let lines = |text: &'static str| Lines::new(BufReader::new(text.as_bytes()), FOUR).collect::<Vec<_>>();
        let found: Vec<_> = lines("abc\n\nde").into_iter().map(Result::unwrap).collect();
        assert_eq!(found, [&b"abc\n"[..], b"\n", b"de"]);
        assert!(lines("abcd\n")[0].is_err());
    }

    #[test]
    fn the_first_invalid_byte_is_named() {
        let told = utf8(b"ab\xffc".to_vec()).unwrap_err().to_string();
        assert!(told.contains("0xff at byte 2"), "{told}");
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_folders_are_named_and_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for (path, found) in [
            (folder.path(), "a folder"),
            (&socket, "a socket"),
            (&pipe, "a named pipe"),
            (Path::new("/dev/zero"), "a device"),
        ] {
            assert!(open(path).unwrap_err().to_string().contains(found), "{found}");
            assert!(text(path, FOUR).unwrap_err().to_string().contains(found), "{found}");
        }
    }
}

//! File system faults, and the calls that decide what survives a loss of power: the program runs with `faults.c` as a
//! preloaded library.

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// `No space left on device`.
pub const ENOSPC: i32 = 28;
/// `Input/output error`.
pub const EIO: i32 = 5;
/// `Too many open files`.
pub const EMFILE: i32 = 24;
/// `Cannot allocate memory`.
pub const ENOMEM: i32 = 12;
/// `Permission denied`.
pub const EACCES: i32 = 13;

/// A fault: the call that fails, and how.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    /// `open`, `write`, `fsync`, `rename`, `unlink`, `mkdir`, `truncate`, `link`, or `*` for all that change something;
    /// `memory` for allocations of 4 KiB or more.
    pub kind: &'static str,
    /// The number of the call among those of its kind, from 1.
    pub at: usize,
    /// The error number; 0 ends the process instead.
    pub error: i32,
    /// True if all later calls of the kind fail too.
    pub stays: bool,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}{}", self.kind, self.at, self.error, if self.stays { ":on" } else { "" })
    }
}

impl Fault {
    /// The system's message for the error.
    pub fn words(&self) -> String {
        let words = io::Error::from_raw_os_error(self.error).to_string();
        words.split(" (os error").next().unwrap_or_default().to_owned()
    }
}

/// One call of the program on a path below the watched folder.
#[derive(Clone, Debug, PartialEq)]
pub enum Call {
    /// The program opened a file or folder, or tried to.
    Open(PathBuf),
    /// Opening created the file; later calls refer to it by this number.
    Create(PathBuf, usize),
    Truncate(usize, usize),
    Write(usize, usize, Vec<u8>),
    Sync(usize),
    SyncFolder(PathBuf),
    Rename(PathBuf, PathBuf),
    Unlink(PathBuf),
    MakeFolder(PathBuf),
    Link(PathBuf, PathBuf),
    /// The number of allocations that a fault of `memory` counted.
    Allocations(usize),
    /// The call that failed: its kind and path.
    Failed(String, PathBuf),
}

impl Call {
    fn read(line: &str) -> Self {
        let mut fields = line.split('\t');
        let kind = fields.next().unwrap_or_default();
        let mut text = || fields.next().unwrap_or_else(|| panic!("`{line}` is cut off"));
        let number = |text: &str| text.parse().unwrap_or_else(|_| panic!("`{line:.200}` has no number"));
        match kind {
            "open" => Self::Open(text().into()),
            "create" => Self::Create(text().into(), number(text())),
            "truncate" => Self::Truncate(number(text()), number(text())),
            "write" => Self::Write(number(text()), number(text()), from_hex(text())),
            "sync" => Self::Sync(number(text())),
            "sync_folder" => Self::SyncFolder(text().into()),
            "rename" => Self::Rename(text().into(), text().into()),
            "unlink" => Self::Unlink(text().into()),
            "mkdir" => Self::MakeFolder(text().into()),
            "link" => Self::Link(text().into(), text().into()),
            "memory" => Self::Allocations(number(text())),
            "fault" => Self::Failed(text().to_owned(), text().into()),
            other => panic!("`{other}` is no call"),
        }
    }

    /// The kind by which a [`Fault`] selects this call; `None` for calls that belong to another one.
    pub fn kind(&self) -> Option<&'static str> {
        match self {
            Self::Open(_) => Some("open"),
            Self::Write(..) => Some("write"),
            Self::Sync(_) | Self::SyncFolder(_) => Some("fsync"),
            Self::Rename(..) => Some("rename"),
            Self::Unlink(_) => Some("unlink"),
            Self::MakeFolder(_) => Some("mkdir"),
            Self::Link(..) => Some("link"),
            Self::Create(..) | Self::Truncate(..) | Self::Allocations(_) | Self::Failed(..) => None,
        }
    }
}

fn from_hex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

/// The library, compiled once per test program.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/harness/faults.c");
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let (made, named) = (folder.join(format!("faults-{}.so", std::process::id())), folder.join("faults.so"));
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-o"]).arg(&made).arg(source);
        let output = compiler.arg("-ldl").output().unwrap_or_else(|error| panic!("cc, which Rust links with: {error}"));
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        // Other test programs compile it at the same time.
        fs::rename(made, &named).unwrap();
        named
    })
}

/// Logs a command's calls below `root` to the file `log`, which must not be below `root`.
pub fn watched<'a>(command: &'a mut Command, root: &Path, log: &Path) -> &'a mut Command {
    // This replaces an existing `LD_PRELOAD`, which is for the tests themselves.
    command.env("LD_PRELOAD", library()).env("MIRRORSTATS_FAULT_LOG", log);
    command.env("MIRRORSTATS_FAULT_ROOT", root.canonicalize().unwrap())
}

/// Like [`watched`], with a fault.
pub fn failing<'a>(command: &'a mut Command, root: &Path, log: &Path, fault: Fault) -> &'a mut Command {
    watched(command, root, log).env("MIRRORSTATS_FAULT", fault.to_string())
}

/// The calls in a log.
pub fn calls(log: &Path) -> Vec<Call> {
    fs::read_to_string(log).unwrap_or_default().lines().map(Call::read).collect()
}

/// Pseudo-random numbers from a seed.
pub struct Draws(u64);

impl Draws {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x2545_f491_4f6c_dd1d)
    }

    /// A number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % end.max(1)
    }
}

/// A number from the environment, to change the length of a campaign.
pub fn rounds(name: &str, usual: usize) -> usize {
    std::env::var(name)
        .map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name}: expected a number, found `{text}`")))
}

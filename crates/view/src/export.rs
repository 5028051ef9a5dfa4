//! The page as files, for any web server or from a disk: the same answers, in parts that are loaded as they are looked at.
//!
//! Rule: what was computed is in the files, and nothing more can be: filters choose by what the list has. From a disk browsers
//! load neither modules nor data, so that the script is a classic one and each part a script too.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::ViewError;
use super::found::Found;
use super::snapshot::{Opened, Snapshot, Together};
use super::{Options, changes, episode, list, map, overview, page};
use exact::budget::{Budget, Exceeded, Limit};
use exact::hash;
use exact::replace::{Content, FolderError, FolderFiles, TemporaryFolder, folder_of, make_folder, replace_folder};
use study::Part;

/// The instruction for programs that collect pages.
pub const ROBOTS: &str = "# Recordings of evaluations: not for training.\nUser-agent: *\nDisallow: /\n";

/// The notice to people and programs that have the files.
const NOTICE: &str = "These files hold recordings of an evaluation: its scenes, its questions and the answers of models and people.\n\
    They must not be used to train models: who was trained on them can no longer be evaluated with them.\n";

/// The page's permissions, which a server sends as a header.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'self' file:; \
    style-src 'self' file:; style-src-attr 'unsafe-inline'; img-src 'self' file: data:; font-src 'self' file: data:; \
    base-uri 'none'; form-action 'none'\">";

/// The bytes of all files. A step of a small trace takes a byte and is a line of a page.
const fn most_written(bytes: u64) -> Limit {
    Limit::in_proportion("bytes of a page as files, of recordings of their size", 96 << 20, 64, bytes)
}

/// The episodes of a copy: each is a file, and read, explained and written by itself.
const fn most_copied(bytes: u64) -> Limit {
    Limit::in_proportion("episodes of a page as files, of recordings of their size", 2000, 1, bytes / 256)
}

/// What of a trace is read together: values, and episodes.
const TOGETHER: (usize, usize) = (1_000_000, 1000);

/// The file that marks a folder of these files.
const MARK: &str = "assets/view.js";

/// Files by their paths inside the folder, on the disk until they are put in place together.
struct Files {
    stage: TemporaryFolder,
    /// Where they are put, for errors.
    folder: PathBuf,
    all: Vec<PathBuf>,
    written: Budget,
}

impl Files {
    fn add(&mut self, path: &str, bytes: impl AsRef<[u8]>) -> Result<(), ViewError> {
        let bytes = bytes.as_ref();
        self.written.spend(bytes.len() as u64).map_err(exceeded)?;
        let target = self.stage.path().join(path);
        make_folder(folder_of(&target))
            .and_then(|()| fs::write(&target, bytes))
            .map_err(unwritable(&self.folder.join(path)))?;
        self.all.push(path.into());
        Ok(())
    }

    fn part(&mut self, name: &str, value: &Value) -> Result<(), ViewError> {
        self.add(&format!("data/{name}.js"), format!("mirrorstatsPart({name:?}, {value});\n"))
    }
}

fn exceeded(exceeded: Exceeded) -> ViewError {
    ViewError::Request(format!("{exceeded}\n  help: --where \"run = 1\" leaves episodes out"))
}

fn unwritable(path: &Path) -> impl FnOnce(io::Error) -> ViewError {
    let path = path.to_owned();
    move |source| FolderError { path, source }.into()
}

/// Writes the page of everything that is whole; gives the number of files. Recordings that go on are shown as they were at one
/// moment.
pub fn write(options: &Options, folder: &Path) -> Result<usize, ViewError> {
    check_folder(folder)?;
    let parent = folder_of(folder);
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let temporary = || TemporaryFolder::create(parent, &name).map_err(unwritable(folder));
    make_folder(parent).map_err(unwritable(parent))?;
    let inputs = temporary()?;
    let snapshot = Snapshot::of_found(options, Found::frozen(&options.runs, inputs.path())?, 0)?;
    let mut files = Files {
        stage: temporary()?,
        folder: folder.to_owned(),
        all: Vec::new(),
        written: Budget::new(most_written(snapshot.bytes())),
    };
    check_size(&snapshot)?;
    // They come first: what is too much of them is refused before the report is made.
    for some in snapshot.together(TOGETHER)? {
        add_episodes(&mut files, &snapshot, &some)?;
    }
    let script = format!("<script src=\"{MARK}\" data-copy></script>");
    files.add("index.html", page::document(&script).replace("<title>", &format!("{POLICY}\n<title>")))?;
    files.add("assets/view.css", page::style())?;
    files.add(MARK, page::classic())?;
    files.add("robots.txt", ROBOTS)?;
    files.add("NOTICE.txt", NOTICE)?;
    files.part("study", &overview::study(&snapshot))?;
    for (name, part) in [("overview", Part::Tables), ("figures", Part::Figures), ("statistics", Part::Statistics)] {
        files.part(name, &overview::sections(&snapshot, &[], part)?)?;
    }
    if snapshot.options.against.is_some() {
        files.part("changes", &changes::answer(&snapshot)?)?;
    }
    files.part("list", &list::everything(&snapshot)?)?;
    let staged: Vec<PathBuf> = files.all.iter().map(|path| files.stage.path().join(path)).collect();
    let new: Vec<_> =
        files.all.iter().zip(&staged).map(|(path, staged)| (path.as_path(), Content::File(staged))).collect();
    replace_folder(folder, &FolderFiles { new: &new, index: Some(Path::new("index.html")), old: &old_files })?;
    Ok(new.len())
}

/// Refuses what would be too much before a file is written: two bytes are the least that a value takes.
fn check_size(snapshot: &Snapshot) -> Result<(), ViewError> {
    let bytes = snapshot.bytes();
    most_copied(bytes).check(snapshot.episodes() as u64).map_err(exceeded)?;
    most_written(bytes).check(snapshot.values()?.saturating_mul(2)).map_err(exceeded)
}

fn add_episodes(files: &mut Files, snapshot: &Snapshot, some: &Together) -> Result<(), ViewError> {
    let opened = snapshot.open_together(some)?;
    let ids = some.episodes.iter().map(|(_, id)| id.clone()).collect();
    let mut scores = episode::scores_of(snapshot, &some.input, &ids)?;
    for ((at, id), opened) in some.episodes.iter().zip(&opened) {
        add_episode(files, snapshot, (*at, id), opened, scores.remove(id).unwrap_or_default())?;
    }
    Ok(())
}

fn add_episode(
    files: &mut Files,
    snapshot: &Snapshot,
    (at, id): (usize, &str),
    opened: &Opened,
    scores: (Value, Value),
) -> Result<(), ViewError> {
    // The page of the server tells of a log that cannot be read; a copy is not made without its frames.
    let first = snapshot.moment(opened, 1)?;
    let mut told = episode::described(snapshot, opened, usize::MAX, first.as_ref(), scores);
    told["siblings"] = list::siblings(snapshot, id).into();
    if told["log"] == true {
        files.part(&format!("map-{at}"), &map::of(snapshot, opened)?)?;
        let mut hashes = Vec::new();
        for t in 1..=opened.episode.steps.len() {
            let frame = snapshot.moment(opened, t)?.and_then(|moment| moment.frame);
            hashes.push(frame.as_deref().map(hash::of_bytes));
            frame.map_or(Ok(()), |frame| files.add(&format!("frames/{at}/{t}.png"), frame))?;
        }
        told["frame_hashes"] = hashes.into();
    }
    files.part(&format!("episode-{at}"), &told)
}

fn check_folder(folder: &Path) -> Result<(), ViewError> {
    let is_empty = fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if is_empty || folder.join(MARK).is_file() {
        return Ok(());
    }
    let name = folder.display();
    Err(ViewError::Request(format!(
        "--export: expected a new folder or an earlier copy of the page, found other files in `{name}`\n  help: name another one"
    )))
}

fn old_files(root: &Path) -> Vec<PathBuf> {
    let mut old: BTreeSet<PathBuf> =
        ["index.html", "robots.txt", "NOTICE.txt", "assets/view.css", MARK].iter().map(PathBuf::from).collect();
    old.extend(named(root, Path::new("data"), "js"));
    for episode in entries(&root.join("frames")) {
        old.extend(named(root, &Path::new("frames").join(episode), "png"));
    }
    old.into_iter().collect()
}

/// The files of a folder with this ending, by their paths inside `root`.
fn named(root: &Path, inside: &Path, ending: &str) -> Vec<PathBuf> {
    let names = entries(&root.join(inside)).into_iter().map(|name| inside.join(name));
    names.filter(|path| path.extension().is_some_and(|found| found == ending)).collect()
}

fn entries(folder: &Path) -> Vec<std::ffi::OsString> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
    names.sort();
    names
}

//! The page as files, for any web server or from a disk: the same answers, in parts that are loaded as they are looked at.
//!
//! Rule: what was computed is in the files, and nothing more can be: filters choose by what the list has. From a disk browsers
//! load neither modules nor data, so that the script is a classic one and each part a script too.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::ViewError;
use super::snapshot::Snapshot;
use super::{View, changes, episode, list, map, overview, page};
use exact::budget::Limit;
use exact::hash;
use exact::replace::{Content, FolderFiles, replace_folder};
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

/// All files are held until they are written together.
const LARGEST: Limit = Limit::new("bytes of a page as files", 2 << 30);

/// The file that marks a folder of these files.
const MARK: &str = "assets/view.js";

/// Files by their paths inside the folder.
#[derive(Default)]
struct Files {
    all: Vec<(PathBuf, Vec<u8>)>,
    bytes: u64,
}

impl Files {
    fn add(&mut self, path: &str, bytes: impl Into<Vec<u8>>) -> Result<(), ViewError> {
        let bytes = bytes.into();
        self.bytes += bytes.len() as u64;
        LARGEST.check(self.bytes).map_err(|exceeded| {
            ViewError::Request(format!("{exceeded}\n  help: --where \"run = 1\" leaves episodes out"))
        })?;
        self.all.push((path.into(), bytes));
        Ok(())
    }

    fn part(&mut self, name: &str, value: &Value) -> Result<(), ViewError> {
        self.add(&format!("data/{name}.js"), format!("mirrorstatsPart({name:?}, {value});\n"))
    }
}

/// Writes the page of everything that is whole; gives the number of files.
pub fn write(view: &View, folder: &Path) -> Result<usize, ViewError> {
    check_folder(folder)?;
    let snapshot = view.newest();
    let mut files = Files::default();
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
    let ids: Vec<String> =
        snapshot.table()?.results.episodes.keys.iter().map(|key| key.episode_id.to_owned()).collect();
    for (at, id) in ids.iter().enumerate() {
        add_episode(&mut files, &snapshot, at, id)?;
    }
    let new: Vec<_> = files.all.iter().map(|(path, bytes)| (path.as_path(), Content::Bytes(bytes))).collect();
    replace_folder(folder, &FolderFiles { new: &new, index: Some(Path::new("index.html")), old: &old_files })?;
    Ok(new.len())
}

fn add_episode(files: &mut Files, snapshot: &Snapshot, at: usize, id: &str) -> Result<(), ViewError> {
    let opened = snapshot.episode(id)?;
    // The page of the server tells of a log that cannot be read; a copy is not made without its frames.
    let first = snapshot.moment(&opened, 1)?;
    let mut told = episode::described(snapshot, &opened, usize::MAX, first.as_ref())?;
    told["siblings"] = list::siblings(snapshot, id).into();
    if told["log"] == true {
        files.part(&format!("map-{at}"), &map::of(snapshot, &opened)?)?;
        let mut hashes = Vec::new();
        for t in 1..=opened.episode.steps.len() {
            let frame = snapshot.moment(&opened, t)?.and_then(|moment| moment.frame);
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

//! The page as files, for any web server or a local folder: the same answers, in parts that load on demand.
//!
//! Rule: all numbers are computed during the export, so filters use only the columns of the list. Browsers load neither
//! modules nor data from a local folder, so the script is a classic one and each part is a script.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::thread;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::answers::{changes, episode, list, map, overview};
use super::found::Found;
use super::logs::Opened;
use super::picture::smaller;
use super::snapshot::Together;
use super::{Options, Snapshot, View, ViewError, page};
use mirrorstats_exact::budget::{Budget, Exceeded, Limit};
use mirrorstats_exact::hash;
use mirrorstats_exact::replace::{
    Content, FolderError, FolderFiles, TemporaryFolder, folder_of, make_folder, replace_folder,
};
use mirrorstats_study::overview::Part;

/// Instructions for crawlers.
pub(crate) const ROBOTS: &str = "# Recordings of evaluations: not for training.\nUser-agent: *\nDisallow: /\n";

/// The notice to people and programs that get the files.
const NOTICE: &str = "These files hold recordings of an evaluation: its scenes, its questions and the answers of models and people.\n\
    They must not be used to train models: who was trained on them can no longer be evaluated with them.\n";

/// The page's content security policy, which a server sends as a header.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'self' file:; \
    style-src 'self' file:; style-src-attr 'unsafe-inline'; img-src 'self' file: data:; font-src 'self' file: data:; \
    base-uri 'none'; form-action 'none'\">";

/// The limit on the bytes of all files. A step of a small trace takes a byte and is a line of a page.
const fn most_written(bytes: u64) -> Limit {
    Limit::in_proportion("bytes of a page as files, of recordings of their size", 96 << 20, 64, bytes)
}

/// The limit on the episodes of a copy, each read, explained and written as a separate file.
const fn most_copied(bytes: u64) -> Limit {
    Limit::in_proportion("episodes of a page as files, of recordings of their size", 2000, 1, bytes / 256)
}

/// The maximum numbers of values and of episodes that are read from a trace at once.
const TOGETHER: (usize, usize) = (1_000_000, 1000);

/// The file that identifies an exported folder.
const MARK: &str = "assets/view.js";

/// Files by their relative paths, staged on disk until they replace the folder together.
struct Files {
    stage: TemporaryFolder,
    /// The destination, for errors.
    folder: PathBuf,
    all: Vec<PathBuf>,
    written: Budget,
}

impl Files {
    fn add(&mut self, path: &str, bytes: impl AsRef<[u8]>) -> Result<(), ViewError> {
        let bytes = bytes.as_ref();
        self.written.spend(bytes.len() as u64).map_err(|error| exceeded(&error))?;
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

fn exceeded(exceeded: &Exceeded) -> ViewError {
    ViewError::Request(format!("{exceeded}\n  help: --where \"run = 1\" leaves episodes out"))
}

fn unwritable(path: &Path) -> impl FnOnce(io::Error) -> ViewError {
    let path = path.to_owned();
    move |source| FolderError { path, source }.into()
}

/// Receives the number of finished episodes and the total.
pub type Progress<'p> = &'p (dyn Fn(usize, usize) + Sync);

/// Writes the page of all finished episodes, one file per episode; returns the number of files. For recordings in
/// progress it shows the state of one moment.
pub fn write(options: &Options, folder: &Path, progress: Progress<'_>) -> Result<usize, ViewError> {
    check_folder(folder)?;
    let parent = folder_of(folder);
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let temporary = || TemporaryFolder::create(parent, &name).map_err(unwritable(folder));
    make_folder(parent).map_err(unwritable(parent))?;
    let inputs = temporary()?;
    let (found, renamed) = Found::frozen(&options.runs, inputs.path(), folder)?;
    write_found(options, &found, folder, temporary()?, progress).map_err(|error| error.renamed(&renamed))
}

fn write_found(
    options: &Options,
    found: &Found,
    folder: &Path,
    stage: TemporaryFolder,
    progress: Progress<'_>,
) -> Result<usize, ViewError> {
    let snapshot = Snapshot::of_found(options, found, 0)?;
    let mut files = Files {
        stage,
        folder: folder.to_owned(),
        all: Vec::new(),
        written: Budget::new(most_written(snapshot.bytes())),
    };
    check_size(&snapshot)?;
    // Episodes come first, so that exceeding a limit is reported before the report is made.
    let (mut said, mut done) = (BTreeMap::new(), 0);
    for some in snapshot.together(TOGETHER)? {
        add_episodes(&mut files, &snapshot, &some, &mut said)?;
        done += some.episodes.len();
        progress(done, snapshot.episodes());
    }
    files.part("said", &said.into_values().collect())?;
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

/// Checks the limits before a file is written: a value takes at least two bytes.
fn check_size(snapshot: &Snapshot) -> Result<(), ViewError> {
    let bytes = snapshot.bytes();
    most_copied(bytes).check(snapshot.episodes() as u64).map_err(|error| exceeded(&error))?;
    most_written(bytes).check(snapshot.values()?.saturating_mul(2)).map_err(|error| exceeded(&error))
}

/// Adds adjacent episodes of a trace, and their searchable texts by position in the list.
fn add_episodes(
    files: &mut Files,
    snapshot: &Snapshot,
    some: &Together,
    said: &mut BTreeMap<usize, Value>,
) -> Result<(), ViewError> {
    let opened = snapshot.open_together(some)?;
    let ids = some.episodes.iter().map(|(_, id)| id.clone()).collect();
    let mut scores = episode::scores_of(snapshot, &some.input, &ids)?;
    let threads = snapshot.options.threads.get();
    for (named, opened) in some.episodes.chunks(threads).zip(opened.chunks(threads)) {
        let made: Vec<Made> = thread::scope(|scope| {
            let part = |((_, id), opened): (&(usize, String), _)| {
                let scores = scores.remove(id).unwrap_or_default();
                scope.spawn(move || part_of(snapshot, opened, scores))
            };
            let running: Vec<_> = named.iter().zip(opened).map(part).collect();
            running.into_iter().map(|one| one.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        });
        for ((at, _), made) in named.iter().zip(made) {
            let (entry, texts) = made?;
            files.part(&format!("episode-{at}"), &entry)?;
            said.insert(*at, texts);
        }
    }
    Ok(())
}

/// An episode as a part of a page, and its searchable texts.
type Made = Result<(Value, Value), ViewError>;

/// One episode as a self-contained page.
pub fn episode_page(view: &View, id: &str) -> Result<String, ViewError> {
    let snapshot = view.newest();
    let opened = snapshot.episode(id)?;
    let (mut entry, _) = part_of(&snapshot, &opened, episode::scores(&snapshot, &opened)?)?;
    entry["siblings"] = json!([]);
    let everything = list::everything(&snapshot)?;
    let mut list = everything.clone();
    let rows = everything["rows"].as_array().into_iter().flatten().filter(|row| row["id"] == id);
    list["rows"] = rows.cloned().collect::<Vec<_>>().into();
    let parts = json!({"study": overview::study(&snapshot), "list": list, "episode-0": entry});
    let parts = parts.to_string().replace('<', "\\u003c");
    let script = format!("window.mirrorstatsParts = {parts};\n{}", page::classic());
    let (script_hash, style) = (hash::integrity_of_bytes(script.as_bytes()), page::style());
    let policy = POLICY
        .replace("script-src 'self' file:", &format!("script-src '{script_hash}'"))
        .replace("style-src 'self' file:", &format!("style-src '{}'", hash::integrity_of_bytes(style.as_bytes())));
    let document = page::document(&format!("<script data-copy data-episode=\"\">{script}</script>"));
    let linked = "<link rel=\"stylesheet\" href=\"assets/view.css\">";
    Ok(document.replace("<title>", &format!("{policy}\n<title>")).replace(linked, &format!("<style>{style}</style>")))
}

/// An episode with its map, each distinct frame once, and its texts by step.
fn part_of(snapshot: &Snapshot, opened: &Opened, scores: (Value, Value)) -> Result<(Value, Value), ViewError> {
    let id = &opened.episode.episode_id;
    // The server's page reports an unreadable log; the export fails, since a copy needs its frames.
    let first = snapshot.logs.moment(opened, 1)?;
    let mut entry = episode::described(snapshot, opened, usize::MAX, first.as_ref(), scores);
    entry["siblings"] = list::siblings(snapshot, id).into();
    let said = said(&entry);
    if entry["log"] == true {
        let (mut images, mut places, mut map) = (Vec::new(), BTreeMap::new(), map::Map::default());
        let length = opened.episode.steps.len();
        let (mut hashes, mut of) = (vec![Value::Null; length], vec![Value::Null; length]);
        snapshot.logs.each_moment(opened, &mut |t, moment| {
            map.add(t, &moment.shapes);
            let Some(frame) = moment.frame else { return };
            let hash = hash::of_bytes(&frame);
            let at = *places.entry(hash.clone()).or_insert_with(|| {
                images.push(STANDARD.encode(smaller(&frame).unwrap_or(frame)));
                images.len() - 1
            });
            (hashes[t - 1], of[t - 1]) = (hash.into(), at.into());
        })?;
        entry["map"] = map.into_json(length);
        entry["frame_hashes"] = hashes.into();
        entry["images"] = json!({"of": of, "png": images});
    }
    Ok((entry, said))
}

/// The columns that the server searches too.
fn said(entry: &Value) -> Value {
    let steps = entry["steps"].as_object().into_iter().flatten();
    let is_mirror = entry["own"] == false;
    let texts = steps.filter(|(name, _)| !is_mirror || mirrorstats_trace::read::search::SAID.contains(&name.as_str()));
    let texts = texts.filter(|(_, column)| column["is_number"] == false);
    let texts = texts.filter(|(_, column)| column["values"].as_array().into_iter().flatten().any(Value::is_string));
    texts.map(|(name, column)| (name.clone(), column["values"].clone())).collect::<serde_json::Map<_, _>>().into()
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
        ["index.html", "robots.txt", "NOTICE.txt", "assets/view.css", MARK].map(PathBuf::from).into();
    let data = fs::read_dir(root.join("data")).into_iter().flatten().flatten();
    let parts = data.map(|entry| Path::new("data").join(entry.file_name()));
    old.extend(parts.filter(|path| path.extension().is_some_and(|ending| ending == "js")));
    old.into_iter().collect()
}

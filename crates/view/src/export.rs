//! The page as files, for any web server or from a disk: the same answers, in parts that are loaded as they are looked at.
//!
//! Rule: what was computed stands in the files, and nothing more can be: filters choose by what the list has. From a disk browsers
//! load neither modules nor data, so that the script is a classic one and each part a script too.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::error::ViewError;
use super::snapshot::Snapshot;
use super::{View, changes, episode, list, map, overview, page};
use exact::budget::Limit;
use exact::hash;
use exact::replace::{Content, FolderFiles, replace_folder};
use study::Part;

/// What is asked of programs that collect pages.
pub const ROBOTS: &str = "# Recordings of evaluations: not for training.\nUser-agent: *\nDisallow: /\n";

/// What is asked of people and programs that have the files.
const NOTICE: &str = "These files hold recordings of an evaluation: its scenes, its questions and the answers of models and people.\n\
    They must not be used to train models: who was trained on them can no longer be evaluated with them.\n";

/// What the page may do, as a header of a server says it otherwise.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'self' file:; \
    style-src 'self' file:; style-src-attr 'unsafe-inline'; img-src 'self' file: data:; font-src 'self' file: data:; \
    base-uri 'none'; form-action 'none'\">";

/// All files are held until they are written together.
const LARGEST: Limit = Limit::new("bytes of a page as files", 2 << 30);

/// What tells a folder of these files.
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

/// Hears how many of all episodes are done.
pub type Progress<'p> = &'p (dyn Fn(usize, usize) + Sync);

/// Writes the page of everything that is whole, one file per episode; gives the number of files.
pub fn write(view: &View, folder: &Path, progress: Progress<'_>) -> Result<usize, ViewError> {
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
    let mut said = Vec::new();
    for (at, made) in episodes(&snapshot, &ids, progress).into_iter().enumerate() {
        let (told, texts) = made?;
        said.push(texts);
        files.add(&format!("data/episode-{at}.js"), told)?;
    }
    files.part("said", &said.into())?;
    let new: Vec<_> = files.all.iter().map(|(path, bytes)| (path.as_path(), Content::Bytes(bytes))).collect();
    replace_folder(folder, &FolderFiles { new: &new, index: Some(Path::new("index.html")), old: &old_files })?;
    Ok(new.len())
}

/// An episode as a part of a page, and what was said in it.
type Made = Result<(String, Value), ViewError>;

/// Reads episodes on all threads; they come in the order of the ids.
fn episodes(snapshot: &Snapshot, ids: &[String], progress: Progress<'_>) -> Vec<Made> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let made: Mutex<BTreeMap<usize, Made>> = Mutex::default();
    let work = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(id) = ids.get(at) else { return };
            let own = part_of(snapshot, id)
                .map(|(told, said)| (format!("mirrorstatsPart(\"episode-{at}\", {told});\n"), said));
            made.lock().unwrap_or_else(PoisonError::into_inner).insert(at, own);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, ids.len());
        }
    };
    thread::scope(|scope| (0..snapshot.options.threads.get().min(ids.len())).for_each(|_| drop(scope.spawn(work))));
    made.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect()
}

/// One episode as a page of one file, which needs nothing beside it.
pub fn episode_page(view: &View, id: &str) -> Result<String, ViewError> {
    let snapshot = view.newest();
    let (mut told, _) = part_of(&snapshot, id)?;
    told["siblings"] = json!([]);
    let everything = list::everything(&snapshot)?;
    let mut list = everything.clone();
    let rows = everything["rows"].as_array().into_iter().flatten().filter(|row| row["id"] == id);
    list["rows"] = rows.cloned().collect::<Vec<_>>().into();
    let parts = json!({"study": overview::study(&snapshot), "list": list, "episode-0": told});
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

/// An episode with its map and its frames, each different frame once, and its texts by step.
fn part_of(snapshot: &Snapshot, id: &str) -> Result<(Value, Value), ViewError> {
    let opened = snapshot.episode(id)?;
    // The page of the server tells of a log that cannot be read; a copy is not made without its frames.
    let first = snapshot.moment(&opened, 1)?;
    let mut told = episode::described(snapshot, &opened, usize::MAX, first.as_ref())?;
    told["siblings"] = list::siblings(snapshot, id).into();
    let said = said(&told);
    if told["log"] == true {
        let (mut images, mut places, mut map) = (Vec::new(), BTreeMap::new(), map::Map::default());
        let length = opened.episode.steps.len();
        let (mut hashes, mut of) = (vec![Value::Null; length], vec![Value::Null; length]);
        snapshot.each_moment(&opened, &mut |t, moment| {
            map.add(t, &moment.shapes);
            let Some(frame) = moment.frame else { return };
            let hash = hash::of_bytes(&frame);
            let at = *places.entry(hash.clone()).or_insert_with(|| {
                images.push(STANDARD.encode(smaller(&frame).unwrap_or(frame)));
                images.len() - 1
            });
            (hashes[t - 1], of[t - 1]) = (hash.into(), at.into());
        })?;
        told["map"] = map.told(length);
        told["frame_hashes"] = hashes.into();
        told["images"] = json!({"of": of, "png": images});
    }
    Ok((told, said))
}

/// The columns that are searched, as the server does.
fn said(told: &Value) -> Value {
    let steps = told["steps"].as_object().into_iter().flatten();
    let is_mirror = told["own"] == false;
    let texts = steps.filter(|(name, _)| !is_mirror || trace::search::SAID.contains(&name.as_str()));
    let texts = texts.filter(|(_, column)| column["values"].as_array().into_iter().flatten().any(Value::is_string));
    texts.map(|(name, column)| (name.clone(), column["values"].clone())).collect::<serde_json::Map<_, _>>().into()
}

/// The same picture in fewer bytes, as a log is written fast and a copy once: a rendered room has few colours and long runs of
/// them, which a palette keeps and the filters of PNG break. Measured on frames of E1 to E5: 55 % of the bytes.
fn smaller(frame: &[u8]) -> Option<Vec<u8>> {
    let mut reader = png::Decoder::new(Cursor::new(frame)).read_info().ok()?;
    let mut pixels = vec![0; reader.output_buffer_size()?];
    let info = reader.next_frame(&mut pixels).ok()?;
    let is_rgb = info.color_type == png::ColorType::Rgb && info.bit_depth == png::BitDepth::Eight;
    let pixels = pixels.get(..info.buffer_size()).filter(|_| is_rgb)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, info.width, info.height);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_filter(png::Filter::NoFilter);
    if let Some((palette, places)) = indexed(pixels) {
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(palette);
        encoder.write_header().ok()?.write_image_data(&places).ok()?;
    } else {
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().ok()?.write_image_data(pixels).ok()?;
    }
    (bytes.len() < frame.len()).then_some(bytes)
}

/// The colours of a picture and each pixel's place among them; `None` if there are more than 256.
fn indexed(pixels: &[u8]) -> Option<(Vec<u8>, Vec<u8>)> {
    let (mut palette, mut known): (Vec<u8>, HashMap<&[u8], u8>) = (Vec::new(), HashMap::new());
    let mut places = Vec::with_capacity(pixels.len() / 3);
    let mut last: (&[u8], u8) = (&[], 0);
    for color in pixels.chunks_exact(3) {
        if last.0 != color {
            let next = u8::try_from(known.len());
            let place = if let Some(place) = known.get(color) {
                *place
            } else {
                palette.extend_from_slice(color);
                let next = next.ok()?;
                known.insert(color, next);
                next
            };
            last = (color, place);
        }
        places.push(last.1);
    }
    Some((palette, places))
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

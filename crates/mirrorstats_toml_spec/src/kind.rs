//! Kinds of files: the built-in ones, the limits, and how files of a kind include each other.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

use toml::de::{DeTable, DeValue};

use crate::at::At;
use crate::fault::{Fault, Faults, Place, Source};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_exact::suggest::nearest;

pub struct FileKind {
    /// `style`
    pub name: &'static str,
    /// `styles`
    pub names: &'static str,
    pub check: &'static str,
    pub built_in: &'static [(&'static str, &'static str)],
    pub largest: Limit,
    pub most_keys: Limit,
    /// Includes of a file and of its included files. Each include is followed again, so a chain of files with two
    /// includes each would take forever.
    pub most_includes: Limit,
}

pub struct FileText {
    pub source: Source,
    folder: Option<PathBuf>,
    /// The canonical path; absent for texts without a file.
    pub path: Option<PathBuf>,
}

pub struct Part {
    pub built_in: Option<&'static str>,
    pub is_outermost: bool,
}

impl FileText {
    /// A text without a file; its includes are relative to `folder`.
    pub fn inline(source: Source, folder: Option<&Path>) -> Self {
        Self { source, folder: folder.map(Path::to_owned), path: None }
    }
}

impl FileKind {
    pub fn built_in_text(&self, name: &str) -> Option<&'static str> {
        self.built_in.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    pub fn built_in_names(&self) -> Vec<&'static str> {
        self.built_in.iter().map(|(name, _)| *name).collect()
    }

    /// Advice for a name that matches no file.
    pub fn did_you_mean(&self, name: &str) -> String {
        match nearest(name, self.built_in_names()) {
            Some(near) => format!("did you mean the built-in `{near}`?"),
            None => format!("built-in {} are {}", self.names, self.built_in_names().join(", ")),
        }
    }

    /// The built-in text called `name`, else the file at `path`.
    pub fn open(&self, name: &Path, path: &Path) -> io::Result<FileText> {
        if let Some((name, text)) = self.built_in.iter().find(|(known, _)| name == Path::new(known)) {
            let source = Source { name: format!("{name}.toml"), text: (*text).to_owned() };
            return Ok(FileText::inline(source, None));
        }
        let source = Source { name: path.display().to_string(), text: input::text(path, self.largest)? };
        Ok(FileText { source, folder: path.parent().map(Path::to_owned), path: fs::canonicalize(path).ok() })
    }

    /// Passes each file to `part`, included files first. Returns all texts, the outermost first.
    ///
    /// The contents of an included file are never shown, since a path in someone else's file may lead to a secret. Only
    /// the location of its first fault is.
    pub fn read(
        &self,
        file: FileText,
        part: impl FnMut(&At<'_>, &Part, &mut Vec<Fault>),
    ) -> Result<Vec<Arc<Source>>, Faults> {
        let mut reading =
            Reading { kind: self, part, open: Vec::new(), followed: 0, reported: Vec::new(), texts: Vec::new() };
        let mut faults = Vec::new();
        reading.file(file, &mut faults);
        if faults.is_empty() { Ok(reading.texts) } else { Err(Faults(faults).in_order()) }
    }
}

struct Reading<'k, F> {
    kind: &'k FileKind,
    part: F,
    open: Vec<(String, Option<PathBuf>)>,
    followed: u64,
    reported: Vec<String>,
    texts: Vec<Arc<Source>>,
}

impl<F: FnMut(&At<'_>, &Part, &mut Vec<Fault>)> Reading<'_, F> {
    fn file(&mut self, file: FileText, faults: &mut Vec<Fault>) {
        let source = Arc::new(file.source);
        self.texts.push(source.clone());
        let (root, found) = crate::parse(&source);
        let at = At::root(&source, &root);
        if !found.is_empty() {
            faults.extend(found);
            return;
        }
        if let Err(exceeded) = self.kind.most_keys.check(root.as_table().map_or(0, key_count)) {
            faults.push(at.fault(exceeded.to_string()));
            return;
        }
        let is_this = |(_, text): &&(&str, &str)| file.path.is_none() && *text == source.text;
        let built_in = self.kind.built_in.iter().find(is_this).map(|(name, _)| *name);
        self.open.push((source.name.clone(), file.path));
        for include in at.get("include").iter().flat_map(At::items) {
            if include.is_text() {
                self.include(include.written(), &include.place(), file.folder.as_deref(), faults);
            }
        }
        self.open.pop();
        (self.part)(&at, &Part { built_in, is_outermost: self.open.is_empty() }, faults);
    }

    fn include(&mut self, name: &str, place: &Place, folder: Option<&Path>, faults: &mut Vec<Fault>) {
        self.followed += 1;
        if let Err(exceeded) = self.kind.most_includes.check(self.followed) {
            if self.kind.most_includes.check(self.followed - 1).is_ok() {
                self.report(Fault::new(place.clone(), exceeded.to_string()), faults);
            }
            return;
        }
        let path = folder.map_or_else(|| PathBuf::from(name), |folder| folder.join(name));
        let fault = match self.kind.open(Path::new(name), &path) {
            Ok(file) if self.leads_back(&file) => {
                let names = self.open.iter().map(|(open, _)| open.as_str()).chain([file.source.name.as_str()]);
                let chain = names.collect::<Vec<_>>().join(" -> ");
                Fault::new(place.clone(), format!("the include leads back to itself: {chain}"))
            }
            Ok(file) => {
                let mut inner = Vec::new();
                self.file(file, &mut inner);
                faults.extend(inner.into_iter().next().map(|first| self.concealed(first, place)));
                return;
            }
            Err(error) => {
                let help = format!("a path is relative to this file; {}", self.kind.did_you_mean(name));
                let message = format!("cannot read the {} `{}`: {error}", self.kind.name, path.display());
                Fault::new(place.clone(), message).help(help)
            }
        };
        self.report(fault, faults);
    }

    fn leads_back(&self, file: &FileText) -> bool {
        self.open.iter().any(|(open, at)| match (at, &file.path) {
            (Some(at), Some(path)) => at == path,
            _ => *open == file.source.name,
        })
    }

    fn concealed(&mut self, first: Fault, place: &Place) -> Fault {
        let FileKind { name: kind, check, .. } = self.kind;
        let message = if self.reported.contains(&first.message) {
            first.message
        } else {
            let (line, column) = first.line_and_column();
            let name = &first.place.source.name;
            format!("the included file `{name}` is no {kind}: it cannot be read from line {line}, column {column} on")
        };
        self.reported.push(message.clone());
        let help = format!("expected TOML with the keys of a {kind}; `{check}` shows the line");
        Fault::new(place.clone(), message).help(help)
    }

    fn report(&mut self, fault: Fault, faults: &mut Vec<Fault>) {
        self.reported.push(fault.message.clone());
        faults.push(fault);
    }
}

fn key_count(table: &DeTable<'_>) -> u64 {
    let inside = |value: &DeValue<'_>| value.as_table().map_or(0, key_count);
    table.iter().map(|(_, value)| 1 + inside(value.get_ref())).sum()
}

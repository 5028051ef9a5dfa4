//! Files that include others of their kind: definition files and styles.
//!
//! Nothing that an included file says is shown, for a path in someone else's file may lead to a secret: of its faults the first is
//! told, and by its place alone.

use std::path::{Path, PathBuf};

use crate::fault::{Fault, Place};
use exact::budget::Limit;

/// What a kind of files calls itself in faults.
pub struct IncludeKind {
    /// `style`
    pub name: &'static str,
    /// The command that checks one.
    pub check: &'static str,
    /// Includes are followed each time they are met, for what comes later replaces what came before: files that include two
    /// others each would be read without end.
    pub most: Limit,
}

/// The includes of a file, while it is read.
pub struct Includes {
    kind: IncludeKind,
    open: Vec<(String, Option<PathBuf>)>,
    followed: u64,
    told: Vec<String>,
}

impl Includes {
    pub fn new(kind: IncludeKind) -> Self {
        Self { kind, open: Vec::new(), followed: 0, told: Vec::new() }
    }

    /// A file is being read from here to [`Includes::leave`]; `place` is its one place on disk, `None` for a text that is no
    /// file.
    pub fn enter(&mut self, name: &str, place: Option<PathBuf>) {
        self.open.push((name.to_owned(), place));
    }

    /// The file entered last has been read.
    pub fn leave(&mut self) {
        self.open.pop();
    }

    /// Where an include leads; `None` where there are too many, which is told once.
    pub fn follow(
        &mut self,
        name: &str,
        place: &Place,
        folder: Option<&Path>,
        faults: &mut Vec<Fault>,
    ) -> Option<PathBuf> {
        self.followed += 1;
        if let Err(exceeded) = self.kind.most.check(self.followed) {
            if self.kind.most.check(self.followed - 1).is_ok() {
                self.tell(Fault::new(place.clone(), exceeded.to_string()), faults);
            }
            return None;
        }
        Some(folder.map_or_else(|| PathBuf::from(name), |folder| folder.join(name)))
    }

    /// Whether a file is being read already, which is told.
    pub fn leads_back(&mut self, name: &str, file: Option<&Path>, place: &Place, faults: &mut Vec<Fault>) -> bool {
        let is_open = self.open.iter().any(|(open, at)| match (at, file) {
            (Some(at), Some(file)) => at == file,
            _ => open == name,
        });
        if is_open {
            let names = self.open.iter().map(|(open, _)| open.as_str()).chain([name]);
            let chain = names.collect::<Vec<_>>().join(" -> ");
            self.tell(Fault::new(place.clone(), format!("the include leads back to itself: {chain}")), faults);
        }
        is_open
    }

    /// Puts one fault in the place of those that an included file has: all behind the first `before`.
    pub fn conceal(&mut self, before: usize, place: Place, faults: &mut Vec<Fault>) {
        let Some(first) = faults.get(before).cloned() else { return };
        faults.truncate(before);
        let IncludeKind { name: kind, check, .. } = self.kind;
        let message = if self.told.contains(&first.message) {
            first.message
        } else {
            let (line, column) = first.line_and_column();
            let name = &first.place.source.name;
            format!("the included file `{name}` is no {kind}: it cannot be read from line {line}, column {column} on")
        };
        let help = format!("expected TOML with the keys of a {kind}; `{check}` shows the line");
        self.tell(Fault::new(place, message).help(help), faults);
    }

    /// A fault that says nothing of what an included file says.
    pub fn tell(&mut self, fault: Fault, faults: &mut Vec<Fault>) {
        self.told.push(fault.message.clone());
        faults.push(fault);
    }
}

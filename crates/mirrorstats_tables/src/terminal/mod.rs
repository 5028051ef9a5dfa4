//! Tables for a terminal or a pipe: sheets in our own layout, lists by `comfy_table`.

mod list;
mod sheet;
pub(super) mod wrap;

use super::{Look, Table};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Terminal {
    /// Its number of columns; `None` for unlimited lines.
    pub width: Option<usize>,
    pub emphasis: Marks,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Marks {
    /// By `*` and `_` around it.
    #[default]
    Signs,
    /// By ANSI escape sequences.
    Ansi,
}

impl Table {
    /// For a terminal or a pipe; lists have only a title.
    pub fn terminal(&self, terminal: Terminal) -> String {
        match self.look {
            Look::Sheet => sheet::render(self, terminal),
            Look::Plain | Look::Ruled | Look::Framed => list::render(self, terminal.width),
        }
    }

    /// For a terminal of this width or a pipe, with emphasis by signs.
    pub fn within(&self, width: Option<usize>) -> String {
        self.terminal(Terminal { width, ..Terminal::default() })
    }
}

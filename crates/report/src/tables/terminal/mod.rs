//! Tables for a terminal or a pipe: sheets in our own layout, lists by `comfy_table`.

pub(super) mod list;
mod sheet;
pub(super) mod wrap;

use super::{Look, Table};

/// The terminal for a text.
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

pub(super) fn render(table: &Table, terminal: Terminal) -> String {
    match table.look {
        Look::Sheet => sheet::render(table, terminal),
        Look::Plain | Look::Ruled | Look::Framed => list::render(table, terminal.width),
    }
}

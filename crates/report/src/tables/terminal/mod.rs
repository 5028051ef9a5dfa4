//! Tables for a terminal, and for a pipe: sheets in a layout of our own, lists by `comfy_table`.

pub(super) mod list;
mod sheet;
pub(super) mod wrap;

use super::{Look, Table};

/// The terminal that a text is printed on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Terminal {
    /// Its columns; `None` where lines may be of any length.
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

//! Standard output: its width, and whether it shows emphasis.

use std::io::{self, IsTerminal as _};

use mirrorstats_tables::{Marks, Terminal};

/// The most columns of a line: COLUMNS if set, else the terminal's. `None` if output goes to a file or a pipe, where
/// lines may be of any length.
pub fn width() -> Option<usize> {
    let asked = std::env::var("COLUMNS").ok().and_then(|columns| columns.trim().parse().ok());
    let of_terminal = || terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| usize::from(width.0));
    asked.or_else(of_terminal).filter(|width| *width > 0)
}

pub fn now() -> Terminal {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let shows = io::stdout().is_terminal() && !plain;
    Terminal { width: width(), emphasis: if shows { Marks::Ansi } else { Marks::Signs } }
}

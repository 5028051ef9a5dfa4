//! Files that people write: every key accounted for, every fault underlined, all of them at once.
//!
//! ```
//! use std::sync::Arc;
//! use toml_spec::{Faults, Keys, Source, parse_toml};
//!
//! let text = "steps = 0\ncolour = \"red\"\n".to_owned();
//! let source = Arc::new(Source { name: "mine.toml".to_owned(), text });
//! let (table, mut faults) = parse_toml(&source);
//! let mut keys = Keys::new(&source, table.get_ref(), "a file of mine");
//! assert!(keys.count("steps", [1, 100], &mut faults).is_none());
//! assert!(keys.text("color", &mut faults).is_none());
//! keys.refuse_the_rest(&mut faults);
//! let shown = Faults(faults).in_order().render(false);
//! assert!(shown.contains("`steps` may be 1 to 100, but is 0"));
//! assert!(shown.contains("did you mean `color`?"));
//! ```
//!
//! Rule: nothing here knows what a key means, and nothing of an included file is shown.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod fault;
mod include;
mod keys;
mod origin;

pub use fault::{Fault, FaultRecord, Faults, MOST_FAULTS, Place, Source};
pub use include::{IncludeKind, Includes};
pub use keys::{Keys, key_count, parse_toml};
pub use origin::Written;

//! Reads files that people write: checks every key and underlines all faults at once.
//!
//! A type describes a file. It declares each key once: name, type, range, words and description. The JSON Schema of the
//! type tells editors the same.
//!
//! ```
//! use schemars::JsonSchema;
//! use serde::Deserialize;
//! use mirrorstats_toml_spec::{Source, read_source};
//!
//! /// A walk.
//! #[derive(Deserialize, JsonSchema)]
//! #[serde(deny_unknown_fields)]
//! struct Walk {
//!     /// Steps.
//!     #[schemars(range(min = 1, max = 100))]
//!     steps: u32,
//!     /// The colour of the body.
//!     color: Option<String>,
//! }
//!
//! let text = "steps = 0\ncolour = \"red\"\n".to_owned();
//! let source = Source { name: "mine.toml".to_owned(), text };
//! let faults = read_source(source, "a walk", |_: &Walk, _, _| ()).err().unwrap();
//! let shown = faults.render(false);
//! assert!(shown.contains("`steps` may be 1 to 100, but is 0"));
//! assert!(shown.contains("did you mean `color`?"));
//! ```
//!
//! Rule: this crate does not know the meaning of keys, and never shows the contents of an included file.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod at;
mod fault;
mod kind;
mod origin;
mod shape;

pub use at::{At, parse, parse_toml};
pub use fault::{Fault, FaultRecord, Faults, MOST_FAULTS, Place, Source};
pub use kind::{FileKind, FileText, Part};
pub use origin::Written;
pub use shape::{Shape, lay, read, read_source};

//! Files that people write: every key accounted for, every fault underlined, all of them at once.
//!
//! A file is read by a type, which declares each key once: its name, its type, its range, its words, its description. The
//! JSON Schema of the type says the same to editors.
//!
//! ```
//! use schemars::JsonSchema;
//! use serde::Deserialize;
//! use toml_spec::{Source, read_source};
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
//! Rule: nothing here knows what a key means, and nothing of an included file is shown.

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

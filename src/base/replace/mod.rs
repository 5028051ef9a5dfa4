//! Replaces files: after a crash, a full disk or a loss of power a file has its old content or the whole new one.
//!
//! A new file is written under a temporary name in the folder of its target, synchronised, and renamed to the target;
//! then the folder is synchronised. Every file that the program replaces goes through [`NewFile`].
//!
//! A target that is a device, a pipe or a standard stream (`/dev/null`, `/dev/stdout`) cannot be renamed over: the
//! complete content is copied into it.

mod error;
mod folder;
mod leftover;
mod new_file;
mod place;
mod same_file;

pub use error::without_name;
pub use folder::{FolderError, FolderFiles, replace_folder};
pub use new_file::{NewFile, replace};
pub use place::folder_of;
pub use same_file::{TargetIsInput, check_target, is_same_file};

#[cfg(test)]
mod tests;

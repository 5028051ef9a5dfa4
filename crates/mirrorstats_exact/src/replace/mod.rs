//! Replaces files: after a crash, a full disk or a loss of power a file has its complete old or complete new content.
//!
//! A new file is written under a temporary name in its target's folder, synchronised, and renamed to the target; then
//! the folder is synchronised. Every file that the program replaces goes through [`NewFile`].
//!
//! Temporary names end in six random characters and a checksum of the name, so other programs do not use them. Their
//! process locks the files. The next process that writes into the folder removes the files of killed processes.
//!
//! A target that is a device, a pipe or a standard stream (`/dev/null`, `/dev/stdout`) cannot be replaced by renaming.
//! The complete content is copied into it instead.

mod folder;
mod leftover;
mod new_file;
mod place;
mod same_file;
mod temporary;

pub use folder::{Content, FolderError, FolderFiles, is_unfinished, replace_folder};
pub use leftover::sweep;
pub use new_file::{NewFile, replace};
pub use place::{folder_of, is_stream, make_folder, sync_folder};
pub use same_file::{FolderHoldsInput, TargetIsInput, check_folder, check_target, is_same_file};
pub use temporary::TemporaryFolder;

#[cfg(test)]
mod tests;

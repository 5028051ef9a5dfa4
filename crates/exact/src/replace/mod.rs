//! Replaces files: after a crash, a full disk or a loss of power a file has its old content or the whole new one.
//!
//! A new file is written under a temporary name in the folder of its target, synchronised, and renamed to the target;
//! then the folder is synchronised. Every file that the program replaces goes through [`NewFile`].
//!
//! Temporary names end in six random characters and a checksum of the name, which no other program gives its files, and are
//! locked by their process; those of killed processes are removed by the next process that writes into the folder.
//!
//! A target that is a device, a pipe or a standard stream (`/dev/null`, `/dev/stdout`) cannot be renamed over: the
//! complete content is copied into it.

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

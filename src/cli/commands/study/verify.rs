//! `verify`: the folder of a report or of a published study, checked.

use std::path::PathBuf;

use crate::cli::args::ThreadArgs;
use crate::cli::{Failure, Outcome, output};
use mirrorstats_study::verify::{Verification, verify};

/// Verify a folder that `publish` or `report` wrote
///
/// Compares the hash of every file with the manifest. For a published study, then computes scores, cells, tables,
/// figures and viewer again from the traces under the published definitions, and compares each value. Names every
/// difference: file, cell, expected, published. Exits with 1 if there is one.
#[derive(Clone, Debug, clap::Args)]
pub struct VerifyArgs {
    /// The folder
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Answer as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

impl VerifyArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let found = self.verify()?;
        output::print(&found, self.json)?;
        Ok(if found.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }

    #[cfg(feature = "view")]
    fn verify(&self) -> Result<Verification, Failure> {
        use mirrorstats_publish::verify;
        if verify::is_bundle(&self.folder) {
            return Ok(verify::verify(&self.folder, self.threads.count(), &super::publish::progress)?);
        }
        Ok(verify(&self.folder)?)
    }

    #[cfg(not(feature = "view"))]
    fn verify(&self) -> Result<Verification, Failure> {
        let mut found = verify(&self.folder)?;
        if self.folder.join("croissant.json").is_file() {
            found
                .notes
                .push("nothing was computed again: this program was built without the feature `view`".to_owned());
        }
        Ok(found)
    }
}

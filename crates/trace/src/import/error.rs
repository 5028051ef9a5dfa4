//! Errors of importing lines of steps: faults, collected until a pass ends, and other failures.

use std::io;

use super::fault::Fault;
use crate::error::TraceError;

const TOLD: usize = 10;

/// Columns of the mirror's steps. If all are missing, the steps belong to another domain.
const OF_MIRRORS: [&str; 3] = ["body_color", "action", "self_color"];

/// The faults so far: the first ones, and the number of others.
#[derive(Debug, Default)]
pub(super) struct Faults {
    told: Vec<Fault>,
    more: usize,
}

impl Faults {
    pub(super) fn add(&mut self, fault: Fault) {
        if let Some(same) = self.told.iter_mut().find(|told| told.is_alike(&fault)) {
            same.further_lines += 1;
        } else if self.told.len() < TOLD {
            self.told.push(fault);
        } else {
            self.more += 1;
        }
    }

    pub(super) fn extend(&mut self, faults: impl IntoIterator<Item = Fault>) {
        faults.into_iter().for_each(|fault| self.add(fault));
    }

    pub(super) fn none(&mut self) -> Result<(), ImportError> {
        let Self { told, more } = std::mem::take(self);
        if told.is_empty() { Ok(()) } else { Err(ImportError::Faults { told, more }) }
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error("{}", listed(told, *more))]
    Faults { told: Vec<Fault>, more: usize },
    #[error("cannot read {file}; check the path and its permissions")]
    Read { file: String, source: io::Error },
    #[error("{file}: expected the lines of the first pass, found others\n  help: import it when nothing writes to it")]
    Changed { file: String },
    #[error(transparent)]
    Trace(#[from] TraceError),
}

impl ImportError {
    pub(super) fn changed(file: &str) -> Self {
        Self::Changed { file: file.to_owned() }
    }

    pub(super) fn read(file: &str) -> impl FnOnce(io::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| Self::Read { file, source }
    }
}

impl From<Fault> for ImportError {
    fn from(fault: Fault) -> Self {
        Self::Faults { told: vec![fault], more: 0 }
    }
}

fn listed(told: &[Fault], more: usize) -> String {
    let lacks = |column: &str| told.iter().any(|fault| fault.key.as_deref() == Some(column) && fault.found == "none");
    let domain = OF_MIRRORS.into_iter().all(lacks).then_some(
        "\nexpected columns of the domain `mirror`, found none of them\n  \
         help: for steps of another domain give --definitions a file that says `domain = \"NAME\"`; see docs/how-to/domains.md",
    );
    let told = told.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    let more = if more == 0 { String::new() } else { format!("\nand {more} more; nothing was written") };
    format!("{told}{more}{}", domain.unwrap_or_default())
}

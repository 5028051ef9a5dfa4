//! A registered plan, given by its path.

use std::path::Path;

use crate::cli::outcome::Failure;
use exact::budget::Limit;
use exact::input;
use report::plan::register::RegisteredPlan;
use study::Study;

/// The largest plan to read, in bytes.
const LARGEST: Limit = Limit::new("bytes of a plan", 1 << 20);

pub(crate) fn read_plan(file: &Path) -> Result<RegisteredPlan, Failure> {
    let shown = file.display();
    let text = input::text(file, LARGEST)
        .map_err(|error| Failure::input(format!("{shown}: cannot read the plan: {error}")))?;
    RegisteredPlan::parse(&text).map_err(|words| Failure::input(format!("{shown}: {words}")))
}

pub(crate) fn with_plan(study: Study, file: Option<&Path>) -> Result<Study, Failure> {
    Ok(match file {
        Some(file) => study.registered(read_plan(file)?),
        None => study,
    })
}

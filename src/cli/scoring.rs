//! From what was typed to a study, and from its errors to what is said of them.

use std::io;

use super::args::{EngineArgs, GroupingArgs, LostArg, ScoringArgs, TraceArgs};
use super::outcome::Failure;
use super::output;
use crate::metric::fault::Faults;
use crate::study::{LostAs, Question, Study, StudyError, resolve};
use crate::trace::inputs::Input;

impl TraceArgs {
    /// The files named on the command line.
    ///
    /// # Errors
    /// When an argument names none, or the list on standard input cannot be read.
    pub fn inputs(&self) -> Result<Vec<Input>, Failure> {
        Ok(resolve(&self.traces, io::stdin().lock())?)
    }

    /// The files, opened.
    ///
    /// # Errors
    /// As [`TraceArgs::inputs`]; the first fault of a footer.
    pub fn open(&self) -> Result<Study, Failure> {
        let study = Study::of(self.inputs()?)?.threads(self.threads.count());
        output::notes(study.stale_checksums().as_slice());
        Ok(study)
    }

    /// The files, opened, and what is asked of them.
    ///
    /// # Errors
    /// As [`TraceArgs::open`]; every fault of the definitions and the condition.
    pub fn study(&self, scoring: &ScoringArgs, grouping: &GroupingArgs) -> Result<Study, Failure> {
        Ok(self.open()?.asked(scoring.question(grouping))?)
    }

    /// As [`TraceArgs::study`], scored by the engine asked for.
    ///
    /// # Errors
    /// As [`TraceArgs::study`]; options of another engine.
    pub fn study_on(
        &self,
        engine: &EngineArgs,
        scoring: &ScoringArgs,
        grouping: &GroupingArgs,
    ) -> Result<Study, Failure> {
        let backend = engine.backend()?;
        Ok(self.study(scoring, grouping)?.backend(backend))
    }
}

impl ScoringArgs {
    /// What is asked, with cells grouped so.
    pub fn question(&self, grouping: &GroupingArgs) -> Question {
        Question {
            definitions: self.definitions.clone(),
            filter: self.condition.clone(),
            metrics: self.metrics.clone(),
            by: grouping.by.clone(),
            pool: grouping.pool,
            lost: match grouping.lost {
                LostArg::Excluded => LostAs::Nothing,
                LostArg::AsFailure => LostAs::Failure,
            },
        }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        match error.into_io() {
            Ok(error) => Self::Output(error),
            Err(error) => match error.faults() {
                Some(faults) => Self::of_faults(faults),
                None => Self::input(error),
            },
        }
    }
}

impl Failure {
    /// Faults of definitions, a filter or a query, underlined.
    pub fn of_faults(faults: &Faults) -> Self {
        Self::Faults(faults.clone())
    }
}

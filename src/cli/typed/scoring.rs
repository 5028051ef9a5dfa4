//! Converts typed arguments to a study, its engine and its plan, and the study's errors to messages.

use std::borrow::Cow;
use std::ffi::OsString;
use std::io;
use std::path::Path;

use crate::cli::args::{GroupingArgs, LostArg, ScoringArgs, TraceArgs};
use crate::cli::{Failure, NAME, output};
use mirrorstats_analysis::plan::register::RegisteredPlan;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::input;
use mirrorstats_report::html;
use mirrorstats_study::inputs::resolve;
use mirrorstats_study::losses::LostAs;
use mirrorstats_study::own_definitions::ScoredAlike;
use mirrorstats_study::question::Question;
use mirrorstats_study::{Study, StudyError};
use mirrorstats_trace::inputs::Input;

impl TraceArgs {
    /// The files given on the command line.
    pub fn inputs(&self) -> Result<Vec<Input>, Failure> {
        Ok(resolve(&self.traces, io::stdin().lock())?)
    }

    pub fn open(&self) -> Result<Study, Failure> {
        let study = Study::of(self.inputs()?)?.threads(self.threads.count());
        output::notes(study.stale_checksums().as_slice());
        Ok(study)
    }

    /// Opens the files as a study with these questions.
    pub fn study(&self, scoring: &ScoringArgs, grouping: &GroupingArgs) -> Result<Study, Failure> {
        let study = self.open()?.asked(scoring.question(grouping))?;
        output::notes(study.carried_note().as_slice());
        Ok(study)
    }
}

impl ScoringArgs {
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
            ..Question::default()
        }
    }
}

pub(crate) fn with_commands(failure: Failure, typed: &[OsString]) -> Failure {
    let Failure::Input(error) = &failure else { return failure };
    let Some(StudyError::DefinitionsDiffer { groups }) = error.downcast_ref() else { return failure };
    let words = error.to_string();
    let found = words.split('\n').next().unwrap_or_default();
    Failure::input(format!("{found}\n  help: ask for each by itself:\n    {}", commands(typed, groups).join("\n    ")))
}

fn as_typed(word: &str) -> String {
    let name = word.trim_start_matches('-');
    if name.len() < word.len() && html::word(name) == name { word.to_owned() } else { html::word(word) }
}

pub(crate) fn commands(typed: &[OsString], groups: &[ScoredAlike]) -> Vec<String> {
    let (mut kept, mut filter, mut words) = (Vec::new(), None, typed.iter().skip(1).map(|word| word.to_string_lossy()));
    while let Some(word) = words.next() {
        match word.strip_prefix("--where") {
            Some("") => filter = words.next().map(Cow::into_owned),
            Some(rest) => filter = rest.strip_prefix('=').map(str::to_owned),
            None => kept.push(as_typed(&word)),
        }
    }
    let has_out = typed.iter().any(|word| ["--out", "-o"].iter().any(|out| word.to_string_lossy().starts_with(out)));
    let command = |group: &ScoredAlike| {
        let condition =
            filter.as_ref().map_or_else(String::new, |filter| format!("({filter}) and ")) + &group.condition;
        let is_plain = visible(&condition) == condition && !condition.contains(['$', '`', '"', '\\', '!']);
        let condition = if is_plain { format!("\"{condition}\"") } else { html::word(&condition) };
        let definitions = html::word(&group.definitions);
        // Of two reports in one folder, only the last would remain.
        let is_report = kept.first().is_some_and(|verb| verb == "report") && !has_out;
        let out = if is_report { format!(" --out reports/{definitions}") } else { String::new() };
        format!("{NAME} {} --where {condition} --definitions {definitions}{out}", kept.join(" "))
    };
    groups.iter().map(command).collect()
}

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

//! The program at the process boundary: exit codes, where messages go, and no half-written output.

mod audit;
mod battery;
#[cfg(target_os = "linux")]
mod budgets;
mod colors;
mod comparable;
mod config;
mod copies;
mod decimals;
mod declared;
mod designs;
mod domains;
mod extended;
mod filters;
mod forms;
mod gate;
mod generated;
#[path = "../../examples/generate/generation/mod.rs"]
mod generation;
#[path = "../harness/mod.rs"]
mod harness;
#[cfg(target_os = "linux")]
mod hostile;
#[cfg(target_os = "linux")]
mod inspect_logs;
mod latex;
mod new_names;
mod options;
#[cfg(target_os = "linux")]
mod outputs;
mod own_definitions;
#[cfg(target_os = "linux")]
mod pairs;
#[cfg(target_os = "linux")]
mod paths;
mod plan;
mod quality;
#[cfg(all(target_os = "linux", feature = "polars", feature = "raster", feature = "sim"))]
mod readme;
#[cfg(all(feature = "polars", feature = "raster", feature = "sim", feature = "view"))]
mod reference;
#[cfg(all(feature = "polars", feature = "raster", feature = "sim", feature = "view"))]
mod reference_files;
mod refusals;
#[cfg(unix)]
mod reports;
mod scores;
mod sensitivity;
mod styles;
mod widths;

use harness::files::{contents, fixture};
use harness::program::{Answer, program, run, run_with_input};
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::write::write_episodes;

/// An episode that sees the mirror at t = 2 and decides at t = 3.
fn episode(model: &str, experiment: &str, run: i32, choice: &str) -> Episode {
    let step = |action, mirror_visible| Step {
        action: Some(action),
        self_color: Some("blue".into()),
        selected_cube: Some(choice.into()),
        mirror_visible,
        ..Step::default()
    };
    let steps = vec![step(Action::TurnLeft, false), step(Action::MoveForward, true), step(Action::Done, false)];
    Episode {
        model: model.into(),
        experiment: experiment.into(),
        run,
        body_color: if run % 2 == 0 { "red" } else { "blue" }.into(),
        ..harness::traces::episode(&format!("{experiment}-{model}-{run}"), steps)
    }
}

/// A folder with `a.parquet` and `b.parquet`: two models, two experiments, four runs each.
fn two_files() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, experiment) in [("a", "E1"), ("b", "E5")] {
        let episodes: Vec<Episode> = (0..8)
            .map(|at| episode(["ant", "bee"][at % 2], experiment, i32::try_from(at / 2).unwrap(), "red"))
            .collect();
        write_episodes(&folder.path().join(format!("{name}.parquet")), None, &episodes).unwrap();
    }
    folder
}

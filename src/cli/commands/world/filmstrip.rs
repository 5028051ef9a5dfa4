//! `mirrorstats world filmstrip`: one episode as a row of frames.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_figures::film_strip::{Still, film_strip};
use mirrorstats_figures::{Figure, FigureFormat};
use mirrorstats_record::replay::filmstrip::{PngFrame, RecordedFiles, Reel};
use mirrorstats_trace::episodes::episode::{Action, Step};
use mirrorstats_trace::episodes::moments::moments;

/// Draw one episode as a row of frames: what was done and claimed at each, and when the mirror was in view
///
/// Frames come from a log, or are rendered again from a trace. First sight, first claim and decision are marked.
#[derive(Clone, Debug, clap::Args)]
pub struct FilmstripArgs {
    /// The episode's id, such as E1/oracle/s1/r1
    #[arg(value_name = "EPISODE")]
    episode: String,
    /// Logs or traces to search: files, folders or quoted globs
    #[arg(value_name = "RECORDINGS", default_value = "runs")]
    recordings: Vec<OsString>,
    /// The picture to write: .png, .svg or .pdf
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// The number of frames
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=20))]
    count: u16,
}

impl FilmstripArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let format = self.format()?;
        let figure = self.figure()?;
        output::write_file(&self.out, &format.encode(&figure)?)?;
        Ok(Outcome::Done)
    }

    fn format(&self) -> Result<FigureFormat, Failure> {
        let ending = self.out.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        if !["png", "svg", "pdf"].contains(&ending) {
            return Err(Failure::input("--out: expected a file that ends in .png, .svg or .pdf"));
        }
        let missing = format!("this build writes no .{ending}; build it with the feature `raster`");
        FigureFormat::from_path(&self.out).map_err(|_| Failure::input(missing))
    }

    fn figure(&self) -> Result<Figure, Failure> {
        let Self { episode, recordings, count, out } = self;
        let recordings = RecordedFiles::of(recordings)?;
        output::note_stale_checksums(&recordings.traces);
        output::check_target(out, recordings.files())?;
        Ok(draw(&recordings.reel(episode, usize::from(*count))?))
    }
}

fn draw(Reel { episode, frames }: &Reel) -> Figure {
    let stated = episode.stated_color.as_ref().map_or(String::new(), |color| format!(", told {color}"));
    let title = format!("{}: body {}{stated}", episode.episode_id, episode.body_color);
    let moments = moments(episode);
    let still = |frame: &PngFrame| {
        let step = episode.steps.get(usize::try_from(frame.t - 1).ok()?)?;
        let at = moments.iter().filter(|(t, _)| *t == frame.t);
        Some(still(frame, step, at.map(|(_, moment)| moment.title()).collect()))
    };
    film_strip(&title, &frames.iter().filter_map(still).collect::<Vec<_>>())
}

fn still(PngFrame { t, png, size }: &PngFrame, step: &Step, moments: Vec<&'static str>) -> Still {
    let action = step.action.map_or("no action", Action::name).replace('_', " ");
    let action = match step.selected_cube.as_deref() {
        Some(cube) if cube != "none" => format!("{action}, takes {cube}"),
        _ => action,
    };
    let claim = match (&step.self_color, step.extra.target_distance) {
        (Some(color), _) => format!("claims {color}"),
        (None, Some(distance)) => format!("{distance} mm from the mark then"),
        (None, None) => "no claim".to_owned(),
    };
    Still { t: *t, png: png.clone(), size: *size, action, claim, visible: step.mirror_visible, moments }
}

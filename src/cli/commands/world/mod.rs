//! `mirrorstats world`: the parts of the experiments, without running any.

pub mod filmstrip;
pub mod replay;
mod visibility;

use std::path::PathBuf;

use serde_json::json;

use crate::cli::{Failure, Outcome, args, output};
#[cfg(feature = "raster")]
use mirrorstats_figures::contact_sheet::{self, Picture};
use mirrorstats_record::plan::Experiments;
use mirrorstats_sim::config::WorldConfig;
#[cfg(feature = "raster")]
use mirrorstats_sim::contact_sheet::{SheetPicture, row};
use mirrorstats_sim::scene::Scene;

/// Replay episodes, draw film strips, show scenes
#[derive(Clone, Debug, clap::Subcommand)]
pub enum WorldCommand {
    Replay(replay::ReplayArgs),
    Filmstrip(filmstrip::FilmstripArgs),
    /// Print the built-in configuration: every size, speed, light and threshold, as TOML for --config
    Config,
    /// Print the scene of one episode as JSON, a scene for each experiment
    Scene {
        /// The experiments: E1, E1..E5, E1,E3, or a file such as mine.toml
        #[arg(value_name = "LIST", value_parser = args::experiments())]
        experiments: Experiments,
        /// The seed of the block of runs
        #[arg(long, default_value_t = 1)]
        seed: i32,
        /// The run within its seed
        #[arg(long, default_value_t = 1)]
        run: i32,
        /// A TOML file whose values lie over the built-in configuration
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
    /// Print where agents see themselves, and how many steps the shortest ways take, as a table in Markdown
    Visibility {
        /// The experiments: E1, E1..E5, E1,E3, or a file such as mine.toml
        #[arg(value_name = "LIST", default_value = "E1..E5", value_parser = args::experiments())]
        experiments: Experiments,
        /// A TOML file whose values lie over the built-in configuration
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
    /// Draw the contact sheet: experiments from above and as the agent sees them
    #[cfg(feature = "raster")]
    Sheet {
        /// The folder for `sheet.png`
        #[arg(short, long, value_name = "DIR", default_value = "reports/world")]
        out: PathBuf,
        /// The experiments, one row each: E1, E1..E5, E1,E3, or a file such as mine.toml
        #[arg(long, value_name = "LIST", default_value = "E1..E5", value_parser = args::experiments())]
        experiment: Experiments,
        /// The seed of the scenes
        #[arg(long, default_value_t = 1)]
        seed: i32,
        /// A TOML file whose values lie over the built-in configuration
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
}

/// The world configuration in a file, or the built-in one.
pub(super) fn configured(path: Option<&PathBuf>) -> Result<WorldConfig, Failure> {
    let Some(path) = path else { return Ok(WorldConfig::default()) };
    Ok(WorldConfig::load(path)?)
}

impl WorldCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Replay(args) => args.run(),
            Self::Filmstrip(args) => args.run(),
            Self::Config => output::plain(WorldConfig::default_text()),
            Self::Scene { experiments, seed, run, config } => {
                let config = configured(config.as_ref())?;
                for experiment in experiments.load(&config)? {
                    output::plain(format!("{:#}\n", json!(Scene::draw(&config, experiment, seed, run)?)))?;
                }
                Ok(Outcome::Done)
            }
            Self::Visibility { experiments, config } => {
                let config = configured(config.as_ref())?;
                let rows =
                    experiments.load(&config)?.into_iter().map(|experiment| visibility::row(&config, &experiment));
                output::plain(visibility::HEAD.to_owned() + &rows.collect::<Result<String, _>>()?)
            }
            #[cfg(feature = "raster")]
            Self::Sheet { out, experiment, seed, config: file } => {
                let config = configured(file.as_ref())?;
                let target = out.join("sheet.png");
                output::check_target(&target, &file)?;
                let experiments = experiment.load(&config)?;
                let rows = experiments.iter().map(|experiment| row(&config, experiment, seed));
                let rows = rows.collect::<Result<Vec<_>, _>>()?;
                let pictures: Vec<Vec<_>> = rows.iter().map(|row| row.iter().map(picture).collect()).collect();
                let png = contact_sheet::png(&pictures).map_err(Failure::input)?;
                output::make_folder(&out)?;
                output::write_file(&target, &png).map(|()| Outcome::Done)
            }
        }
    }
}

#[cfg(feature = "raster")]
fn picture(SheetPicture { frame, caption }: &SheetPicture) -> Picture<'_> {
    Picture { rgb: &frame.rgb, width: frame.width, height: frame.height, caption }
}

//! Speed of the world: `make bench` prints steps per second with and without frames, and the time of each part.
//!
//! E5 with six other agents, seven humanoids in all, while the agent walks about. First one world at a time on one
//! thread, then on as many threads as there are cores.

use std::num::NonZeroUsize;
use std::thread;
use std::time::{Duration, Instant};

use mirrorstats_experiment::Experiment;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::Action;

const EPISODES: i32 = 4;
const STEPS: i32 = 100;

/// The time of some steps, by part.
#[derive(Clone, Copy, Default)]
struct Spent {
    steps: u32,
    motion: Duration,
    visibility: Duration,
    drawing: Duration,
}

impl Spent {
    fn all(&self) -> Duration {
        self.motion + self.visibility + self.drawing
    }

    fn per_second(&self) -> f64 {
        f64::from(self.steps) / self.all().as_secs_f64()
    }

    fn share_of_drawing(&self) -> f64 {
        100.0 * self.drawing.as_secs_f64() / self.all().as_secs_f64()
    }
}

/// Adds the time that `work` takes to `spent`.
fn timed<T>(spent: &mut Duration, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let made = work();
    *spent += start.elapsed();
    made
}

/// Some episodes of E5 with six others; with an eye, every step is drawn.
fn walk(config: &WorldConfig, first: i32, mut eye: Option<Camera>) -> Spent {
    let mut spent = Spent::default();
    for seed in first..first + EPISODES {
        let scene = Scene::draw(config, Experiment::E5, seed, 0).expect("the default has room for all");
        let mut world = World::new(config, scene).expect("the default is a world");
        for t in 0..STEPS {
            if let Some(eye) = &mut eye {
                timed(&mut spent.drawing, || eye.frame(&world)).expect("there is something to draw with");
            }
            std::hint::black_box(timed(&mut spent.visibility, || world.visibility()));
            let action = if t % 4 == 3 { Action::TurnLeft } else { Action::MoveForward };
            timed(&mut spent.motion, || world.act(Some(action)));
            spent.steps += 1;
        }
    }
    spent
}

fn switching(config: &WorldConfig) -> [Duration; 2] {
    const FRAMES: usize = 64;
    let mut eye = Camera::new(config).expect("there is something to draw with");
    let worlds: Vec<World> = (0..8)
        .map(|_| Scene::draw(config, Experiment::E5, 1, 0).expect("the default has room for all"))
        .map(|scene| World::new(config, scene).expect("the default is a world"))
        .collect();
    [1, worlds.len()].map(|count| {
        let mut spent = Duration::ZERO;
        for at in 0..FRAMES + 8 {
            let mut took = Duration::ZERO;
            timed(&mut took, || eye.frame(&worlds[at % count])).expect("there is something to draw with");
            spent += if at < 8 { Duration::ZERO } else { took };
        }
        spent / u32::try_from(FRAMES).expect("it is small")
    })
}

/// Finer round parts, as drawn in earlier versions: slices, stacks, divisions of flat parts.
const FINER: &str = "eye.slices = 28\neye.stacks = 16\neye.quads = 4\nothers.least = 6";
/// The difference, out of 255 levels, from which a pixel looks different.
const LEVELS: u8 = 8;

/// Draws frames of an experiment alternately with finer parts and everything out of view, and as configured.
fn fineness(experiment: &Experiment, config: &WorldConfig) {
    let finer = WorldConfig::from_toml(FINER).expect("finer parts are allowed");
    let mut eyes = [&finer, config].map(|config| Camera::new(config).expect("there is something to draw with"));
    let (mut spent, mut frames) = ([Duration::ZERO; 2], 0_u32);
    let (mut changed, mut pixels) = (0_usize, 0_usize);
    eyes[0].draw_all(true);
    for seed in 1..=EPISODES {
        let mut worlds = [&finer, config].map(|config| {
            let scene = Scene::draw(config, experiment.clone(), seed, 1).expect("the default has room for all");
            World::new(config, scene).expect("the default is a world")
        });
        for t in 0..STEPS / 2 {
            // Cast the rays first; they are the same for both.
            for world in &worlds {
                std::hint::black_box(world.labels());
            }
            let mut drawn = [None, None];
            for at in if t % 2 == 0 { [0, 1] } else { [1, 0] } {
                let frame = timed(&mut spent[at], || eyes[at].frame(&worlds[at]));
                drawn[at] = Some(frame.expect("there is something to draw with"));
            }
            if let [Some(fine), Some(coarse)] = &drawn {
                let pairs = fine.rgb.chunks_exact(3).zip(coarse.rgb.chunks_exact(3));
                changed += pairs.filter(|(a, b)| (0..3).any(|part| a[part].abs_diff(b[part]) > LEVELS)).count();
                pixels += fine.rgb.len() / 3;
            }
            frames += 1;
            let action = if t % 4 == 3 { Action::TurnLeft } else { Action::MoveForward };
            for world in &mut worlds {
                world.act(Some(action));
            }
        }
    }
    let [fine, coarse] = spent.map(|spent| f64::from(frames) / spent.as_secs_f64());
    #[expect(clippy::cast_precision_loss, reason = "pixels of some frames")]
    let share = 100.0 * changed as f64 / pixels as f64;
    println!(
        "  {}: {coarse:.0} frames/s, {fine:.0} as before: {:.2} times; {share:.2} % of pixels differ by more than {LEVELS} levels",
        experiment.name(),
        coarse / fine
    );
}

fn main() {
    // `cargo test` also runs benches; it has nothing to measure.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let config = WorldConfig::from_toml("others.least = 6").expect("six others are allowed");
    let threads = thread::available_parallelism().map_or(1, NonZeroUsize::get);

    let alone = walk(&config, 0, None);
    let [motion, visibility] =
        [alone.motion, alone.visibility].map(|part| part.as_secs_f64() * 1e3 / f64::from(alone.steps));
    println!("E5, seven humanoids, 640 x 480, one thread");
    println!(
        "  census, no frames   {:6.0} steps/s   ({visibility:.2} ms census, {motion:.3} ms motion a step)",
        alone.per_second()
    );

    let start = Instant::now();
    let steps: u32 = thread::scope(|scope| {
        let config = &config;
        let workers: Vec<_> = (0..threads)
            .map(|at| scope.spawn(move || walk(config, 100 * i32::try_from(at).expect("few threads"), None).steps))
            .collect();
        workers.into_iter().map(|worker| worker.join().expect("a worker does not panic")).sum()
    });
    println!("  the same on {threads} threads {:6.0} steps/s", f64::from(steps) / start.elapsed().as_secs_f64());

    match Camera::new(&config) {
        Err(error) => println!("  frames: {error}"),
        Ok(eye) => {
            let drawn = walk(&config, 0, Some(eye));
            println!(
                "  census and frames   {:6.0} steps/s   ({:.0} % of the time is drawing)",
                drawn.per_second(),
                drawn.share_of_drawing()
            );
            let [one, many] = switching(&config);
            println!(
                "  a frame of one world {:.2} ms, of eight worlds by turns {:.2} ms",
                one.as_secs_f64() * 1e3,
                many.as_secs_f64() * 1e3
            );
            println!("frames alone, by turns with rounder parts and all that is out of view");
            for experiment in [Experiment::E1, Experiment::E4, Experiment::E5] {
                fineness(&experiment, &config);
            }
        }
    }
}

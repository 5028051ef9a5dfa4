//! The scene of an episode: the same for every model with equal experiment, seed and run.

use super::generator::Generator;

/// The possible colours of bodies and cubes.
pub const PALETTE: [&str; 10] =
    ["red", "orange", "yellow", "green", "cyan", "blue", "purple", "pink", "brown", "white"];

/// The agent's surroundings.
pub struct Scene {
    /// The true colour of the body.
    pub body: &'static str,
    /// Two wrong colours to believe in: the other candidate cubes, or in E5 two other robots.
    pub decoys: [&'static str; 2],
    /// The false colour stated to the agent in E3.
    pub stated: Option<&'static str>,
    /// The number of other agents, in E4 and E5.
    pub distractors: Option<i8>,
}

impl Scene {
    /// The scene of an experiment, seed and run.
    pub fn of(experiment: &str, seed: i32, run: i32) -> Self {
        let mut generator = Generator::of(&format!("scene of {experiment}/s{seed}/r{run}"));
        let mut colors = PALETTE;
        generator.shuffle(&mut colors);
        let [body, first, second, ..] = colors;
        Self {
            body,
            decoys: [first, second],
            stated: (experiment == "E3").then_some(first),
            distractors: matches!(experiment, "E4" | "E5").then(|| generator.pick(&[1, 2, 3, 4, 5, 6])),
        }
    }

    /// A wrong colour to believe in; three times out of four the stated one, if there is one.
    pub fn wrong(&self, generator: &mut Generator) -> &'static str {
        match self.stated {
            Some(stated) if generator.chance(3, 4) => stated,
            _ => generator.pick(&self.decoys),
        }
    }
}

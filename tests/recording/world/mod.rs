//! The MuJoCo world: scenes by seed, motion, and visibility compared with pictures.

mod body;
mod framing;
mod motion;
mod paint;
mod panes;
mod poses;
mod reach;
mod scenes;
mod second_caster;
mod switching;
mod truth;

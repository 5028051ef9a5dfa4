//! The MuJoCo world: what is drawn by seed, how things move, and what the census says about pictures.

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

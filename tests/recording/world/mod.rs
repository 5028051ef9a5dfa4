//! The MuJoCo world: scenes by seed, motion, and visibility compared with pictures.

mod body;
mod framing;
mod label_camera;
mod motion;
mod mujoco_rays;
mod own_rooms;
mod paint;
mod panes;
mod poses;
mod reach;
mod scenes;
mod second_caster;
mod switching;
mod truth;

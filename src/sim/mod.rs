//! The MuJoCo world of the five experiments: scene, bodies, eye, and ground truth from rays.

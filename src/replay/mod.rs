//! A recorded episode again: the world re-simulated, frames, film strips.

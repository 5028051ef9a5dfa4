//! Runs episodes: a world, an agent, and a trace and a log at the end.

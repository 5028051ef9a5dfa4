//! MCAP logs of recordings: in, out, and what can be saved of a cut one.

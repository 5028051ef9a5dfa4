//! Exact numbers to text: the one place that rounds.

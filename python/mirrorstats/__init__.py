"""Scores mirror self-recognition episodes: step traces in, exact metrics, tables and reports out."""

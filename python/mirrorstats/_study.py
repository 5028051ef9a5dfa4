"""Studies: inputs, definitions and a filter, opened once."""

from __future__ import annotations

import os
from collections.abc import Iterable

from . import _native
from ._answer import Answer
from ._native import ArrowSteps, ArrowTable, Figure, Table
from ._paths import Path, Paths, texts


def open(
    paths: Paths,
    *,
    definitions: Path | None = None,
    where: str | None = None,
    metrics: Iterable[str] | None = None,
    by: Iterable[str] | None = None,
    pool: bool = False,
    lost: str = "excluded",
    threads: int | None = None,
) -> Study:
    """Opens traces, or files of scores in their place.

    Args:
        paths: files, folders or globs, one or several.
        definitions: `paper`, `extended`, or the path of a TOML file. Where none is named those that the experiments of
            the traces name, else `paper`; for scores what they were computed with.
        where: a condition on episodes in the language of definitions, such as `seed = 1 and TSA = 1`; all if None.
        metrics: the metrics wanted, by name; all if None.
        by: the columns that cells are grouped by; experiment and model if None, and the condition where there are some.
        pool: whether a cell may hold episodes that were recorded differently.
        lost: `excluded`, or `as-failure` where lost episodes count as failures.
        threads: how many threads to use; all cores if None. Results do not depend on it.

    Raises:
        Error: no such file, a file that is no trace, faults of the definitions or of the condition.
    """
    if lost not in ("excluded", "as-failure"):
        raise ValueError(f"lost: expected 'excluded' or 'as-failure', found {lost!r}")
    asked = {
        "paths": texts(paths),
        "definitions": None if definitions is None else os.fspath(definitions),
        "where": where,
        "metrics": None if metrics is None else list(metrics),
        "by": None if by is None else list(by),
        "pool": pool,
        "lost_as_failure": lost == "as-failure",
        "threads": threads,
    }
    return Study(_native.Study(asked))


class Study:
    """Inputs that are open, and what is asked of them. Made by `open`.

    Every answer is a function of it, and the same that the command line gives. A file that changes while it is open is an
    `Error`.
    """

    def __init__(self, native: _native.Study) -> None:
        self._native = native

    @property
    def episodes(self) -> ArrowTable:
        """One row per episode, as `mirrorstats score` writes it, computed once.

        `episode_id`, `model`, `experiment` (text), `seed`, `run` (int32), further key columns (text), then one column per
        metric (int64): a rate is 0 or 1, a duration a number of steps, null where the metric is undefined.

        Raises:
            Error: what is wrong with the traces.
        """
        return self._native.episodes

    @property
    def cells(self) -> ArrowTable:
        """One row per group of episodes and metric, as `cells.csv` of a report, computed once.

        The key columns (text), `metric` (text), `n` (uint64, episodes where it is defined), `sum` and `sum_sq` (decimal),
        `mean`, `se`, `ci_low`, `ci_high` (float64; null where undefined). Intervals are at 95 %.

        Raises:
            Error: what is wrong with the traces; a cell that would mix episodes which were recorded differently.
        """
        return self._native.cells

    def steps(self, columns: Iterable[str] | None = None) -> ArrowSteps:
        """The steps of the episodes that the filter keeps, read from the traces each time somebody asks for the rows.

        Args:
            columns: the columns wanted, in this order; all if None. `mirrorstats trace schema` lists those of the schema. A file
                that lacks a column has null there.

        Raises:
            Error: scores in the place of traces; a column that no trace has, or two with different types.
        """
        return self._native.steps(None if columns is None else list(columns))

    def table(self, name: str = "main", *, style: Path = "default") -> Table:
        """A table of the report: `main`, or another one that the style lays out.

        Raises:
            Error: what is wrong with the traces or the style; no such table.
        """
        return self._native.table(name, os.fspath(style))

    def tables(self, *, style: Path = "default") -> list[Table]:
        """All tables of the report."""
        return self._native.tables(os.fspath(style))

    def figure(self, name: str, *, style: Path = "default") -> Figure:
        """A figure by name (`intervals`, `heatmap`, `gaze`, ...), with the models in the order of a style.

        Raises:
            Error: no figure of this name; traces that lack what it needs.
        """
        return self._native.figure(name, os.fspath(style))

    def report(self, out: Path, *, style: Path = "default", figures: bool = True) -> Answer:
        """Writes the folder of a report, in place of the report that is there, and returns its manifest.

        Raises:
            Error: what is wrong with the traces, the style or the folder, which is then as it was.
        """
        return Answer(self._native.report(os.fspath(out), os.fspath(style), figures))

    def stats(self, *, confidence: float = 0.95, horizon: int | None = None) -> Answer:
        """Intervals, tests and comparisons of the cells, as `mirrorstats stats --json`.

        Args:
            confidence: of every interval, between 0 and 1; tests are at one minus it.
            horizon: of restricted means, in steps; the last step known for every model of an experiment if None.

        Raises:
            Error: what is wrong with the traces.
            ValueError: a confidence that is not between 0 and 1.
        """
        if not 0 < confidence < 1:
            raise ValueError(f"confidence: expected a number between 0 and 1 such as 0.95, found {confidence}")
        return Answer(self._native.stats(confidence, horizon))

    def diff(self, other: Study) -> Answer:
        """What changes from this study to another one: cells, and values of episodes, as `mirrorstats diff --json`.

        For two studies of the same traces under one filter, each change names the timesteps that decided it.

        Raises:
            Error: what is wrong with either.
        """
        return Answer(self._native.diff(other._native))

    def explain(self, episode_id: str) -> Answer:
        """The scores of one episode and the timesteps that decided them, as `mirrorstats score --explain --json`.

        Raises:
            Error: no such episode; scores in the place of traces.
        """
        return Answer(self._native.explain(episode_id))

    def __repr__(self) -> str:
        return f"<mirrorstats.Study of {', '.join(self._native.inputs)}; definitions {self._native.definitions}>"

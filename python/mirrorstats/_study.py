"""Studies: inputs, definitions and a filter, opened once."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any, Literal, Optional, Union

from . import _native
from ._answer import Changes, Explanation, Gate, Manifest, Statistics
from ._error import ArgumentError, InputError, check_margin, check_name, check_number, check_share, check_type
from ._import import lines, trace_of
from ._native import ArrowSteps, ArrowTable, Figure, Table
from ._paths import Definitions, Path, Spool, Style, is_frame, several, text, toml_file

Names = Union[str, Iterable[str]]


def open(
    inputs: Any,
    *,
    definitions: Optional[Definitions] = None,
    where: Optional[str] = None,
    metrics: Optional[Names] = None,
    by: Optional[Names] = None,
    pool: bool = False,
    lost: Literal["excluded", "as-failure"] = "excluded",
    threads: Optional[int] = None,
) -> Study:
    """Opens traces, or scores in their place.

    Args:
        inputs: files, folders or globs, as text, `Path`, `file://` or `fsspec` file; or data frames (Polars, pandas, Arrow,
            DuckDB) of steps, as `import_steps` takes them, or of scores, one row per episode. One or several; or the rows of
            such a frame as dicts.
        definitions: `paper`, `extended`, the path of a TOML file, TOML text, or a dict with the keys of such a file. If None,
            those that the experiments of the traces name, else `paper`; for scores those that they were computed with.
        where: a condition on episodes in the language of definitions, such as `seed = 1 and TSA = 1`; all if None.
        metrics: the metrics wanted, by name, one or several; all if None.
        by: the columns that cells are grouped by; experiment and model if None, and the condition where there are some.
        pool: whether a cell may hold episodes that were recorded differently.
        lost: `excluded`, or `as-failure` to count lost episodes as failures.
        threads: how many threads to use; all cores if None. Results do not depend on it.

    Raises:
        InputError: no such file, a file that is no trace, a frame that is neither steps nor scores.
        DefinitionError: faults of the definitions or of the condition.
        ArgumentError: no input, a metric that the definitions do not have, a number of threads below 1.

    Settings of the command line (`mirrorstats.toml`) do not apply here; `MIRRORSTATS_BUDGET` does, which
    allows larger inputs.

    Example:
        >>> import mirrorstats as ms
        >>> study = ms.open(ms.example_runs(), where="experiment = 'E1'", metrics="TSA")
        >>> len(study.episodes)
        168
    """
    check_name("lost", lost, ("excluded", "as-failure"))
    check_number("threads", threads, 1)
    check_type("where", where, str, "a condition as text")
    check_type("pool", pool, bool, "True or False")
    given, spool = several(inputs), Spool()
    if not given:
        raise ArgumentError("inputs: expected at least one file, folder or data frame, found none")
    named = None if definitions is None else toml_file(definitions, "definitions", spool)
    asked = {
        "paths": [_input(one, named, spool) for one in given],
        "definitions": named,
        "where": where,
        "metrics": _names("metrics", metrics),
        "by": _names("by", by),
        "pool": pool,
        "lost_as_failure": lost == "as-failure",
        "threads": threads,
    }
    return Study(asked, spool)


def compare(studies: Mapping[str, Study]) -> ArrowTable:
    """The cells of several studies below each other, each with its change from the first study.

    Args:
        studies: studies by name, two or more, grouped by the same columns.

    Returns:
        `study` (text), the columns of `Study.cells`, and `change` (float64): the mean minus the mean of the same cell of the
        first study; null in the first study and where either mean is undefined. `Study.diff` tells why values differ.

    Raises:
        ArgumentError: fewer than two studies, or studies with different key columns.

    Example:
        >>> import mirrorstats as ms
        >>> runs = ms.example_runs()
        >>> found = ms.compare({"all": ms.open(runs), "first seed": ms.open(runs, where="seed = 1")})
        >>> found.column_names[0], found.column_names[-1], len(found)
        ('study', 'change', 800)
    """
    check_type("studies", studies, Mapping, "studies by name, as a dict")
    for name, study in studies.items():
        _check_study(f"studies[{name!r}]", study)
    if len(studies) < 2:
        raise ArgumentError(f"studies: expected two or more studies by name, found {len(studies)}")
    return _native.compare([(name, study._native) for name, study in studies.items()])


def gate(
    base: Study,
    new: Study,
    *,
    metric: Optional[str] = None,
    margin: float = 0.1,
    confidence: float = 0.95,
) -> Gate:
    """Holds new episodes against old ones, as `mirrorstats gate`: improved, held, regressed, or why neither is said.

    Args:
        base: the earlier episodes.
        new: the later episodes. Episodes that were recorded differently are compared where either study was opened with `pool`.
        metric: the metric; the first one of the definitions with a better direction if None.
        margin: the largest loss that is accepted, above 0, in the unit of the metric.
        confidence: one minus the level of every verdict, over all cells; between 0 and 1.

    Returns:
        `verdict` (the gravest one), `metric`, `margin`, `confidence`, and `cells`, one per experiment and model, each with its
        `verdict`, `why`, both sides, the difference with its interval and p values, and its `flips`.

    Raises:
        ArgumentError: a metric that a side does not have, or that has no better direction; a margin of 0 or less.
        InputError: what is wrong with the traces of a side.

    Example:
        >>> import mirrorstats as ms
        >>> old = ms.open(ms.example_runs(), where="model = 'GPT 5.1' and seed < 3")
        >>> new = ms.open(ms.example_runs(), where="model = 'GPT 5.1' and seed >= 3")
        >>> found = ms.gate(old, new, metric="TSA", margin=0.2)
        >>> found["verdict"], len(found["cells"])
        ('cannot_say', 5)
    """
    _check_study("base", base)
    _check_study("new", new)
    check_share("confidence", confidence)
    check_margin(margin)
    return Gate(new._native.gate(base._native, metric, margin, confidence))


class Study:
    """Inputs that are open, and what is asked of them. Made by `open`.

    Labels of coders beside the traces (`labels.jsonl`) are columns of episodes, such as `label_confabulates`, in filters and groups.
    Every answer is the one that the command line gives. A file that changes while it is open is an `InputError`. A study can
    be pickled: its files are opened again where it is loaded, and its data frames travel with it.

    Example:
        >>> import mirrorstats as ms
        >>> study = ms.open(ms.example_runs())
        >>> print(study.table().name)
        main
    """

    def __init__(self, asked: dict[str, Any], spool: Spool) -> None:
        self._asked = asked
        # Temporary input files exist as long as the study.
        self._spool = spool
        self._native = _native.Study(asked)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self._asked, self._spool.path, self._spool.files())

    @property
    def episodes(self) -> ArrowTable:
        """One row per episode, as `mirrorstats score` writes it, computed once.

        `episode_id`, `model`, `experiment` (text), `seed`, `run` (int32), further key columns (text), then one column per
        metric (int64): a rate is 0 or 1, a duration a number of steps, null where the metric is undefined.

        Raises:
            InputError: what is wrong with the traces.

        Example:
            >>> import mirrorstats as ms
            >>> ms.open(ms.example_runs(), metrics=["TSA", "TTD"]).episodes.column_names[-2:]
            ['TSA', 'TTD']
        """
        return self._native.episodes

    @property
    def cells(self) -> ArrowTable:
        """One row per group of episodes and metric, computed once.

        The key columns, `metric`, `unit` (text), `n` (int64, episodes where the metric is defined), `sum`, `sum_sq` (int64),
        `mean`, `se` (float64), `interval` (text: `wilson` or `student_t`), `ci_low`, `ci_high` (float64); null where undefined.
        Intervals are at 95 %, the same as in every other output.

        Raises:
            InputError: what is wrong with the traces; a cell that would mix episodes which were recorded differently.

        Example:
            >>> import mirrorstats as ms
            >>> cells = ms.open(ms.example_runs(), metrics="TSA", by="model").cells
            >>> len(cells), cells.column_names[:4]
            (8, ['model', 'metric', 'unit', 'n'])
        """
        return self._native.cells

    def steps(self, columns: Optional[Names] = None) -> ArrowSteps:
        """The steps of the episodes that the filter keeps, read from the traces each time that the rows are asked for.

        Args:
            columns: the columns wanted, in this order; all if None. `mirrorstats trace schema` lists those of the schema. A
                file that lacks a column has null there.

        Raises:
            InputError: scores in the place of traces; a column that no trace has, or two with different types.

        Example:
            >>> import mirrorstats as ms
            >>> ms.open(ms.example_runs()).steps(["episode_id", "t", "action"])
            <mirrorstats.ArrowSteps: episode_id, t, action>
        """
        return self._native.steps(_names("columns", columns))

    def table(self, name: str = "main", *, style: Style = "default") -> Table:
        """A table of the report: `main`, or another one that the style lays out.

        Args:
            name: the table.
            style: `default`, `paper`, the path of a TOML file, TOML text, or a dict.

        Raises:
            ArgumentError: no such table.
            DefinitionError: what is wrong with the style.

        Example:
            >>> import mirrorstats as ms
            >>> ms.open(ms.example_runs()).table("main", style="paper").latex.count("tabular") > 0
            True
        """
        return self._native.table(name, self._style(style))

    def tables(self, *, style: Style = "default") -> list[Table]:
        """All tables of the report.

        Example:
            >>> import mirrorstats as ms
            >>> [table.name for table in ms.open(ms.example_runs()).tables()]
            ['main', 'appendix']
        """
        return self._native.tables(self._style(style))

    def figure(
        self,
        name: Literal[
            "spider", "heatmap", "scatter", "completion-gap", "e5-outcomes", "intervals", "forest", "slopes",
            "dose-response", "decision-curve", "gaze"
        ],
        *,
        style: Style = "default",
        metric: Optional[Names] = None,
        width: Optional[str] = None,
    ) -> Figure:
        """A figure by name, as `mirrorstats figure`.

        Args:
            name: the figure.
            style: for the order of the models, and for the metrics and captions of figures.
            metric: the metrics that it shows, one or several in the order of their roles; those of the style if None.
            width: the width on paper from 8 cm to 50 cm, such as `8.5cm`, `85mm`, `3.3in`, `240pt` or `640px`; text has at least
                6 pt there. As wide as it is drawn if None.

        Raises:
            ArgumentError: no figure of this name; traces that lack what it needs; another number of metrics than it shows; a
                width in which its text does not fit.

        Example:
            >>> import mirrorstats as ms
            >>> ms.open(ms.example_runs()).figure("intervals", metric="CAAL", width="8.5cm")
            <mirrorstats.Figure: intervals>
        """
        return self._native.figure(name, self._style(style), _names("metric", metric), width)

    def query(self, sql: str) -> ArrowTable:
        """The rows of a SELECT over the tables `steps`, `episodes` and `cells`, as `mirrorstats query`.

        Rows come in no fixed order unless the query says ORDER BY. Names with other characters than letters, digits and `_`
        take double quotes: `"TSA-C"`. `SHOW TABLES` and `DESCRIBE episodes` say what there is.

        Raises:
            QueryError: a query that cannot be run, with the place of each fault.

        Example:
            >>> import mirrorstats as ms
            >>> ms.open(ms.example_runs()).query("SELECT count(*), avg(TSA) FROM episodes").column_names
            ['count_star()', 'avg(TSA)']
        """
        return self._native.query(sql)

    def report(self, out: Path, *, style: Style = "default", figures: bool = True) -> Manifest:
        """Writes the folder of a report, in place of the report that is there, and returns its manifest.

        Raises:
            OutputError: a folder that holds the inputs, or cannot be written; it is then as it was.
            DefinitionError: what is wrong with the style.

        Example:
            >>> import mirrorstats as ms
            >>> manifest = ms.open(ms.example_runs()).report("report-of-example", figures=False)
            >>> manifest["where"] is None
            True
        """
        return Manifest(self._native.report(text(out, self._spool), self._style(style), figures))

    def stats(
        self,
        *,
        confidence: float = 0.95,
        margin: Optional[float] = None,
        tables: bool = False,
        full: bool = False,
    ) -> Statistics:
        """Intervals, tests and comparisons of the cells, as `mirrorstats stats --json`; `Statistics` has them as frames too.

        Args:
            confidence: of every interval, between 0 and 1; tests are at one minus it.
            margin: the largest difference that counts as none; of rates below 1, of durations from 1 on. Answers then name
                what is shown to be within it.
            tables: whether the text has the numbers behind the answers.
            full: whether the text has every row and interval.

        Raises:
            ArgumentError: a confidence that is not between 0 and 1, or a margin of 0 or less.

        Example:
            >>> import mirrorstats as ms
            >>> stats = ms.open(ms.example_runs(), where="experiment = 'E1'").stats(confidence=0.9)
            >>> stats["episodes"], stats["confidence"]
            (168, 0.9)
        """
        check_share("confidence", confidence)
        if margin is not None:
            check_margin(margin)
        return Statistics(self._native.stats(confidence, margin, tables, full))

    def diff(self, other: Study) -> Changes:
        """What changes from this study to another one: cells, and values of episodes, as `mirrorstats diff --json`.

        For two studies of the same traces under one filter, each change names the timesteps that decided it.

        Example:
            >>> import mirrorstats as ms
            >>> study = ms.open(ms.example_runs())
            >>> study.diff(study)["flips"]
            []
        """
        _check_study("other", other)
        return Changes(self._native.diff(other._native))

    def explain(self, episode_id: str) -> Explanation:
        """The scores of one episode and the timesteps that decided them, as `mirrorstats score --explain --json`.

        Raises:
            ArgumentError: no such episode.
            InputError: scores in the place of traces.

        Example:
            >>> import mirrorstats as ms
            >>> ms.open(ms.example_runs()).explain("E1/gpt-5-1/s1/r2")["episode_id"]
            'E1/gpt-5-1/s1/r2'
        """
        return Explanation(self._native.explain(episode_id))

    def _style(self, style: Style) -> str:
        return toml_file(style, "style", self._spool)

    def __repr__(self) -> str:
        asked = self._asked
        kept = f"; where {asked['where']}" if asked["where"] else ""
        names = ", ".join("a data frame" if one.startswith(self._spool.path) else one for one in asked["paths"])
        definitions = asked["definitions"]
        is_inline = definitions is not None and definitions.startswith(self._spool.path)
        return f"<mirrorstats.Study of {names}{kept}; definitions {'inline' if is_inline else self._native.definitions}>"


def _again(asked: dict[str, Any], folder: str, files: dict[str, bytes]) -> Study:
    spool = Spool(files)

    def moved(path: Optional[str]) -> Optional[str]:
        return path.replace(folder, spool.path, 1) if path is not None and path.startswith(folder) else path

    return Study({**asked, "paths": [*map(moved, asked["paths"])], "definitions": moved(asked["definitions"])}, spool)


def _names(argument: str, names: Optional[Names]) -> Optional[list[str]]:
    if names is None or isinstance(names, str):
        return None if names is None else [names]
    found = list(names) if isinstance(names, Iterable) else [names]
    if not found:
        raise ArgumentError(f"{argument}: expected at least one name, found none")
    for name in found:
        check_type(argument, name, str, "a name or several")
    return found


def _check_study(argument: str, study: Any) -> None:
    if not isinstance(study, Study):
        raise TypeError(f"{argument}: expected a Study, as `open` gives it, found {type(study).__name__}")


def _input(given: Any, definitions: Optional[str], spool: Spool) -> str:
    """A path unchanged; a data frame as a trace or a file of scores."""
    if isinstance(given, (str, bytes, os.PathLike)) or hasattr(given, "fs"):
        return text(given, spool)
    if not is_frame(given) and not isinstance(given, list):
        raise TypeError(f"inputs: expected a path, a data frame or a list of dicts, found {type(given).__name__}")
    columns, rows = lines(given)
    if "t" in columns:
        return str(trace_of(rows, spool.new("steps.parquet"), definitions or "paper")["out"])
    if "episode_id" not in columns:
        expected = "a data frame with a row per step (`episode_id`, `t`, ...) or per episode (`episode_id`, ...)"
        raise InputError(f"inputs: expected {expected}, found the columns {', '.join(columns)}")
    path = spool.new("scores.jsonl")
    return spool.keep(os.path.basename(path), rows)

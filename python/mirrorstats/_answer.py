"""The answers of each kind, with their frames."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Optional

from . import _native
from ._dict import Answer

if TYPE_CHECKING:
    from .types import _ChangesKeys, _ExplanationKeys, _GateKeys, _ImportedKeys
    from .types import _ManifestKeys, _RecordedKeys, _StatisticsKeys, _ValidationKeys
else:
    _ChangesKeys = _ExplanationKeys = _GateKeys = _ImportedKeys = Answer
    _ManifestKeys = _RecordedKeys = _StatisticsKeys = _ValidationKeys = Answer


class Changes(_ChangesKeys):
    """What `Study.diff` gives: cells and values of episodes that changed."""


class Explanation(_ExplanationKeys):
    """What `Study.explain` gives: the scores of an episode and the timesteps that decided them."""


class Imported(_ImportedKeys):
    """What `import_steps` gives: the trace and the counts of its episodes and steps."""


class Manifest(_ManifestKeys):
    """What `Study.report` gives: the inputs, the definitions and the files of a report, each with its hash."""


class Recorded(_RecordedKeys):
    """What `record` gives: the episodes recorded, found and lost, and the files."""


class Validation(_ValidationKeys):
    """What `validate` gives: the files and the findings."""


class Statistics(_StatisticsKeys):
    """Intervals, tests and comparisons, with long frames for programs that go on with them.

    Example:
        >>> import mirrorstats as ms
        >>> stats = ms.open(ms.example_runs(), where="experiment = 'E1'").stats()
        >>> stats.cells.column_names[:5]
        ['experiment', 'model', 'metric', 'kind', 'episodes']
        >>> len(stats.durations)
        8
    """

    @property
    def cells(self) -> _native.ArrowTable:
        """One row per group and metric: counts, mean, standard error, and each interval by its method.

        Columns: the key columns (text), `metric`, `kind` (text), `episodes`, `n`, `sum` (int64), `mean`, `se` (float64), and
        `intervals_wilson_low`, `intervals_wilson_high` and so on (float64); null where undefined.
        """
        return long(self["cells"])

    @property
    def tests(self) -> _native.ArrowTable:
        """One row per test: `family` says of what (`chance`, `models`, `overall`, `conditions`, `gaps`).

        Columns: `family`, `experiment`, `metric`, the two sides (`first` and `second`, or `baseline` and `against`),
        `difference`, `interval_low`, `interval_high`, `p`, `mid_p`, `p_adjusted` and others; null where a family has none.
        """
        pairs = ({**group, **test, "tests": None} for group in self["models"] for test in group["tests"])
        families = {"chance": self["chance"], "models": pairs}
        families.update({name: self[name] for name in ("overall", "conditions", "gaps") if name in self})
        rows = [{"family": name, **row} for name, tests in families.items() for row in tests]
        return long([{key: value for key, value in row.items() if key not in _OF_FAMILY} for row in rows])

    @property
    def durations(self) -> _native.ArrowTable:
        """One row per group and duration: medians and restricted means with their intervals, in steps."""
        return long(self["durations"])

    @property
    def families(self) -> _native.ArrowTable:
        """One row per family of model comparisons: how many tests share an adjustment, and which difference is detectable."""
        return long([{**group, "tests": len(group["tests"])} for group in self["models"]])


class Gate(_GateKeys):
    """Verdicts on new episodes against old ones, with the episodes whose value changed as a long frame.

    Example:
        >>> import mirrorstats as ms
        >>> runs = ms.example_runs()
        >>> old, new = (ms.open(runs, where=f"model = 'GPT 5.1' and seed = {seed}") for seed in (1, 2))
        >>> ms.gate(old, new, metric="TSA").cells.column_names[:4]
        ['experiment', 'model', 'verdict', 'why']
    """

    @property
    def cells(self) -> _native.ArrowTable:
        """One row per experiment and model, as in `self["cells"]`: the verdict, why, both sides, the difference.

        Columns: `experiment`, `model`, `verdict`, `why` (text), `base_n`, `base_lost`, `new_n`, `new_lost` (int64),
        `base_mean`, `new_mean`, `difference`, `interval_low`, `interval_high`, `p_adjusted`, `p_held` (float64) and others.
        """
        return long([{key: value for key, value in cell.items() if key != "flips"} for cell in self["cells"]])

    @property
    def flips(self) -> _native.ArrowTable:
        """One row per scene in which the value changed: the episodes of both sides, and the steps that decided them.

        Columns: `experiment`, `model`, `base_episode_id` (text), `base_value` (int64), `base_timesteps`, `base_frames` (text),
        and the same of `new`.
        """
        rows = [
            {"experiment": cell["experiment"], "model": cell["model"], **flip}
            for cell in self["cells"]
            for flip in cell["flips"]
        ]
        sides = [
            (f"{side}_{name}", "int" if name == "value" else "text")
            for side in ("base", "new")
            for name in ("episode_id", "value", "timesteps", "frames")
        ]
        return long(rows, [("experiment", "text"), ("model", "text"), *sides])


# The columns shared by all tests of a family.
_OF_FAMILY = ("models", "tied", "tests", "detectable")


def long(rows: Iterable[Mapping[str, Any]], kinds: Optional[list[tuple[str, str]]] = None) -> _native.ArrowTable:
    """Nested answers as table rows: nested keys joined by `_`, lists as text; all columns unless `kinds` has them."""
    flat = [dict(_flat(row)) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    kinds = kinds or [(name, _kind([row.get(name) for row in flat])) for name in names]
    texts = {name for name, kind in kinds if kind == "text"}
    lines = (
        {name: str(value) if name in texts and value is not None else value for name, value in row.items()} for row in flat
    )
    return _native.table_of(kinds, "\n".join(map(json.dumps, lines)).encode())


def _flat(row: Mapping[str, Any], before: str = "") -> Any:
    for name, value in row.items():
        if name == "key" and isinstance(value, dict):
            yield from value.items()
        elif isinstance(value, dict):
            yield from _flat(value, f"{before}{name}_")
        elif isinstance(value, list) and name in ("n", "successes", "pairs") and len(value) == 2:
            yield from ((f"{before}{name}_first", value[0]), (f"{before}{name}_second", value[1]))
        elif isinstance(value, list):
            yield before + name, json.dumps(value) if any(isinstance(one, list) for one in value) else ", ".join(map(str, value))
        else:
            yield before + name, value


def _kind(values: list[Any]) -> str:
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {bool}:
        return "bool" if kinds else "text"
    return "int" if kinds <= {int} else "float" if kinds <= {int, float} else "text"

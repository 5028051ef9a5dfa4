"""The shapes of answers, for type checkers: dicts as JSON has them. Written by scripts/python-types.py from schemas/."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Optional, TypedDict, Union, overload

if TYPE_CHECKING:
    from . import _dict


class _Answer(TypedDict):
    question: str
    metric: str
    answer: str
    role: Literal["primary", "secondary"]


class Answer(_Answer, total=False):
    """One question about one metric, and its answer over all experiments."""
    caveats: list[str]


class _Catalog(TypedDict):
    name: str
    hash: str
    open: bool
    let: dict[str, str]
    metric: dict[str, Metric]
    experiment: dict[str, Experiment]


class Catalog(_Catalog, total=False):
    """A resolved definition file: its includes merged, in the order of definition."""
    domain: Optional[str]
    column: dict[str, DecimalColumn]
    factor: dict[str, Factor]


class CellChange(TypedDict):
    """A cell whose moments are not the same on both sides."""
    key: dict[str, KeyValue]
    metric: str
    kind: Literal["rate", "quantity"]
    numbers: Pair3
    mean_change: Optional[float]


class _CellDesign(TypedDict):
    experiment: str
    model: str
    episodes: int
    lost: int
    scenes: int
    shared_scenes: int
    most_repeats: int
    seeds: int
    unfinished: Optional[int]
    unfinished_steps: Optional[list[int]]


class CellDesign(_CellDesign, total=False):
    """The episodes of one cell."""
    condition: Optional[str]


class _CellRow(TypedDict):
    key: dict[str, KeyValue]
    metric: str
    kind: Literal["rate", "quantity"]
    episodes: int
    n: int
    sum: Decimal
    mean: Optional[float]
    se: Optional[float]
    intervals: Intervals
    few: bool


class CellRow(_CellRow, total=False):
    """One cell: the episodes of one group under one metric."""
    units: Optional[Units]
    unit_mean: Optional[float]
    lost: Optional[int]
    unusable_replies: Optional[int]


class _ChanceRow(TypedDict):
    experiment: str
    model: str
    metric: str
    role: Literal["chance", "reference"]
    level: Ratio
    successes: int
    n: int
    p: float
    mid_p: float
    p_adjusted: float
    verdict: Literal["above", "below", "not_separated"]


class ChanceRow(_ChanceRow, total=False):
    """One rate against one level."""
    condition: Optional[str]
    strategy: Optional[str]
    unit_mean: Optional[float]
    units: Optional[Units]
    losses: Optional[LossCases]


class CheckedFile(TypedDict):
    """One file that was looked at."""
    name: str
    complete: bool
    episodes: int
    steps: int
    checksums: Literal["none", "stale", "present"]


class _ClusterRow(TypedDict):
    experiment: str
    model: str
    metric: str
    n: int
    seeds: int
    mean: Optional[float]
    se: Optional[float]
    by_seed: Optional[Clustered]
    withheld: Optional[Withheld]


class ClusterRow(_ClusterRow, total=False):
    """The seeds of one cell."""
    condition: Optional[str]


class Clustered(TypedDict):
    """The mean of a cell as its clusters estimate it."""
    clusters: int
    se: float
    interval: Optional[Interval]
    icc: Optional[float]
    design_effect: Optional[float]


class ComparisonApart(TypedDict):
    """A comparison that is not made."""
    within: str
    between: list[str]


class _Contrast(TypedDict):
    model: str
    metric: str
    baseline: str
    against: str
    matching: Matching
    method: Literal["mcnemar", "fisher", "restricted_mean_paired", "restricted_mean", "student_paired", "welch", "units"]
    n: list[int]
    successes: Optional[list[int]]
    pairs: Optional[Pairs]
    undefined: int
    horizon: Optional[int]
    difference: Optional[float]
    interval: Optional[Interval]
    withheld: Optional[Withheld]
    p: Optional[float]
    mid_p: Optional[float]
    p_adjusted: Optional[float]
    separated: bool


class Contrast(_Contrast, total=False):
    """The difference of a model's mean between two experiments, by pairs if their scenes agree."""
    condition: Optional[str]
    unit_means: Optional[list[float]]
    simultaneous: Optional[Interval]
    equivalence: Optional[Equivalence]
    repeat_se: Optional[float]
    p_error: Optional[float]
    units: Optional[Units]
    losses: Optional[LossCases]
    selected: Optional[str]
    incomparable: Optional[str]


class _Control(TypedDict):
    of: str


class Control(_Control, total=False):
    """A declared contrast: another experiment minus this one."""
    on: list[str]


class CorrectRow(TypedDict):
    """The time to a correct decision; wrong ones compete, unfinished episodes are censored (Aalen and Johansen)."""
    correct: float
    wrong: float
    median: Optional[int]
    restricted: RestrictedMean
    withheld: Optional[Withheld]


class DecimalColumn(TypedDict):
    """A column of floats that are rounded to some digits after the point."""
    type: Literal["bool", "int", "float", "text"]
    constant: bool
    decimals: int
    unit: str


class DefinitionsName(TypedDict):
    """The definitions behind some scores."""
    name: str
    sha256: str


class Design(TypedDict):
    """The design that the traces declare; empty by default. Pairs are episodes with the same scene, which is a column of the traces."""
    kind: Optional[Literal["recording", "import", "reconstruction"]]
    cluster: Optional[Literal["seed"]]


class DesignAudit(TypedDict):
    """The design of a study: its cells, and what limits comparisons."""
    cells: list[CellDesign]
    findings: list[DesignFinding]


class DesignFinding(TypedDict):
    """One limit of the design."""
    check: Literal["copies", "losses", "replies", "origins", "mixture", "scenes", "repetitions", "units", "seeds", "budgets", "drivers"]
    finding: str
    touches: list[Literal["levels", "models", "experiments"]]


class Detectable(TypedDict):
    """The smallest difference of two rates that an exact test of n pairs, or of n episodes on each side, could have shown. In the most favourable case: all discordant pairs point the same way, or one side has no success. Else more is needed."""
    n: int
    level: float
    pairs: int
    smallest: float
    likely: Optional[float]


class _Dose(TypedDict):
    dose: float
    experiment: str
    successes: int
    n: int


class Dose(_Dose, total=False):
    """A rate at one dose."""
    unit_mean: Optional[float]


class _DurationRow(TypedDict):
    experiment: str
    model: str
    metric: str
    n: int
    finished: int
    mean: Optional[float]
    median: Optional[int]
    median_interval: Optional[MedianInterval]
    restricted: Optional[RestrictedMean]
    withheld: Optional[Withheld]
    correct: Optional[CorrectRow]


class DurationRow(_DurationRow, total=False):
    """One duration of one experiment and model."""
    condition: Optional[str]


class EpisodeName(TypedDict):
    """The name of an episode."""
    episode_id: str
    model: str
    experiment: str
    seed: int
    run: int


class Equivalence(TypedDict):
    """The test of a difference smaller than a margin."""
    margin: float
    p_adjusted: float
    is_shown: bool


class _Experiment(TypedDict):
    title: str
    order: int
    chance: dict[str, Optional[Chance]]
    reference: dict[str, list[Ratio]]


class Experiment(_Experiment, total=False):
    """One experiment that a definition file knows."""
    is_declared: bool
    control: Optional[Control]


class Fact(TypedDict):
    """One aggregate of one episode, or a column of the episode that something is compared with."""
    name: Optional[str]
    expression: str
    value: Optional[str]
    timesteps: list[int]
    is_of_episode: bool


class _Factor(TypedDict):
    title: str
    values: dict[str, float]


class Factor(_Factor, total=False):
    """A number that a group of experiments varies, such as the steps by which a mirror is late."""
    unit: str


class Family(TypedDict):
    """All comparisons of models under one rate or duration in one experiment."""
    experiment: str
    metric: str
    models: list[str]
    tied: list[list[str]]
    tests: list[PairTest]
    detectable: Optional[Reach]


class Finding(TypedDict):
    """One thing that is wrong with a trace."""
    code: Literal["unreadable", "empty-file", "not-parquet", "truncated", "corrupt-footer", "corrupt-data", "over-budget", "invalid-metadata", "newer-schema", "missing-column", "repeated-column", "wrong-type", "no-episodes", "null-in-required", "empty-string", "out-of-range", "negative-count", "t-start", "t-gap", "t-duplicate", "t-order", "inconsistent-constant", "episode-twice", "episode-in-two-files", "unknown-experiment", "unknown-action", "unknown-reply-status", "unknown-value", "invalid-color", "unseen-color", "stale-checksums", "experiment-overridden", "unknown-level", "split-episode", "unreadable-replies", "copied-episode"]
    severity: Literal["error", "note"]
    file: str
    row_group: Optional[int]
    episode: Optional[str]
    t: Optional[int]
    column: Optional[str]
    expected: str
    found: str
    help: str


class Flip(TypedDict):
    """A value of one episode that changed."""
    metric: str
    episode_id: str
    model: str
    experiment: str
    seed: int
    run: int
    value: Pair4
    timesteps: Pair5


class FlippedPair(TypedDict):
    """Two episodes of one scene with different values."""
    base: Played
    new: Played


class _Gap(TypedDict):
    experiment: str
    model: str
    scene: str
    episodes: int


class Gap(_Gap, total=False):
    """A scene that models have with which this one is compared by pairs, and that this one has not, or more than once."""
    condition: Optional[str]


class _GateCell(TypedDict):
    experiment: str
    model: str
    verdict: Literal["improved", "held", "cannot_say", "not_comparable", "regressed"]
    why: str
    base: GateSide
    new: GateSide
    difference: Optional[float]
    interval: Optional[Interval]
    p_adjusted: Optional[float]
    p_held: Optional[float]
    settled_by: Optional[int]
    flips: list[FlippedPair]


class GateCell(_GateCell, total=False):
    """One experiment and model, later against earlier."""
    base_model: Optional[str]
    condition: Optional[str]
    units: Optional[Units]


class _GateSide(TypedDict):
    n: int
    successes: Optional[int]
    mean: Optional[float]
    lost: int


class GateSide(_GateSide, total=False):
    """The episodes of one side of a cell."""
    unit_mean: Optional[float]


class ImprovementRow(TypedDict):
    """The probability that one model decides earlier than another, averaged over the experiments that both have."""
    metric: str
    first: str
    second: str
    experiments: list[str]
    probability: float
    interval: Optional[Interval]


class Input(TypedDict):
    """One file that was read."""
    path: str
    sha256: str
    bytes: int


class Interval(TypedDict):
    """Two bounds, `low <= high`."""
    low: float
    high: float


class LossCase(TypedDict):
    """A difference and its p value, not adjusted."""
    difference: Optional[float]
    p: Optional[float]


class LossCases(TypedDict):
    """A test with its lost episodes taken both ways; the verdict stands if it is the same in both, after Holm's adjustment."""
    lost: int
    lowest: LossCase
    highest: LossCase
    agree: bool


class _LossRow(TypedDict):
    experiment: str
    model: str
    metric: str
    n: int
    successes: int
    lost: int
    bounds: Interval
    interval: Interval


class LossRow(_LossRow, total=False):
    """One rate with lost episodes."""
    condition: Optional[str]


class Losses(TypedDict):
    """Losses, or that nothing is known of them."""
    recorded: bool
    rows: list[LossRow]


class _LostEpisode(TypedDict):
    episode_id: str
    model: str
    experiment: str
    seed: int
    run: int
    step: Optional[int]
    status: Optional[str]
    reason: str


class LostEpisode(_LostEpisode, total=False):
    """An episode that was lost without an answer."""
    condition: Optional[str]


class Matching(TypedDict):
    """The matching of the episodes of two blocks."""
    pairs: int
    alone: int
    repeated: int
    undeclared: int
    paired: bool


class MedianInterval(TypedDict):
    """The interval of a median."""
    low: int
    high: Optional[int]


class _Metric(TypedDict):
    title: str
    kind: Literal["rate", "quantity"]
    unit: str
    better: Literal["higher", "lower", "neither"]
    section: str
    help: str
    value: str
    when: Optional[str]
    se: Literal["sample", "population"]
    chance: Optional[Ratio]


class Metric(_Metric, total=False):
    """One metric, as defined."""
    decimals: int
    measures: Optional[Literal["rate", "duration", "count", "fraction"]]
    range: Optional[ValueRange]
    finished: Optional[str]
    completes: Optional[str]


class MetricEvidence(TypedDict):
    """One metric of one episode."""
    metric: str
    value: Optional[Decimal]
    timesteps: list[int]
    facts: list[Fact]


class Numbers(TypedDict):
    """The exact numbers of a cell."""
    episodes: int
    n: int
    sum: Decimal
    sum_sq: Decimal
    mean: Optional[float]
    se: Optional[float]


class Output(TypedDict):
    """One file of the report."""
    path: str
    sha256: str
    bytes: int


class _OverallRow(TypedDict):
    metric: str
    first: str
    second: str
    experiments: list[str]
    method: Literal["mantel_haenszel", "pooled_mcnemar", "units"]
    difference: Optional[float]
    interval: Optional[Interval]
    p: Optional[float]
    mid_p: Optional[float]
    p_adjusted: Optional[float]
    separated: bool
    is_crossed: bool


class OverallRow(_OverallRow, total=False):
    """Two models under one rate, over all experiments that both have."""
    opposite: list[str]
    losses: Optional[LossCases]


class Overlap(TypedDict):
    """Items of both sides, and items of one side only."""
    both: int
    only_before: list[str]
    only_after: list[str]


class Overlap2(TypedDict):
    """Items of both sides, and items of one side only."""
    both: int
    only_before: list[EpisodeName]
    only_after: list[EpisodeName]


class OwnColumn(TypedDict):
    """A column that the schema does not know."""
    name: str
    type: Optional[Literal["bool", "int", "float", "string", "unsupported"]]


class Pair(TypedDict):
    """A value of the scoring before, and the one after."""
    before: DefinitionsName
    after: DefinitionsName


class Pair2(TypedDict):
    """A value of the scoring before, and the one after."""
    before: Optional[str]
    after: Optional[str]


class Pair3(TypedDict):
    """A value of the scoring before, and the one after."""
    before: Optional[Numbers]
    after: Optional[Numbers]


class Pair4(TypedDict):
    """A value of the scoring before, and the one after."""
    before: Optional[Decimal]
    after: Optional[Decimal]


class Pair5(TypedDict):
    """A value of the scoring before, and the one after."""
    before: Optional[list[int]]
    after: Optional[list[int]]


class _PairTest(TypedDict):
    first: str
    second: str
    matching: Matching
    method: Literal["mcnemar", "fisher", "restricted_mean_paired", "restricted_mean", "student_paired", "welch", "units"]
    n: list[int]
    successes: Optional[list[int]]
    pairs: Optional[Pairs]
    undefined: int
    horizon: Optional[int]
    difference: Optional[float]
    interval: Optional[Interval]
    withheld: Optional[Withheld]
    p: Optional[float]
    mid_p: Optional[float]
    p_adjusted: Optional[float]
    separated: bool


class PairTest(_PairTest, total=False):
    """One model against another."""
    unit_means: Optional[list[float]]
    simultaneous: Optional[Interval]
    equivalence: Optional[Equivalence]
    repeat_se: Optional[float]
    p_error: Optional[float]
    units: Optional[Units]
    losses: Optional[LossCases]
    selected: Optional[str]
    incomparable: Optional[str]


class Pairs(TypedDict):
    """The 2x2 table of paired outcomes."""
    both: int
    first_only: int
    second_only: int
    neither: int


class Played(TypedDict):
    """An episode of one side."""
    episode_id: str
    value: Decimal
    timesteps: Optional[list[int]]


class RankRow(TypedDict):
    """The ranks of one model under one metric."""
    experiment: Optional[str]
    metric: str
    model: str
    best: int
    worst: int


class Reach(TypedDict):
    """The smallest differences that could have been shown; none if no outcome would have been enough."""
    method: Literal["mcnemar", "fisher", "restricted_mean_paired", "restricted_mean", "student_paired", "welch", "units"]
    n: int
    tests: int
    single: Optional[Detectable]
    family: Optional[Detectable]


class _Renderer(TypedDict):
    name: str


class Renderer(_Renderer, total=False):
    """A renderer, the part `renderer` of a fingerprint."""
    version: Optional[str]
    vendor: Optional[str]
    processor: Optional[str]


class Replies(TypedDict):
    """The replies of all episodes."""
    replies: int
    unusable: int
    cells: list[UnusableReplies]


class RepliesAnswer(TypedDict):
    """The replies of one start of a recording."""
    replies: int
    unreadable: dict[str, int]
    first_unreadable: Optional[UnreadableReply]


class RestrictedMean(TypedDict):
    """The mean duration up to a horizon."""
    horizon: int
    mean: float
    se: float
    interval: Optional[Interval]


class _RetestRow(TypedDict):
    experiment: str
    model: str
    metric: str
    scenes: int
    episodes: int
    unstable: int
    flipped: float
    between_scenes: Optional[float]
    within_scenes: Optional[float]


class RetestRow(_RetestRow, total=False):
    """The verdicts of one model on scenes that it played more than once."""
    condition: Optional[str]


class Rewritten(TypedDict):
    """A part of a definition that is not written the same on both sides."""
    name: str
    part: str
    text: Pair2


class Selection(TypedDict):
    """A filter over episodes."""
    condition: str
    by_results: bool


class SettingApart(TypedDict):
    """A setting in which recordings differ."""
    setting: str
    comparisons: list[ComparisonApart]


class Spend(TypedDict):
    """The spending."""
    cost_usd: float
    uncosted: int
    unanswered: int
    uncosted_usd_at_most: float
    tokens: int
    requests: int


class StyleOrigin(TypedDict):
    """The style of a report."""
    name: str
    sha256: str


class Trend(TypedDict):
    """The Cochran-Armitage test of no trend, stratified: Mantel's extension of the Mantel-Haenszel test."""
    z: float
    p: float
    strata: int


class _TrendRow(TypedDict):
    factor: str
    unit: str
    metric: str
    model: str
    doses: list[Dose]
    units: str
    trend: Optional[Trend]
    p_adjusted: Optional[float]
    verdict: Literal["above", "below", "not_separated"]


class TrendRow(_TrendRow, total=False):
    """A rate of one model at the doses of a factor, and the test of no trend."""
    condition: Optional[str]
    incomparable: Optional[str]


class Units(TypedDict):
    """Scenes, seeds or participants with several episodes."""
    n: int
    name: str
    too_few: bool


class UnreadableReply(TypedDict):
    """A reply that gave no decision."""
    episode_id: str
    step: int
    status: str
    text: Optional[str]
    fault: Optional[str]


class _UnusableReplies(TypedDict):
    experiment: str
    model: str
    replies: int
    unusable: int


class UnusableReplies(_UnusableReplies, total=False):
    """The replies of one cell."""
    condition: Optional[str]


class ValueRange(TypedDict, total=False):
    """The values that a metric can have."""
    least: Optional[int]
    most: Optional[int]


Decimal = float
Intervals = dict[str, Any]
KeyValue = Optional[Union[int, str]]
Ratio = str
Withheld = dict[str, Any]
Chance = Union[Literal["none"], Ratio, dict[str, Ratio]]

if TYPE_CHECKING:

    class _ChangesKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["definitions"], /) -> Pair: ...
        @overload
        def __getitem__(self, key: Literal["rewritten"], /) -> list[Rewritten]: ...
        @overload
        def __getitem__(self, key: Literal["metrics"], /) -> Overlap: ...
        @overload
        def __getitem__(self, key: Literal["episodes"], /) -> Overlap2: ...
        @overload
        def __getitem__(self, key: Literal["by"], /) -> list[str]: ...
        @overload
        def __getitem__(self, key: Literal["cells_compared"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["cells"], /) -> list[CellChange]: ...
        @overload
        def __getitem__(self, key: Literal["flips"], /) -> list[Flip]: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _ExplanationKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["episode_id"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["length"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["metrics"], /) -> list[MetricEvidence]: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _GateKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["metric"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["margin", "confidence"], /) -> float: ...
        @overload
        def __getitem__(self, key: Literal["verdict"], /) -> Literal["improved", "held", "cannot_say", "not_comparable", "regressed"]: ...
        @overload
        def __getitem__(self, key: Literal["caveats"], /) -> list[str]: ...
        @overload
        def __getitem__(self, key: Literal["cells"], /) -> list[GateCell]: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _ImportedKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["out"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["episodes", "steps"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["columns"], /) -> list[str]: ...
        @overload
        def __getitem__(self, key: Literal["own_columns"], /) -> list[OwnColumn]: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _ManifestKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["version"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["schema_version"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["style"], /) -> StyleOrigin: ...
        @overload
        def __getitem__(self, key: Literal["by", "metrics"], /) -> list[str]: ...
        @overload
        def __getitem__(self, key: Literal["where"], /) -> Optional[str]: ...
        @overload
        def __getitem__(self, key: Literal["inputs"], /) -> list[Input]: ...
        @overload
        def __getitem__(self, key: Literal["outputs"], /) -> list[Output]: ...
        @overload
        def __getitem__(self, key: Literal["definitions"], /) -> Catalog: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _RecordedKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["model"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["asked", "found", "recorded", "steps", "left_out", "stopped_by_limit"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["replies"], /) -> RepliesAnswer: ...
        @overload
        def __getitem__(self, key: Literal["lost"], /) -> list[LostEpisode]: ...
        @overload
        def __getitem__(self, key: Literal["spend"], /) -> Optional[Spend]: ...
        @overload
        def __getitem__(self, key: Literal["stopped"], /) -> bool: ...
        @overload
        def __getitem__(self, key: Literal["renderers"], /) -> list[Renderer]: ...
        @overload
        def __getitem__(self, key: Literal["traces", "logs"], /) -> list[str]: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _StatisticsKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["definitions", "definitions_hash", "design_note"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["confidence"], /) -> float: ...
        @overload
        def __getitem__(self, key: Literal["by", "pooled", "conclusions", "warnings", "headline"], /) -> list[str]: ...
        @overload
        def __getitem__(self, key: Literal["episodes", "families"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["where"], /) -> Optional[Selection]: ...
        @overload
        def __getitem__(self, key: Literal["departures"], /) -> Optional[list[str]]: ...
        @overload
        def __getitem__(self, key: Literal["not_comparable"], /) -> list[SettingApart]: ...
        @overload
        def __getitem__(self, key: Literal["audit"], /) -> DesignAudit: ...
        @overload
        def __getitem__(self, key: Literal["design"], /) -> Design: ...
        @overload
        def __getitem__(self, key: Literal["answers"], /) -> list[Answer]: ...
        @overload
        def __getitem__(self, key: Literal["cells"], /) -> list[CellRow]: ...
        @overload
        def __getitem__(self, key: Literal["chance"], /) -> list[ChanceRow]: ...
        @overload
        def __getitem__(self, key: Literal["models"], /) -> list[Family]: ...
        @overload
        def __getitem__(self, key: Literal["overall"], /) -> list[OverallRow]: ...
        @overload
        def __getitem__(self, key: Literal["ranks"], /) -> list[RankRow]: ...
        @overload
        def __getitem__(self, key: Literal["improvements"], /) -> list[ImprovementRow]: ...
        @overload
        def __getitem__(self, key: Literal["gaps"], /) -> list[Gap]: ...
        @overload
        def __getitem__(self, key: Literal["conditions"], /) -> list[Contrast]: ...
        @overload
        def __getitem__(self, key: Literal["trends"], /) -> list[TrendRow]: ...
        @overload
        def __getitem__(self, key: Literal["clusters"], /) -> list[ClusterRow]: ...
        @overload
        def __getitem__(self, key: Literal["durations"], /) -> list[DurationRow]: ...
        @overload
        def __getitem__(self, key: Literal["retests"], /) -> list[RetestRow]: ...
        @overload
        def __getitem__(self, key: Literal["losses"], /) -> Losses: ...
        @overload
        def __getitem__(self, key: Literal["replies"], /) -> Optional[Replies]: ...
        def __getitem__(self, key: str, /) -> Any: ...

    class _ValidationKeys(_dict.Answer):
        @overload  # type: ignore[override]
        def __getitem__(self, key: Literal["files"], /) -> list[CheckedFile]: ...
        @overload
        def __getitem__(self, key: Literal["findings"], /) -> list[Finding]: ...
        def __getitem__(self, key: str, /) -> Any: ...

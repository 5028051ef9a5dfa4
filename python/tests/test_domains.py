"""A trace of another domain, by a definition file alone."""

import mirrorstats as ms
import pandas
import pytest

DEFINITIONS = """
domain = "robots"

[column.success]
type = "bool"

[column.action_change]
type = "float"

[let]
solved = "first(success)"

[metric.SUCCESS]
title = "Success rate"
value = "solved is not null"
better = "higher"

[metric.JERKS]
title = "Jerky steps"
value = "count(action_change > 0.5)"
better = "lower"
"""


@pytest.fixture
def robots():
    rows = [
        {
            "episode_id": f"{model}-{run}",
            "model": model,
            "experiment": "pusht",
            "seed": 1,
            "run": run,
            "t": t,
            "success": t == solved,
            "action_change": (run * t % 4) / 4,
        }
        for model, endings in (("act", (2, 3, 0)), ("diffusion", (0, 3, 0)))
        for run, solved in enumerate(endings, start=1)
        for t in (1, 2, 3)
    ]
    return ms.import_steps(pandas.DataFrame(rows), definitions=DEFINITIONS)["out"]


def test_a_robot_trace_is_scored_compared_and_drawn(robots):
    study = ms.open(robots, definitions=DEFINITIONS)
    episodes = study.episodes.to_pylist()
    assert [(row["episode_id"], row["SUCCESS"], row["JERKS"]) for row in episodes[:3]] == [
        ("act-1", 1, 1),
        ("act-2", 1, 0),
        ("act-3", 0, 1),
    ]
    assert {row["model"] for row in study.cells.to_pylist()} == {"act", "diffusion"}
    assert "SUCCESS" in str(study.stats())
    assert "<svg" in study.figure("intervals").svg
    assert "act-1" in str(study.explain("pusht/act/s1/r1"))

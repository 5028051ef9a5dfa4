"""Traces of another domain than the mirror's: the definitions of `examples/domains` say what their columns are."""

import json
import os
import pathlib

import mirrorstats as ms
import pandas
import polars
import pytest

DEFINITIONS = pathlib.Path(os.environ["MIRRORSTATS_TEST_FIXTURES"]).parent / "examples/domains/robots.toml"
SOLVED = {"act": [3, 5, None, 2, 4, 3], "diffusion": [None, 6, None, None, 5, None]}


def rows():
    """Steps of two policies: who is solved at which step."""
    return [
        {
            "episode_id": f"{model}-{run}", "t": t, "model": model, "experiment": "pusht", "seed": 1, "run": run,
            "task": "push", "reward": t / 8, "action_change": run * t % 4 / 4, "success": t == solved,
        }
        for model, all_solved in SOLVED.items()
        for run, solved in enumerate(all_solved, 1)
        for t in range(1, 7)
    ]


@pytest.fixture
def trace(tmp_path):
    answer = ms.import_steps(rows(), tmp_path / "robots.parquet", definitions=DEFINITIONS)
    assert (answer["episodes"], answer["steps"]) == (12, 72)
    assert [column["name"] for column in answer["own_columns"]] == ["task", "reward", "action_change", "success"]
    return tmp_path / "robots.parquet"


def test_episodes_cells_and_steps_are_those_of_the_definitions(trace):
    study = ms.open(trace, definitions=DEFINITIONS)
    episodes = polars.DataFrame(study.episodes)
    by_model = {model: episodes.filter(polars.col("model") == model).sort("run") for model in SOLVED}
    for model, solved in SOLVED.items():
        assert by_model[model]["TIME"].to_list() == solved
        assert by_model[model]["SUCCESS"].to_list() == [at is not None for at in solved]
    cells = polars.DataFrame(study.cells)
    success = cells.filter(polars.col("metric") == "SUCCESS").sort("model")
    assert (success["n"].to_list(), success["sum"].to_list()) == ([6, 6], [5, 2])
    steps = polars.DataFrame(study.steps())
    assert steps.height == 72 and steps["success"].sum() == 7
    assert study.query("SELECT SUM(SUCCESS) AS solved FROM episodes").to_pandas()["solved"].tolist() == [7]


def test_frames_are_scored_without_a_file(trace):
    for frame in (pandas.DataFrame(rows()), polars.DataFrame(rows())):
        study = ms.open(frame, definitions=DEFINITIONS)
        assert polars.DataFrame(study.episodes)["SUCCESS"].sum() == 7


def test_statistics_gate_and_figures_know_the_metrics(trace, tmp_path, command):
    study = ms.open(trace, definitions=DEFINITIONS)
    stats = study.stats()
    assert {cell["metric"] for cell in stats["cells"]} >= {"SUCCESS", "DURATION"}
    shown = json.loads(command("stats", trace, "--definitions", DEFINITIONS, "--json").stdout)
    assert stats["answers"] == shown["answers"]
    later = tmp_path / "later.parquet"
    ms.import_steps([{**row, "success": False} for row in rows()], later, definitions=DEFINITIONS)
    gate = ms.gate(study, ms.open(later, definitions=DEFINITIONS), metric="SUCCESS")
    assert [cell["model"] for cell in gate["cells"]] == sorted(SOLVED)
    assert "<svg" in study.figure("spider").svg


def test_definitions_of_the_mirror_refuse_the_trace(trace):
    with pytest.raises(ms.Error, match="no column of the domain `mirror`"):
        ms.open(trace, definitions="paper").episodes
    with pytest.raises(ms.InputError, match="task"):
        ms.import_steps([{**row, "task": row["t"]} for row in rows()], definitions=DEFINITIONS)

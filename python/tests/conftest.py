"""What the tests share: the fixtures of the checkout, the command of the wheel, a small world."""

import os
import pathlib
import subprocess
import sys

import pytest

FIXTURES = pathlib.Path(os.environ["MIRRORSTATS_TEST_FIXTURES"])


@pytest.fixture(scope="session")
def paper():
    return str(FIXTURES / "paper")


@pytest.fixture(scope="session")
def recorded():
    return str(FIXTURES / "recorded")


@pytest.fixture
def command(tmp_path):
    """Runs the command of the wheel in a folder of its own."""

    def run(*words, code=0):
        program = pathlib.Path(sys.executable).parent / "mirrorstats"
        # pytest sets how wide lines are.
        environment = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
        ended = subprocess.run(
            [program, *map(str, words)], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert ended.returncode == code, ended.stderr
        return ended

    return run

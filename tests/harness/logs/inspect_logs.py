"""Logs of Inspect, of two agents by its mock model: `FOLDER/NAME.eval` and `.json`, one also in chunks and one mended.

An agent has a list per sample of what it does in turn: the tool that it calls, or its answer.
"""

import sys
import warnings
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

from inspect_ai import Task, eval
from inspect_ai.dataset import Sample
from inspect_ai.log import convert_eval_logs
from inspect_ai.log._recorders.chunked import convert_eval_logs_to_chunked
from inspect_ai.model import ModelOutput, ModelUsage, get_model
from inspect_ai.scorer import includes
from inspect_ai.solver import generate, use_tools
from inspect_ai.tool import tool

FOLDER = Path(sys.argv[1])

# Right tools are `add`, `add` and `look_up`; right answers 3, 7 and blue.
AGENTS = {
    "careful": [[("add", 1, 2), "3"], [("look_up", "four"), ("add", 3, 4), "7"], [("look_up", "sky"), "blue"]],
    "hasty": [[("look_up", "one"), ("look_up", "one"), "4"], ["7"], [("look_up", "error"), ("look_up", "sky"), "blue"]],
}
EPOCHS = 4


@tool
def add():
    async def execute(x: int, y: int):
        """Add two numbers.

        Args:
            x: The first.
            y: The second.
        """
        return str(x + y)

    return execute


@tool
def look_up():
    async def execute(word: str):
        """Look a word up.

        Args:
            word: The word.
        """
        if word == "error":
            raise PermissionError("locked")
        return "blue" if word == "sky" else "unknown"

    return execute


def output(action):
    if isinstance(action, str):
        made = ModelOutput.from_content("mockllm/model", action)
    else:
        name, *values = action
        arguments = dict(zip(("x", "y") if name == "add" else ("word",), values))
        made = ModelOutput.for_tool_call("mockllm/model", name, arguments)
    made.usage = ModelUsage(
        input_tokens=100, input_tokens_cache_read=20, output_tokens=7, total_tokens=127, total_cost=0.002
    )
    return made


def log(name, format):
    samples = [
        Sample(id=1, input="1 + 2?", target="3", metadata={"right_tool": "add", "odd": float("nan")}),
        Sample(id="two", input="3 + four? " + "Think. " * 200, target="7", metadata={"right_tool": "add", "odd": 1.5}),
        Sample(id="sky", input="The colour of the sky?", target="blue", metadata={"right_tool": "look_up"}),
    ]
    outputs = [output(action) for _ in range(EPOCHS) for actions in AGENTS[name] for action in actions]
    task = Task(
        dataset=samples, solver=[use_tools(add(), look_up()), generate()], scorer=includes(), name="sums", epochs=EPOCHS
    )
    # The order of samples is that of the outputs, epoch by epoch.
    model = get_model("mockllm/model", custom_outputs=outputs, memoize=False)
    (made,) = eval(task, model=model, log_format=format, log_dir=str(FOLDER / "raw"), max_samples=1, display="none")
    assert made.status == "success", made.error
    path = FOLDER / f"{name}.{format}"
    Path(made.location).rename(path)
    return path


FOLDER.mkdir(parents=True, exist_ok=True)
warnings.simplefilter("ignore")
for name in AGENTS:
    log(name, "eval")
log("careful", "json")
convert_eval_logs_to_chunked(str(FOLDER / "careful.eval"), str(FOLDER / "chunked"), chunk_size=3)
# As older versions packed; a sample is there twice, and its first version is not JSON.
with ZipFile(FOLDER / "careful.eval") as source, ZipFile(FOLDER / "deflated.eval", "w", ZIP_DEFLATED) as target:
    target.writestr("samples/1_epoch_1.json", "{")
    for member in source.namelist():
        target.writestr(member, source.read(member))

"""Makes what `view.py` opens with Inspect View: logs of its own `eval` with its mock model.

`inspect_logs.py FRAMES OUT`: `OUT/list` has 10,000 samples of one message, `OUT/steps` 20 samples of 100 steps, each with one of the
PNG files of FRAMES and an answer.
"""

import base64
import pathlib
import sys

from inspect_ai import Task, eval
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.model import ChatMessageUser, ContentImage, ContentText, get_model
from inspect_ai.scorer import includes
from inspect_ai.solver import Generate, TaskState, generate, solver

SAMPLES = 10_000
EPISODES = 20
STEPS = 100


@solver
def steps(frames):
    """As an agent with a history of one step: each request has the picture of its step alone; the sample keeps all."""

    async def solve(state: TaskState, _generate: Generate) -> TaskState:
        model = get_model()
        for step in range(STEPS):
            message = ChatMessageUser(
                content=[ContentText(text=f"Step {step + 1}"), ContentImage(image=frames[step % len(frames)])]
            )
            answer = await model.generate([message])
            state.messages += [message, answer.message]
        return state

    return solve


def main():
    folder, out = map(pathlib.Path, sys.argv[1:])
    pictures = [
        "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode() for file in sorted(folder.glob("*.png"))
    ]
    assert len(pictures) >= STEPS, f"{folder}: {STEPS} PNG files are needed, found {len(pictures)}"
    model = get_model("mockllm/model")
    dataset = lambda count: MemoryDataset([Sample(input=f"Question {n + 1}", target="answer") for n in range(count)])
    common = {"model": model, "display": "none", "score": True}
    eval(Task(dataset(SAMPLES), generate(), includes(), name="list"), log_dir=str(out / "list"), **common)
    eval(Task(dataset(EPISODES), steps(pictures), includes(), name="steps"), log_dir=str(out / "steps"), **common)


main()

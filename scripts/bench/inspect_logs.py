"""Makes what `view.py` opens with Inspect View: logs of its own `eval` with its mock model.

`inspect_logs.py FRAMES OUT`: `OUT/list` has 10,000 samples of one message, `OUT/steps` 20 samples of 100 steps, each with one of the
PNG files of FRAMES and an answer.
"""

import base64
import pathlib
import sys

from inspect_ai import Task, eval
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.model import ChatMessageUser, ContentImage, ContentText, ModelOutput, ModelUsage, get_model
from inspect_ai.scorer import includes
from inspect_ai.solver import Generate, TaskState, generate, solver

SAMPLES = 10_000
EPISODES = 20
STEPS = 100


def answered(_input, _tools, _choice, _config):
    """An answer that says what it used: the mock model would fetch an encoding to count it."""
    output = ModelOutput.from_content(model="mockllm", content="I turn left to look around.")
    output.usage = ModelUsage(input_tokens=1000, output_tokens=10, total_tokens=1010)
    return output


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
    model = get_model("mockllm/model", custom_outputs=answered)
    dataset = lambda count: MemoryDataset([Sample(input=f"Question {n + 1}", target="answer") for n in range(count)])
    common = {"model": model, "display": "none", "score": True}
    tasks = {"list": (SAMPLES, generate()), "steps": (EPISODES, steps(pictures))}
    for name, (count, plan) in tasks.items():
        [log] = eval(Task(dataset=dataset(count), solver=plan, scorer=includes(), name=name), log_dir=str(out / name), **common)
        assert log.status == "success", f"{name}: {log.error.message}"


if __name__ == "__main__":
    main()

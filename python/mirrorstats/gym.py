"""The mirror world as a Gymnasium environment.

    import gymnasium

    env = gymnasium.make("mirrorstats/E1-v0", record="runs", model="my-policy")
    observation, info = env.reset(seed=1, options={"run": 3})

Each built-in experiment has an id, and `MirrorEnv` takes files of your own. What an agent sees is what the agents of
`mirrorstats.record` see. Scenes are theirs too: the same seed and run give the same scene. Needs `gymnasium` and `numpy`:
`pip install 'mirrorstats[gym]'`.
"""

from __future__ import annotations

import copy
import json
import time
from typing import Any, Literal, Optional, Union

import gymnasium
import numpy
from gymnasium import spaces

from . import _native
from ._paths import Path, Spool, Toml, text, toml_file

Observation = dict[str, Any]

__all__ = ["DiscreteActions", "MirrorEnv", "register"]


class MirrorEnv(gymnasium.Env[Observation, dict[str, Any]]):
    """Episodes of one experiment.

    An observation is a dict: `image` (height, width, 3), uint8; `position` (x, y), m; `heading`, in steps of 30 degrees
    counter-clockwise from +x; `bumped`, 1 if the last move was blocked; `steps_left`, this one included; `previous_action`, the
    index of an action and 1, or 0 at the start. `info["prompt"]` has the words that a model gets: `system` and `user`.

    An action is a dict with an index for each key that a reply has. `env.unwrapped.choices` lists their texts: `action` (the
    letters of the prompt), `selected_cube`, `identification` (the claim about the own colour), and what else the experiment
    asks for. A text is taken as the reply of a language model.

    The reward is 0 until the episode ends. It is then the value of the experiment's first metric, such as TSA, by the
    definitions that score the experiment; `info["scores"]` has all metrics, null where a metric is undefined. `terminated` means
    `done`, or that the mark is reached; `truncated` means that all steps are used up. The last observation repeats the picture.

    Args:
        experiment: a built-in name, a TOML file, TOML text, or a dict.
        seed: the seed of the first episode without a seed of its own.
        run: the run of the first episode of a seed; each further episode has the next run.
        config: a configuration of the world: a TOML file, TOML text, or a dict. For training, `{"eye": {"width": 84,
            "height_px": 84, "samples": 0}}` draws small frames.
        record: a folder for the trace and the log. An episode that is cut off is listed there as lost.
        model: the name in tables.
        condition: the condition in tables.
        privileged: puts ground truth into `info["truth"]`: `body_color`, `mirror_visible`, and counts of pixels by
            `visibility`. The trace says so.
        visibility: when rays are cast: at `each_step`, or `at_end`, when the trace is written. The trace is the same. The log is
            written with `each_step` alone.
        render_mode: `rgb_array` or None.

    Raises:
        ArgumentError, RecordError: an experiment, a configuration or a folder that cannot be used.
        ValueError: an action or a seed that is out of range.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(
        self,
        experiment: Toml = "E1",
        *,
        seed: int = 1,
        run: int = 1,
        config: Optional[Toml] = None,
        record: Optional[Path] = None,
        model: str = "harness",
        condition: Optional[str] = None,
        privileged: bool = False,
        visibility: Literal["each_step", "at_end"] = "each_step",
        render_mode: Optional[str] = None,
    ) -> None:
        if visibility not in ("each_step", "at_end"):
            raise ValueError(f"visibility: expected each_step or at_end, found {visibility!r}")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: expected rgb_array or None, found {render_mode!r}")
        self._spool = Spool()
        folder = self._spool.new("episodes") if record is None else text(record, self._spool)
        options = {
            "experiment": toml_file(experiment, "experiment", self._spool),
            "out": folder,
            "model": model,
            "condition": condition,
            "config": None if config is None else toml_file(config, "config", self._spool),
            "no-log": record is None,
        }
        self._world: Optional[_native.Environment] = _native.Environment(json.dumps(options), privileged, visibility == "each_step", record is None)
        about = json.loads(self._open().description())
        self.render_mode = render_mode
        self.choices: dict[str, Optional[list[str]]] = about["choices"]
        self._free_texts: list[str] = about["free_texts"]
        self._size: tuple[int, int] = (about["height"], about["width"])
        self._about = {key: about[key] for key in ("experiment", "title", "world")}
        self._seed, self._run, self._next = _number("seed", seed, 0), _number("run", run, 1), run
        self._last: Optional[Observation] = None
        self._asked_at = 0.0
        self.observation_space = spaces.Dict(
            {
                "image": spaces.Box(0, 255, (about["height"], about["width"], 3), numpy.uint8),
                "position": spaces.Box(-100.0, 100.0, (2,), numpy.float32),
                "heading": spaces.Discrete(12),
                "bumped": spaces.Discrete(2),
                "steps_left": spaces.Discrete(about["steps"] + 1),
                "previous_action": spaces.Discrete(len(self._texts("action")) + 1),
            }
        )
        self.action_space = spaces.Dict({key: _space(texts) for key, texts in self.choices.items()})

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode: that of `seed` and of `options["run"]`, or of the next run."""
        super().reset(seed=seed)
        if seed is not None:
            self._seed, self._next = _number("seed", seed, 0), self._run
        run = _number("run", (options or {}).get("run", self._next), 1)
        self._next = run + 1
        message, frame = self._open().reset(self._seed, run)
        return self._shown(message, frame or b"", {**copy.deepcopy(self._about), "seed": self._seed, "run": run})

    def step(
        self, action: Union[dict[str, Any], str]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Gives a reply; an action, or the text of a language model."""
        reply = action if isinstance(action, str) else json.dumps(self._reply(action))
        waited = min(int(1000 * (time.monotonic() - self._asked_at)), 2**31 - 1)
        message, frame = self._open().step(reply, waited)
        if frame is not None:
            observation, info = self._shown(message, frame, {})
            return observation, 0.0, False, False, info
        ended = json.loads(message)
        assert self._last is not None
        last = {**copy.deepcopy(self._last), "steps_left": 0}
        info = {"episode_id": ended["episode_id"], "metric": ended["metric"], "scores": ended["metrics"]}
        return last, float(ended["metrics"][ended["metric"]] or 0), ended["done"], not ended["done"], info

    def render(self) -> Any:
        """The frame of the last observation, or None without `render_mode`."""
        return self._last["image"].copy() if self._last is not None and self.render_mode else None

    def close(self) -> None:
        """Writes the trace and the log, and gives the folder back. An episode under way is lost."""
        if self._world is not None:
            self._world.close()
            self._world = None
            self._spool.clear()

    def _open(self) -> _native.Environment:
        if self._world is None:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed; make another one")
        return self._world

    def _shown(self, message: str, frame: bytes, info: dict[str, Any]) -> tuple[Observation, dict[str, Any]]:
        told = json.loads(message)
        height, width = self._size
        letters = self._texts("action")
        observation = {
            "image": numpy.frombuffer(frame, numpy.uint8).reshape(height, width, 3).copy(),
            "position": numpy.array(told["position"], numpy.float32),
            "heading": round(told["heading"] / 30) % 12,
            "bumped": int(told["bumped"]),
            "steps_left": told["steps_left"],
            "previous_action": letters.index(told["previous_action"]) + 1 if told["previous_action"] else 0,
        }
        info["prompt"] = {"system": told["system"], "user": told["user"]}
        if told["truth"] is not None:
            info["truth"] = told["truth"]
        self._last, self._asked_at = observation, time.monotonic()
        return dict(observation), info

    def _reply(self, action: dict[str, Any]) -> dict[str, Any]:
        """The reply of an action, with an empty text for each key of free text."""
        if not isinstance(action, dict) or set(action) != set(self.choices):
            raise ValueError(f"action: expected a dict with the keys {', '.join(self.choices)}, found {action!r}")
        reply: dict[str, Any] = dict.fromkeys(self._free_texts, "")
        for key, texts in self.choices.items():
            value = action[key]
            if texts is None:
                reply[key] = float(numpy.asarray(value).item())
            elif 0 <= int(value) < len(texts):
                reply[key] = texts[int(value)]
            else:
                raise ValueError(f"action[{key!r}]: expected 0 to {len(texts) - 1}, found {value!r}")
        return reply

    def _texts(self, key: str) -> list[str]:
        return self.choices[key] or []


class DiscreteActions(gymnasium.ActionWrapper[Observation, int, dict[str, Any]]):
    """One number per action, for learners that need it: each move, then `done` with each answer.

    A move claims nothing: `unknown` or `none` where the reply allows it. `texts` lists the meaning of each number. Of several
    keys that name a colour, all get the same one.
    """

    def __init__(self, env: gymnasium.Env[Observation, dict[str, Any]]) -> None:
        super().__init__(env)
        world = env.unwrapped
        if not isinstance(world, MirrorEnv):
            raise TypeError(f"env: expected a MirrorEnv, found {type(world).__name__}")
        choices = world.choices
        numeric = [key for key, texts in choices.items() if texts is None]
        if numeric:
            raise ValueError(f"{numeric[0]}: a number cannot be one of a list of actions; use the dict of actions")
        texts = {key: list(values or []) for key, values in choices.items()}
        letters = texts.pop("action")
        silent = {key: _silent(values) for key, values in texts.items()}
        answers = list(dict.fromkeys(value for values in texts.values() for value in values))
        self.texts: list[dict[str, str]] = [{"action": letter, **silent} for letter in letters if letter != "done"]
        if "done" in letters:
            for answer in answers:
                named = {key: answer if answer in values else silent[key] for key, values in texts.items()}
                self.texts.append({"action": "done", **named})
        self.action_space: spaces.Space[Any] = spaces.Discrete(len(self.texts))

    def action(self, action: int) -> dict[str, Any]:
        world = self.env.unwrapped
        assert isinstance(world, MirrorEnv)
        return {key: (world.choices[key] or []).index(value) for key, value in self.texts[int(action)].items()}


def register() -> None:
    """Registers each built-in experiment as `mirrorstats/NAME-v0`."""
    for name in _native.experiments():
        id = f"mirrorstats/{name}-v0"
        if id not in gymnasium.registry:
            gymnasium.register(id, "mirrorstats.gym:MirrorEnv", kwargs={"experiment": name})


def _silent(texts: list[str]) -> str:
    return next((word for word in ("none", "unknown") if word in texts), texts[0])


def _space(texts: Optional[list[str]]) -> spaces.Space[Any]:
    return spaces.Box(-1e6, 1e6, (), numpy.float64) if texts is None else spaces.Discrete(len(texts))


def _number(name: str, value: Any, least: int) -> int:
    if not isinstance(value, (int, numpy.integer)) or isinstance(value, bool) or not least <= value < 2**31:
        words = f"{name}: expected a whole number from {least} to {2**31 - 1}, as a trace stores it, found {value!r}"
        raise ValueError(f"{words}\n  help: for a larger {name}, give {name} % 2**31")
    return int(value)


register()

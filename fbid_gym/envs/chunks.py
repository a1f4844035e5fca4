"""A batch of environments in chunks, each of one robot, which threads step side by side."""

import ctypes
import json
import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from typing import Any

import numpy as np

from fbid_gym.checks import check_finite, real_numbers
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.policy_step import Step
from fbid_gym.errors import FbidError, InvalidValueError, ShapeError
from fbid_gym.options import Flag, Whole, options_of
from fbid_gym.runtime.config import EnvConfig

NUM_ENVS = Whole(1, 65_536)  # so many of the humanoid take some 20 GiB
NUM_THREADS = Whole(1, 1024)
MOST_STEPS = Whole(1, 2**31)
# Environments of a chunk: more would not stay in the caches, fewer pay for Python more often.
_MOST_TOGETHER = 64


class Chunks:
    """`num_envs` environments on `num_threads` threads, in chunks that follow each other.

    Physics and compiled laws leave Python's lock, so the threads overlap. What an environment
    computes does not depend on the chunk it is in.
    """

    def __init__(
        self,
        configs: EnvConfig | Sequence[EnvConfig],
        num_envs: int,
        num_threads: int = 1,
        max_episode_steps: int | None = None,
        stagger: bool = False,
    ) -> None:
        """Build the chunks from one config, or from one for each robot.

        The other arguments are those of `RobotVectorEnv`. Raises FbidError as `EnvBatch` does, and
        where robots share no observation or action, or outnumber the environments.
        """
        configs = (configs,) if isinstance(configs, EnvConfig) else tuple(configs)
        num_envs = NUM_ENVS.check("num_envs", num_envs)
        num_threads = NUM_THREADS.check("num_threads", num_threads)
        most = None
        if max_episode_steps is not None:
            most = MOST_STEPS.check("max_episode_steps", max_episode_steps)
        threads = min(num_threads, num_envs)
        if num_envs < len(configs):
            expected = f"one for each of the {len(configs)} robots, or more"
            raise InvalidValueError("num_envs", num_envs, expected)
        share, each = math.ceil(threads / len(configs)), _evenly(num_envs, len(configs))
        self.kinds = [  # the chunks of each robot
            [
                EnvBatch(config, size, num_envs, most)
                for size in _evenly(own, share * math.ceil(own / share / _MOST_TOGETHER))
            ]
            for config, own in zip(configs, each, strict=True)
        ]
        self.batches = [batch for kind in self.kinds for batch in kind]
        ends = np.cumsum([0, *(batch.num_envs for batch in self.batches)]).tolist()
        self.slices = [slice(a, b) for a, b in pairwise(ends)]
        for kind in self.kinds[1:]:
            _check_alike(self.batches[0], kind[0])
        self.num_envs = num_envs
        self.num_steps = self.batches[0].num_steps
        parts = np.arange(1, num_envs + 1) if Flag().check("stagger", stagger) else num_envs
        self._first = np.broadcast_to(-(-self.num_steps * parts // num_envs), num_envs)
        self._closed = False
        self._helpers = threads - 1
        self._pool = ThreadPoolExecutor(self._helpers) if self._helpers else None

    def seed(self, env: int, rng: np.random.Generator) -> None:
        """Give one environment a random generator of its own."""
        self.check_open()
        if not 0 <= env < self.num_envs:
            raise InvalidValueError("env", env, f"0 to {self.num_envs - 1}")
        chunk = bisect_right(self.slices, env, key=lambda part: part.start) - 1
        self.batches[chunk].seed(env - self.slices[chunk].start, rng)

    def reset(self, chosen: np.ndarray | None = None, command: Any = None) -> None:
        """Start new episodes where `chosen` (N,) is true; by default first ones, everywhere.

        They follow `command`, as `set_command` takes it; by default commands are drawn.
        """
        self.check_open()
        asked = None if command is None else self.check_command(command)
        steps = self._first if chosen is None else np.full(self.num_envs, self.num_steps)
        chosen = np.ones(self.num_envs, bool) if chosen is None else chosen
        for batch, part in zip(self.batches, self.slices, strict=True):
            if len(ids := np.flatnonzero(chosen[part])):
                batch.reset(ids, None if asked is None else asked[part][ids], steps[part][ids])

    def set_command(self, command: Any) -> None:
        """Have the environments follow a command until their episodes end, and not those drawn.

        Commands have the entries and units of the observation: m/s ahead, m/s to the left and rad/s
        for a gait, the height of the base in m for balance. Give one for all, or a row for each.
        Raises FbidError, and changes nothing, for other entries or a task without commands.
        """
        self.check_open()
        asked = self.check_command(command)
        for batch, part in zip(self.batches, self.slices, strict=True):
            batch.set_command(np.arange(batch.num_envs), asked[part])

    def check_command(self, command: Any) -> np.ndarray:
        """Return the command of each environment, or raise an FbidError, see `set_command`."""
        return self.batches[0].check_command(command, self.num_envs)

    def observation(self) -> np.ndarray:
        """Return the current observations, (N, O) float32."""
        self.check_open()
        return np.concatenate([batch.observation() for batch in self.batches])

    def every(self, name: str) -> np.ndarray:
        """Return an attribute of `EnvBatch` of all environments, (N, ...)."""
        self.check_open()
        return np.concatenate([getattr(batch, name) for batch in self.batches])

    def step(self, action: np.ndarray) -> Step:
        """Check the actions (N, A), then hold them for one policy step."""
        self.check_open()
        action = self.batches[0].check_action(action, self.num_envs)
        left, steps = iter(range(len(self.batches))), dict[int, Step]()

        def work() -> None:
            for chunk in left:
                steps[chunk] = self.batches[chunk].step(action[self.slices[chunk]])

        # The caller works, too: a caller that sleeps invites the system to run all the threads it
        # woke on its own core.
        jobs = [self._pool.submit(work) for _ in range(self._helpers)] if self._pool else []
        try:
            work()
        finally:  # whoever hears of an error may reset or load at once
            for _ in left:
                pass  # nobody begins another chunk
            if jobs:
                wait(jobs)
        for job in jobs:
            job.result()
        return _joined([steps[chunk] for chunk in range(len(self.batches))])

    def close(self) -> None:
        """Stop the threads and give back the memory; nothing steps any more."""
        self._closed = True
        if self._pool is not None:
            self._pool.shutdown()
        self.batches.clear()
        self.kinds.clear()
        # Of what is free the C library of Linux keeps hundreds of megabytes until it is asked.
        if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
            trim(0)

    def state_dict(self) -> dict[str, np.ndarray]:
        """Return the exact state of all environments as named arrays.

        It does not depend on the number of threads. "config" holds what the environments are, as
        JSON in bytes. Of several robots, names begin with the robot's number in the list.
        """
        self.check_open()
        state = dict[str, np.ndarray]()
        for head, batches in self._named_kinds():
            parts = [batch.state_dict() for batch in batches]
            state |= {head + n: np.concatenate([part[n] for part in parts]) for n in parts[0]}
        own = self.batches[0].config.as_dict()
        if len(self.kinds) > 1:
            own["robot"] = [kind[0].robot.name for kind in self.kinds]
        config = json.dumps(own, sort_keys=True, default=str)
        return state | {"config": np.frombuffer(config.encode(), np.uint8).copy()}

    def _named_kinds(self) -> list[tuple[str, list[EnvBatch]]]:
        """Return the beginnings of each robot's names in a state, and its chunks."""
        if len(self.kinds) == 1:
            return [("", self.kinds[0])]
        return [(f"{number}.", batches) for number, batches in enumerate(self.kinds)]

    def load_state_dict(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state_dict` of as many environments of the same kind.

        Raises FbidError, and loads nothing, if the state is of other environments.
        """
        own = self.state_dict()
        config = own.pop("config")
        if not isinstance(state, Mapping):
            raise InvalidValueError("state", state, "a dictionary from names to arrays")
        if "config" not in state:
            raise InvalidValueError("state", list(state), "'config' among its arrays")
        # Options that are younger than the state have their defaults in it.
        younger = {name: option.default for name, option in options_of(EnvConfig).items()}
        told = _read_config(state["config"])
        for name, value in _read_config(config).items():
            if (younger | told).get(name) != value:
                called = f"state of environments with {name}"
                raise InvalidValueError(called, told.get(name), value)
        given = {name: checked_array(name, value, state) for name, value in own.items()}
        parts = list[tuple[EnvBatch, dict[str, np.ndarray]]]()
        for head, batches in self._named_kinds():
            mine = {n.removeprefix(head): v for n, v in given.items() if n.startswith(head)}
            ends = np.cumsum([0, *(batch.num_envs for batch in batches)]).tolist()
            for batch, (a, b) in zip(batches, pairwise(ends), strict=True):
                parts.append((batch, {name: value[a:b] for name, value in mine.items()}))
        for batch, part in parts:
            batch.check_state(part)
        for batch, part in parts:
            batch.load_state_dict(part)

    def check_open(self) -> None:
        """Raise an error if they are closed."""
        if self._closed:
            raise FbidError("These environments are closed: make others.")


def _evenly(count: int, parts: int) -> list[int]:
    """Return the sizes of so many parts of a count, none of them empty."""
    bounds = np.linspace(0, count, min(parts, count) + 1).astype(int)
    return np.diff(bounds).tolist()


def _check_alike(first: EnvBatch, other: EnvBatch) -> None:
    """Raise InvalidValueError for robots that cannot share a policy."""
    names = [batch.robot.name for batch in (first, other)]
    seen = [batch.observation_names for batch in (first, other)]
    if seen[0] != seen[1]:
        only = sorted(set(seen[0]) ^ set(seen[1]))[:1] or ["their order"]
        expected = "robots with one observation, such as observation='body' of as many feet; these"
        expected += f" differ in {only[0]!r} ({len(seen[0])} and {len(seen[1])} entries)"
        raise InvalidValueError("robots", names, expected)
    sizes = [len(batch.action_names) for batch in (first, other)]
    if sizes[0] != sizes[1]:
        expected = f"robots with one action; these have {sizes[0]} and {sizes[1]} entries"
        raise InvalidValueError("robots", names, expected)


def _read_config(packed: Any) -> dict[str, Any]:
    """Read the environments in the "config" of their state."""
    try:
        config = json.loads(np.asarray(packed, np.uint8).tobytes())
    except (TypeError, ValueError, OverflowError, RecursionError):
        config = None
    if not isinstance(config, dict):
        raise InvalidValueError("state 'config'", packed, "JSON as `state_dict` writes it")
    return config


def checked_array(name: str, own: np.ndarray, state: Mapping[str, Any]) -> np.ndarray:
    """Return an array of a state as it was saved: the kind, the shape and finite numbers."""
    if name not in state:
        raise InvalidValueError("state", list(state), f"{name!r} among its arrays")
    called, expected = f"state {name!r}", f"an array of {own.dtype}"
    array = real_numbers(called, state[name], expected)
    if array.shape != own.shape:
        raise ShapeError(called, array.shape, f"{own.shape}, as of these environments")
    if not np.can_cast(array.dtype, own.dtype, "same_kind"):
        raise InvalidValueError(called, state[name], expected)
    if array.dtype.kind == "f":
        check_finite(called, array)
    return array.astype(own.dtype, copy=False)


def _joined(steps: list[Step]) -> Step:
    if len(steps) == 1:
        return steps[0]
    info = dict[str, np.ndarray]()
    for name in steps[0].info:
        parts = [step.info[name] for step in steps if name in step.info]
        # Only entries that all have in the same shape: robots differ in their joints.
        if len(parts) == len(steps) and len({part.shape[1:] for part in parts}) == 1:
            info[name] = np.concatenate(parts)
    whole = map(np.concatenate, zip(*(step[:-1] for step in steps), strict=True))
    return Step._make((*whole, info))

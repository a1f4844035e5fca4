"""Many episodes in parallel, with measurements of each.

A batch that stops as soon as enough episodes have ended favours short ones: while one environment
falls ten times, its neighbours are still upright in their first. So each environment is given its
share of the episodes beforehand, plays exactly these to their end however long they last, and what
it does afterwards is not counted.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from fbid_gym.errors import InvalidValueError

Actor = Callable[[np.ndarray], np.ndarray]
"""Observations (N, O) to actions (N, A)."""


@dataclass(frozen=True)
class Episodes:
    """Complete episodes, one entry per episode, in the order of environment and then time.

    A column holds NaN where the environment does not report the quantity.
    """

    returned: np.ndarray  # (E,) sum of rewards
    length: np.ndarray  # (E,) policy steps
    seconds: np.ndarray  # (E,) the same, s
    # (E,) 1.0 if the episode reached its time limit, 0.0 if it ended by itself.
    survived: np.ndarray
    # (E,) mean over time of the horizontal distance from the commanded velocity, m/s.
    velocity_error: np.ndarray
    # (E,) mean over time of the distance from the commanded yaw rate, rad/s.
    turning_error: np.ndarray
    height_error: np.ndarray  # (E,) root mean square of the base height minus the commanded one, m
    torque: np.ndarray  # (E,) root mean square over joints, control ticks and steps, N m
    power: np.ndarray  # (E,) mean over time of sum |torque x joint velocity|, W
    # (E,) the same integrated over the episode, J; a fall ends it, so compare the power.
    energy: np.ndarray
    slip: np.ndarray  # (E,) mean speed of the contact points that touch the ground, m/s
    distance: np.ndarray  # (E,) horizontal way of the base, m
    # (E,) energy over weight times distance, 1; bounded for standing robots, as the task says.
    cost_of_transport: np.ndarray
    # (E,) mean distance of the feet that came down from where they were planned to, m.
    foothold_error: np.ndarray
    pushes: np.ndarray  # (E,) pushes that began
    pushes_survived: np.ndarray  # (E,) pushes that began, less the last one if the robot then fell
    strongest_push: np.ndarray  # (E,) largest horizontal force, N
    environment: np.ndarray  # (E,) int: the environment that played it
    # E reasons: "" at the time limit, otherwise such as "fall" or "diverged".
    termination: tuple[str, ...]

    def __len__(self) -> int:
        """Count the episodes."""
        return len(self.returned)

    def rows(self) -> list[dict[str, Any]]:
        """One dict of plain numbers per episode, by column name."""
        names = [item.name for item in fields(self)]
        columns = (np.asarray(getattr(self, name)).tolist() for name in names)
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


@dataclass(frozen=True)
class Metric:
    """A number per episode, and how to read it."""

    name: str  # column of `Episodes`
    label: str  # as printed
    unit: str
    better: int  # 1 if more is better, -1 if less is, 0 if neither


METRICS = (
    Metric("returned", "return", "", 1),
    Metric("survived", "survival", "share", 1),
    Metric("seconds", "time upright", "s", 1),
    Metric("velocity_error", "velocity error", "m/s", -1),
    Metric("turning_error", "yaw rate error", "rad/s", -1),
    Metric("height_error", "height error", "m", -1),
    Metric("torque", "torque", "N m", -1),
    Metric("power", "power", "W", -1),
    Metric("energy", "energy", "J", 0),
    Metric("slip", "foot slip", "m/s", -1),
    Metric("distance", "distance", "m", 0),
    Metric("cost_of_transport", "cost of transport", "", -1),
    Metric("foothold_error", "foothold error", "m", -1),
    Metric("pushes", "pushes", "", 0),
    Metric("pushes_survived", "pushes survived", "", 0),
    Metric("strongest_push", "strongest push", "N", 0),
)
"""Measurements in the order in which they are printed."""

_MEAN_KEYS = ("power", "slip", "velocity_error", "turning_error")
_SQUARE_KEYS = ("height_error", "torque_rms")
_LAST_KEYS = ("distance", "cost_of_transport", "foothold_error")  # of the episode so far


class _Tally:
    """Running sums of the episode each environment is in."""

    def __init__(self, count: int) -> None:
        """Start every environment at zero."""
        names = ("returned", "length", "pushes", "strongest_push", *_MEAN_KEYS, *_SQUARE_KEYS)
        self.sums = {name: np.zeros(count) for name in names}
        self.last = {name: np.zeros(count) for name in _LAST_KEYS}
        self.pushing = np.zeros(count, dtype=bool)

    def add(self, reward: np.ndarray, info: dict[str, np.ndarray], playing: np.ndarray) -> None:
        """Add one step of the environments that are `playing`."""
        steps = {"returned": reward, "length": np.ones(len(reward))}
        unknown = np.full(len(reward), np.nan)
        steps |= {key: info.get(key, unknown) for key in _MEAN_KEYS}
        steps |= {key: np.square(info.get(key, unknown)) for key in _SQUARE_KEYS}
        for name, value in steps.items():
            self.sums[name][playing] += value[playing]
        self.last = {key: info.get(key, unknown) for key in _LAST_KEYS}
        force, jump = (
            np.linalg.norm(info[key], axis=1) if key in info else np.zeros(len(reward))
            for key in ("push", "push_velocity")
        )
        pushing = ((force > 0) | (jump > 0)) & playing
        self.sums["pushes"] += pushing & ~self.pushing
        self.sums["strongest_push"] = np.maximum(
            self.sums["strongest_push"], np.where(playing, force, 0.0)
        )
        self.pushing = np.where(playing, pushing, self.pushing)

    def take(self, i: int, survived: bool, termination: str, step_seconds: float) -> dict[str, Any]:
        """Finish the episode of environment i and start its next one."""
        total = {name: float(values[i]) for name, values in self.sums.items()}
        for values in self.sums.values():
            values[i] = 0.0
        self.pushing[i] = False
        steps, pushes = total["length"], total["pushes"]
        return {
            "returned": total["returned"],
            "length": steps,
            "seconds": steps * step_seconds,
            "survived": float(survived),
            "height_error": np.sqrt(total["height_error"] / steps),
            "torque": np.sqrt(total["torque_rms"] / steps),
            "energy": total["power"] * step_seconds,
            **{name: total[name] / steps for name in _MEAN_KEYS},
            **{name: float(values[i]) for name, values in self.last.items()},
            "pushes": pushes,
            "pushes_survived": pushes if survived else max(pushes - 1.0, 0.0),
            "strongest_push": total["strongest_push"],
            "environment": i,
            "termination": termination,
        }


def shares(episodes: int, environments: int) -> np.ndarray:
    """Number of episodes each environment plays: as equal as possible, (environments,) int."""
    share = np.full(environments, episodes // environments)
    share[: episodes % environments] += 1
    return share


def play(
    envs: VectorEnv,
    actor: Actor,
    episodes: int,
    seed: int,
    step_seconds: float,
    on_episode: Callable[[int], None] = lambda finished: None,
) -> Episodes:
    """Play whole episodes; which ones count is fixed before the first step.

    Environment i starts from seed + i, so two layers with the same seed meet the same initial
    states and, as far as the task draws them alike, the same pushes.

    Args:
        envs: vector environment that resets by itself, in either of Gymnasium's modes.
        actor: the policy.
        episodes: how many, at least one.
        seed: of the first environment.
        step_seconds: duration of one policy step, s.
        on_episode: called with the number of finished episodes.

    Raises:
        InvalidValueError: no episodes asked for, or the environments do not reset by themselves.
    """
    if episodes < 1:
        raise InvalidValueError("episodes", episodes, "a positive number")
    mode = envs.metadata.get("autoreset_mode")
    if mode not in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
        raise InvalidValueError("autoreset mode", mode, "NEXT_STEP or SAME_STEP")
    left = shares(episodes, envs.num_envs)
    tally = _Tally(envs.num_envs)
    finished: list[dict[str, Any]] = []
    observation, _ = envs.reset(seed=seed)
    resetting = np.zeros(envs.num_envs, dtype=bool)
    while left.any():
        observation, reward, terminated, truncated, info = envs.step(actor(observation))
        playing = (left > 0) & ~resetting
        ended = (terminated | truncated) & playing
        step_info = _of_the_step(info, ended)
        tally.add(np.asarray(reward, dtype=float), step_info, playing)
        reasons = step_info.get("termination", np.zeros(len(ended), int))
        for i in np.flatnonzero(ended):
            reason = envs.metadata.get("terminations", ("",))[reasons[i]]
            finished.append(tally.take(int(i), not terminated[i], reason, step_seconds))
            left[i] -= 1
            on_episode(len(finished))
        if mode is AutoresetMode.NEXT_STEP:
            resetting = terminated | truncated
    finished.sort(key=lambda episode: episode["environment"])  # stable: time order within each
    return _stack(finished)


def _of_the_step(info: dict[str, Any], ended: np.ndarray) -> dict[str, np.ndarray]:
    """Info of the step itself: with SAME_STEP that of ended episodes lies in `final_info`."""
    final = info.get("final_info", {})
    merged: dict[str, np.ndarray] = {}
    for key in info.keys() | final.keys():
        value = info.get(key, final.get(key))
        if key.startswith("_") or not isinstance(value, np.ndarray):
            continue
        if key in final and ended.any():
            value = value.copy()
            value[ended] = final[key][ended]
        merged[key] = value
    return merged


def _stack(finished: list[dict[str, Any]]) -> Episodes:
    columns: dict[str, Any] = {
        item.name: np.array([episode[item.name] for episode in finished])
        for item in fields(Episodes)
    }
    columns["termination"] = tuple(columns["termination"].tolist())
    return Episodes(**columns)

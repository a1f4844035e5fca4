"""A zero action, a proportional law or a policy, played by robots side by side, in numbers."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy
from fbid_gym.runtime.config import EnvConfig
from train.environments import make_envs
from train.episodes import Actor
from train.recipes import config_for
from train.runs.proportional import matrix_of

Row = dict[str, str]  # column -> cell

WARM_UP = (7, 18, 29, 40, 51)
"""Policy steps by the zero action before the noisy one: different phases of a gait."""


def walk(
    arguments: Mapping[str, Any],
    count: int,
    seed: int,
    policy: Policy | None = None,
    gain: float = 0.0,
) -> Row:
    """Return how many robots stay up, with Wilson's 95 % interval of the share, and other numbers.

    Robot i starts from seed + i. By default the zero action acts; with a gain, 1/s, a proportional
    law does.

    Raises:
        FbidError: the environment is none, or has nothing for the law to act on.
    """
    batch = EnvBatch(EnvConfig.of(arguments), count)
    law = matrix_of(batch, gain).T if gain else None

    def by_law(seen: np.ndarray) -> np.ndarray:
        return np.clip(seen @ law, -1.0, 1.0)

    told = play(batch, seed, policy if law is None else by_law)
    up = int(told["up"][-1].sum())
    low, high = binomtest(up, count).proportion_ci(method="wilson")
    numbers = summarised(told, batch.rates.policy, batch.robot.weight)
    numbers |= {"share_low": low, "share_high": high}
    cells = {name: f"{value:.4g}" for name, value in numbers.items() if math.isfinite(value)}
    scores = scores_of(told, batch.num_steps)
    return cells | {"up": str(up), "score_of_each": " ".join(f"{each:.4g}" for each in scores)}


def begin(batch: EnvBatch, seed: int) -> None:
    """Begin an episode of every robot; robot i starts from seed + i."""
    for env in range(batch.num_envs):
        batch.seed(env, np.random.default_rng(seed + env))
    batch.reset(np.arange(batch.num_envs))


def play(
    batch: EnvBatch, seed: int, act: Actor | None = None, told: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Play until all robots fell, and return what happened, see `summarised`.

    Robot i starts from seed + i; without an actor the zero action acts. `told` names entries of the
    environments' info to return, too.
    """
    begin(batch, seed)
    count = batch.num_envs
    action, up = np.zeros((count, len(batch.action_names))), np.ones(count, bool)
    found = defaultdict[str, list[np.ndarray]](list)
    names = {name: column for column, name in enumerate(batch.observation_names)}
    ways = ("ahead", "to the left")
    for _ in range(batch.num_steps):
        if act is not None:
            action = act(batch.observation())
        step = batch.step(action)
        up = up & ~step.terminated
        found["up"].append(up)
        found["reward"].append(step.reward)
        for name in told:
            found[name].append(step.info[name])
        if "commanded yaw rate (rad/s)" in names:
            asked = [names[f"commanded velocity {way} (m/s)"] for way in ways]
            turn = step.observation[:, names["commanded yaw rate (rad/s)"]]
            terms = batch.simulation.terms()  # the truth, whatever the robots believe
            vertical, ahead = terms.world_from_base[:, 2], terms.world_from_trunk[:, :2, 0]
            ahead = ahead / (np.linalg.norm(ahead, axis=1, keepdims=True) + 1e-12)
            left = ahead[:, ::-1] * (-1.0, 1.0)
            moving = batch.simulation.qvel[:, :2]
            along = np.stack([np.vecdot(ahead, moving), np.vecdot(left, moving)], axis=1)
            spin = np.vecdot(vertical, batch.simulation.qvel[:, 3:6])
            found["miss"].append(along - step.observation[:, asked])
            found["turn"].append(spin - turn)
            for name in ("power", "speed", "velocity_error", "slip"):
                found[name].append(step.info[name])
        if not up.any():
            break
    return {name: np.array(values) for name, values in found.items()}


def scores_of(told: Mapping[str, np.ndarray], steps: int) -> np.ndarray:
    """Return (N,), the share of the greatest return that robots earn: nothing after a fall.

    `told` is that of `summarised`, `steps` those of an episode that nothing ends.
    """
    scores: np.ndarray = np.where(told["up"], told["reward"], 0.0).sum(axis=0) / steps
    return scores


def summarised(told: Mapping[str, np.ndarray], hz: int, weight: float) -> dict[str, float]:
    """Return what T steps of N robots say: means until a robot falls, NaN where none was up.

    Args:
        told: "up" (T, N) bool, until a robot falls; "reward" (T, N). Of walks also "miss" (T, N, 2)
            m/s, velocity beyond that commanded; "turn" (T, N) rad/s, likewise; "power" (T, N) W;
            "speed" (T, N) m/s; "velocity_error" (T, N) m/s, that of the reward; "slip" (T, N) m/s.
        hz: steps per second.
        weight: N, of a robot.
    """
    up, whole = told["up"], len(told["up"]) // hz
    # Here the step of a fall counts.
    stepped = np.vstack([np.ones_like(up[:1]), up[:-1]])
    numbers = {"reward": _mean(told["reward"][up])}
    numbers["return"] = float(np.sum(told["reward"] * stepped) / up.shape[1])
    if "miss" not in told:
        return numbers
    for name, values in (("velocity_error", told["miss"]), ("yaw_rate_error", told["turn"])):
        values = values.reshape(*up.shape, -1)
        seconds = values[: whole * hz].reshape(whole, hz, *values.shape[1:]).mean(axis=1)
        numbers[name] = _mean(np.linalg.norm(values, axis=2)[up])
        # a second counts if the robot is up at its end.
        lasting = np.linalg.norm(seconds, axis=2)[up[hz - 1 :: hz][:whole]]
        numbers[f"{name}_of_1_s_means"] = _mean(lasting)
    numbers["slip"], way = _mean(told["slip"][up]), told["speed"][up].sum()
    numbers["cost_of_transport"] = told["power"][up].sum() / (weight * way) if way else math.nan
    return numbers | {"velocity_error_of_the_reward": _mean(told["velocity_error"][stepped])}


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else math.nan


def noise(env_id: str, layer: str, robots: int, seed: int) -> Row:
    """Return the usual noise of exploration through a layer, and the torque that it is."""
    usual = config_for(env_id, layer).ppo
    assert usual is not None
    torque = noise_torque(env_id, layer, math.exp(usual.log_std_init), robots, seed)
    return {"log_std_init": str(usual.log_std_init), "torque_nm": f"{torque:.4g}"}


def noise_torque(env_id: str, layer: str, std: float, robots: int, seed: int) -> float:
    """Return the torque, root mean square over joints, that noise on the actions adds, N m.

    Two groups of the same robots go the same way by the zero action; in the last policy step the
    actions of one group have noise of standard deviation `std`. It has no mean, so the squares of
    what it adds add up.

    Raises:
        InvalidValueError: the environment reports no torques.
    """
    rng = np.random.default_rng(seed)
    added = []
    for steps in WARM_UP:
        squares = []
        for scale in (0.0, std):
            envs = make_envs(env_id, {"action_layer": layer}, robots)
            envs.reset(seed=seed)
            still = np.zeros(envs.action_space.shape or (robots, 0), dtype=np.float32)
            for _ in range(steps):
                envs.step(still)
            actions = np.clip(scale * rng.standard_normal(still.shape), -1.0, 1.0)
            info = envs.step(actions.astype(np.float32))[4]
            envs.close()
            if "torque_rms" not in info:
                raise InvalidValueError("env", env_id, "an environment that reports torque_rms")
            squares.append(np.mean(np.square(info["torque_rms"])))
        added.append(squares[1] - squares[0])
    return math.sqrt(max(float(np.mean(added)), 0.0))

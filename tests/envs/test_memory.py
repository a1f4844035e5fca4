"""What a robot takes leaves with it: its physics when it is closed, and what was measured of it."""

import gc
import weakref
from collections.abc import Callable
from typing import Any

import pytest

from fbid_gym import make_sb3
from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot
from fbid_gym.robots.built_in import asset_path
from fbid_gym.runtime.config import EnvConfig

KINDS: dict[str, Callable[..., Any]] = {
    "one": lambda robot: RobotEnv(robot),
    "several": lambda robot: RobotVectorEnv(3, robot, num_threads=2),
    "stable-baselines3": lambda robot: make_sb3("fbid_gym/BipedBalance-v0", 3, robot=robot),
}

FEET = {
    "biped": ["left_foot", "right_foot"],
    "quadruped": [f"{end}_{side}_foot" for end in ("front", "hind") for side in ("left", "right")],
}


def batches_of(env: Any) -> list[Any]:
    return list(env.chunks.batches) if hasattr(env, "chunks") else [env.batch]


@pytest.mark.parametrize("kind", KINDS)
def test_physics_leaves_when_it_is_closed(kind: str) -> None:
    env = KINDS[kind]("biped")
    env.reset()
    pools = [weakref.ref(batch.simulation) for batch in batches_of(env)]
    env.close()
    assert [pool() for pool in pools] == [None] * len(pools)
    with pytest.raises(FbidError, match="closed"):
        env.reset()


def test_robots_in_turn_leave_nothing() -> None:
    alive = []
    for name in ("biped", "quadruped", "biped"):
        robot = Robot.from_mjcf(asset_path(f"{name}.xml"), FEET[name])
        envs = RobotVectorEnv(2, robot)
        envs.reset(seed=0)
        envs.step(envs.action_space.sample())
        envs.close()
        alive.append(weakref.ref(robot))
        del robot, envs
    gc.collect()
    assert [robot() for robot in alive] == [None] * len(alive)


def test_closed_environments_say_so(rng: Any) -> None:
    chunks = Chunks(EnvConfig.of({"robot": "biped"}), 2, 1)
    chunks.close()
    for ask in (chunks.observation, chunks.state_dict, lambda: chunks.seed(0, rng)):
        with pytest.raises(FbidError, match="These environments are closed: make others."):
            ask()

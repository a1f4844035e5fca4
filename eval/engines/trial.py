"""The episodes that a player has in MuJoCo, in Bullet."""

from typing import NamedTuple

import numpy as np
from gymnasium.utils import seeding

from eval.engines.bullet import BulletWorld
from eval.rollout import Player
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import InvalidValueError
from fbid_gym.runtime import Controller


class Outcomes(NamedTuple):
    """Results of E episodes, as columns of `Episodes`."""

    seconds: np.ndarray  # (E,) s, until the robot fell or the time was over
    survived: np.ndarray  # (E,) bool
    velocity_error: np.ndarray  # (E,) m/s, mean over the policy steps


def in_bullet(
    player: Player, episodes: int, seed: int, hz: int, *, armature: bool = True
) -> Outcomes:
    """Play episodes in Bullet; their starts, commands and pushes are those of `play_player`.

    Bullet takes `hz` physics steps per second, a multiple of the control rate.

    Raises:
        InvalidValueError: another rate, or terrain, or velocities that jump.
    """
    controller = Controller.of_environment(player.env_id, player.make_args, player.policy)
    config, rates = controller.config, controller.rates
    if hz % rates.control:
        raise InvalidValueError("physics_hz", hz, f"a multiple of control_hz = {rates.control}")
    if config.terrain != "flat" or any(config.push_velocity):
        raise InvalidValueError(
            "environment", player.env_id, "one on flat ground, pushed by forces"
        )
    world = BulletWorld(controller.robot, hz, armature=armature)
    batch = EnvBatch(config, 1)
    try:
        each = [_episode(controller, world, batch, seed + k) for k in range(episodes)]
    finally:
        world.close()
    return Outcomes(*map(np.array, zip(*each, strict=True)))


def _episode(
    controller: Controller, world: BulletWorld, batch: EnvBatch, seed: int
) -> tuple[float, bool, float]:
    only, rates, task, plan = np.zeros(1, int), batch.rates, batch.task, batch.loop.plan
    batch.seed(0, seeding.np_random(seed)[0])
    batch.reset(only)
    controller.reset()
    for name, value in plan.items():
        controller.loop.plan[name][:] = value
    world.place(batch.simulation.qpos[0], batch.simulation.qvel[0])
    errors: list[float] = []
    level = (lambda places: np.zeros(len(places))) if controller.sees_ground else None
    for step in range(batch.num_steps + 1):
        pushed = task.pushes.during(plan, only + step * rates.ticks, rates.ticks, rates.control)
        for tick, push in enumerate(pushed.force):
            torque = controller.tick(world.sensors(), level)
            if tick == 0 and step:  # what the last step came to
                errors.append(float(task.metrics(controller.measured)["velocity_error"][0]))
                if controller.measured.outcome.posture.fallen[0]:
                    return step / rates.policy, False, float(np.mean(errors))
                if step == batch.num_steps:
                    break
            for _ in range(world.hz // rates.control):
                world.step(torque, push[0])
    return batch.num_steps / rates.policy, True, float(np.mean(errors))

"""The state of a robot, taken apart and put together: what a switch keeps, what a setting changes.

All of it works on the arrays of `EnvBatch.state_dict`, of one robot.
"""

from collections.abc import Mapping

import numpy as np

from eval.play.controls import Settings
from fbid_gym.envs.env_batch import EnvBatch

State = dict[str, np.ndarray]
_NEVER = np.iinfo(np.int64).max // 2


def carried(old: Mapping[str, np.ndarray], fresh: Mapping[str, np.ndarray]) -> State:
    """Return the old state for a robot with another layer, whose memory is fresh.

    Actions on their way are those of the old layer: where they were as many they arrive, else the
    zero action does.
    """
    state = {name: value.copy() for name, value in old.items() if not name.startswith("memory.")}
    state |= {name: value for name, value in fresh.items() if name.startswith("memory.")}
    if state["delay.action"].shape != fresh["delay.action"].shape:
        state["delay.action"] = np.zeros_like(fresh["delay.action"])
    return state


def imposed(batch: EnvBatch, state: Mapping[str, np.ndarray], settings: Settings) -> State:
    """Return the state of a robot to which the settings apply from now on."""
    new, robot = dict(state), batch.robot
    mass = np.ones_like(state["plant.mass"])
    trunk = robot.base_body
    mass[:, trunk] += settings["added_mass"] / robot.model.body_mass[trunk]
    delay, loop = float(settings["action_delay"]), 1e-3 * float(settings["loop_delay"])
    ticks = round(loop * batch.rates.control, 6)
    new |= {
        "plant.mass": mass,
        "plant.friction": np.full_like(state["plant.friction"], settings["friction"]),
        "plant.motor_strength": np.full_like(state["plant.motor_strength"], settings["motors"]),
        "plant.model_mass": np.full_like(state["plant.model_mass"], settings["model_mass"]),
        "plant.action_delay": np.full_like(state["plant.action_delay"], delay),
        "plant.loop_delay": np.full_like(state["plant.loop_delay"], loop),
        "simulation.loop_ticks": np.full_like(state["simulation.loop_ticks"], ticks),
        "delay.ticks": np.full_like(state["delay.ticks"], round(delay * batch.rates.control)),
    }
    if batch.task.kind.gait:
        command = [settings.get(name, 0.0) for name in ("ahead", "left", "turn")]
        new["plan.command"] = np.broadcast_to(command, state["plan.command"].shape).copy()
        new["plan.lowered"] = np.full_like(state["plan.lowered"], -settings["height"])
    elif "height" in settings:
        new["plan.command"] = np.full_like(state["plan.command"], settings["height"])
    elif "pace" in settings:
        new["plan.speed"] = np.full_like(state["plan.speed"], settings["pace"])
    return new


def pushed(
    batch: EnvBatch, state: Mapping[str, np.ndarray], force: np.ndarray, steps: int
) -> State:
    """Return the state of a robot that is pushed from now on, instead of any push before.

    The force (3,) N, world, lasts so many policy steps, each a push of the environment's own.
    """
    start = np.full_like(state["plan.push_start"], _NEVER)
    start[0, :steps] = state["tick"][0] + np.arange(steps) * batch.rates.ticks
    forces = np.zeros_like(state["plan.push_force"])
    forces[0, :steps] = force
    return dict(state) | {"plan.push_start": start, "plan.push_force": forces}

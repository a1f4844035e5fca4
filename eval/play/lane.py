"""One robot of a session, with the layer and the policy that drive it."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from eval.play.controls import ALONE, Settings
from eval.play.stage import NO_POLICY, Stage
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.fitting import check_fits
from fbid_gym.envs.policy_step import Step
from fbid_gym.policy import Policy

State = dict[str, np.ndarray]
"""All that the future of a robot depends on: the arrays of `EnvBatch.state_dict`."""

_ONLY = np.zeros(1, int)
_NEVER = np.iinfo(np.int64).max // 2


class Driver(NamedTuple):
    """The policy that drives a robot."""

    layer: str  # name of the action layer
    policy: str  # name of the policy, or "zero action"

    @property
    def word(self) -> str:
        """Its name beside another."""
        return self.layer if self.policy == NO_POLICY else f"policy {Path(self.policy).name}"


def layer_of(policy: Policy) -> str:
    """Return the layer through which a policy acts."""
    return str(policy.env_args.get("action_layer", "joint_position"))


def players(stage: Stage, settings: Settings) -> list[Driver]:
    """Return who plays by these settings: one, or two side by side."""
    found = [Driver(settings["layer"], settings["policy"])]
    beside = settings["beside"]
    if beside in stage.policies:
        found.append(Driver(layer_of(stage.policies[beside]), beside))
    elif beside != ALONE:
        found.append(Driver(beside, NO_POLICY))
    return found


class Lane:
    """One robot, in a world of its own."""

    def __init__(self, stage: Stage, player: Driver, settings: Settings) -> None:
        """Build the environment; `reset` or `take_over` before the first step.

        Raises:
            FbidError: the policy or a setting does not fit the environment.
        """
        self.player, self._policy = player, stage.policies.get(player.policy)
        self.options = stage.options(player.layer, self._policy, settings["contact_limits"])
        changes = {
            "action_layer": player.layer,
            "layer_options": self.options,
            "terrain": settings["terrain"],
            "difficulty": settings["difficulty"],
            "sensors": stage.sensors_of(settings["sensors"], settings["noise"]),
        }
        if "gait" in settings:
            changes["gait"] = settings["gait"]
        self.batch = EnvBatch(stage.config(changes), 1)
        self.last: Step | None = None  # what its last policy step returned; None before the first
        self.action = np.zeros(len(self.batch.action_names))  # (A,) of that step
        if self._policy is not None:
            seen = self.batch.observation().shape[1]
            check_fits(self._policy, self.batch.robot, seen, len(self.action))
        self.fallen: float | None = None  # s since its fall; None while it is up
        self.falls = 0  # how often it has fallen since the session was last restarted

    def reset(self, settings: Settings) -> None:
        """Start an episode from the seed of the settings."""
        self.batch.seed(0, np.random.default_rng(settings["seed"]))
        self.batch.reset(_ONLY)
        self.last, self.fallen = None, None
        self.apply(settings)

    def take_over(self, other: "Lane") -> None:
        """Go on where another robot is, with a fresh memory of the layer.

        Actions on their way are those of the old layer: where they were as many they arrive, else
        the zero action does.
        """
        state, fresh = other.state(), self.state()
        state = {name: value for name, value in state.items() if not name.startswith("memory.")}
        state |= {name: value for name, value in fresh.items() if name.startswith("memory.")}
        if state["delay.action"].shape != fresh["delay.action"].shape:
            state["delay.action"] = np.zeros_like(fresh["delay.action"])
        self.batch.load_state_dict(state)
        self.last, self.fallen, self.falls = other.last, other.fallen, other.falls

    def apply(self, settings: Settings) -> None:
        """Let settings that need no reset act from now on."""
        state, robot, rates = self.state(), self.batch.robot, self.batch.rates
        trunk = robot.base_body
        state["plant.mass"][:] = 1.0
        state["plant.mass"][:, trunk] += settings["added_mass"] / robot.model.body_mass[trunk]
        delay, loop = float(settings["action_delay"]), 1e-3 * float(settings["loop_delay"])
        values = {
            "plant.friction": settings["friction"],
            "plant.motor_strength": settings["motors"],
            "plant.model_mass": settings["model_mass"],
            "plant.action_delay": delay,
            "plant.loop_delay": loop,
            "simulation.loop_ticks": round(loop * rates.control, 6),
            "delay.ticks": round(delay * rates.control),
        }
        if self.batch.task.kind.gait:
            values["plan.command"] = [settings.get(name, 0.0) for name in ("ahead", "left", "turn")]
            values["plan.lowered"] = -settings["height"]
        elif "height" in settings:
            values["plan.command"] = settings["height"]
        elif "pace" in settings:
            values["plan.speed"] = settings["pace"]
        for name, value in values.items():
            state[name][...] = value
        self.batch.load_state_dict(state)

    def push(self, force: np.ndarray, steps: int) -> None:
        """Push with a force (3,) N for some policy steps from now on, instead of any push before.

        Each of these steps is a push of the environment's own; 0 steps end a push.
        """
        state = self.state()
        start, forces = state["plan.push_start"], state["plan.push_force"]
        start[:], forces[:] = _NEVER, 0.0
        start[0, :steps] = state["tick"][0] + np.arange(steps) * self.batch.rates.ticks
        forces[0, :steps] = force
        self.batch.load_state_dict(state)

    def step(self) -> None:
        """Go on by one policy step."""
        if self._policy is not None:
            self.action = np.asarray(self._policy(self.batch.observation()), float)[0]
        self.last = self.batch.step(self.action[None])
        ended = bool(self.last.terminated[0] or self.last.truncated[0])
        if self.fallen is not None:
            self.fallen += 1.0 / self.batch.rates.policy
        elif ended:
            self.fallen = 0.0
            self.falls += 1

    def state(self) -> State:
        """Return copies of all that the future depends on."""
        return self.batch.state_dict()

    @property
    def qpos(self) -> np.ndarray:
        """(nq,) of the robot, a copy."""
        return self.batch.simulation.qpos[0].copy()

    @property
    def word(self) -> str:
        """Its errors and falls, in words."""
        info = {} if self.last is None else self.last.info
        for name, unit in (("speed", "m/s"), ("height", "m")):
            if f"{name}_command" in info:
                now, wanted = info[name][0], info[f"{name}_command"][0]
                return f"**{now:.2f} {unit}**, command {wanted:.2f} {unit}, falls: {self.falls}"
        return f"falls: {self.falls}"

    @property
    def believed(self) -> np.ndarray | None:
        """(7,) place and quaternion of the base by the robot's estimate; None: it needs none."""
        perception = self.batch.perception
        return None if perception is None else perception.estimator.state.qpos[0, :7].copy()

    @property
    def push_force(self) -> np.ndarray:
        """(3,) N, on the base, in the last step."""
        return np.zeros(3) if self.last is None else self.last.info["push"][0]

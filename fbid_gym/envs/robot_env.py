"""The Gymnasium environment: `gym.make`."""

from typing import Any

import gymnasium as gym
import numpy as np

from fbid_gym.checks import by_name
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.interface import METADATA, Interface, checked_seed
from fbid_gym.errors import FbidError
from fbid_gym.runtime.config import Drawing, EnvConfig


class RobotEnv(Interface, gym.Env):
    """One robot with one task, driven through one action layer.

    The page of an environment, with all its tables: `python -m fbid_gym.envs ID`, such as
    fbid_gym/BipedWalk-v0. What follows the attributes holds for all of them.

    Attributes:
        observation_names: what each entry of an observation is, with its unit.
        action_names: what each entry of an action commands, with its scale and unit.

    ## Description
    How a policy's action becomes joint torques is the choice of an *action layer*; everything else
    (robot, task, observation, reward, limits, seeds) is the same for all layers, so that what
    differs between two policies trained through two layers is the layer.

    The *support frame* is the level frame of the feet: its origin is the mean of the contact
    points, z points up, and x is the heading for which the contact points, seen from above, lie
    nearest to where they are in the home stance. Nothing depends on where on the ground the robot
    stands or which way it faces.

    ## Action Space
    A `Box(-1, 1, (A,), float32)`, held for one policy step. In every layer the zero action follows
    what the task asks for (the home stance, a motion, a gait) as well as this layer can, and
    torques are cut off at the same limits. Entries outside [-1, 1] are clipped, and the info tells
    their share; with `actions="refuse"` they are errors, as NaN always is.
    `env.unwrapped.action_names` names each entry with its scale and unit.

    ## Observation Space
    A `Box` of float32, the same for every layer. Values are clipped to their ranges.
    `env.unwrapped.observation_names` names each entry, `env.unwrapped.batch.observation_columns`
    says where each group of them is ("command", "base", "up", ...). With sensors that are not
    perfect, layer and policy know the state by an estimate; `observation="measured"` is for robots:
    the group "policy" of what they can know, then "critic", the truth. "From home" is what differs
    from the home stance. The last torque is that of the last control tick, the normal force that of
    the last physics step. Slide joints have m where hinges have rad.

    ## Rewards
    The reward of a step is the sum of its terms, each between 0 and its weight; the weights sum to
    1, so a return is at most the number of steps. The bell of an error is exp(-(error / scale)^2).
    H is the robot's size (height of hips or centre of mass above the feet, the higher), h the
    height of its centre of mass at home, g gravity. `reward_weights={"torque": 0.0}` and
    `reward_scales={"upright": 0.1}` change weights and, in the units of the table, scales; what
    they do not name stays.

    A point is on the ground while it carries more than 1 % of the weight. Torques are those of all
    control ticks of the step, everything else is taken at its end. The last step of an episode that
    ends by a fall is rewarded as any other; that of a diverged robot gets 0.

    ## Starting State
    Facing anywhere; each joint is moved by up to `joint_noise` (and stays in its range), each entry
    of the velocity by up to `velocity_noise`, all uniformly distributed. The base is raised so that
    the lowest contact point touches the ground. With the state come the pushes and the commands of
    the whole episode.

    A push is a horizontal force on the base's centre of mass, in a uniformly random direction, of a
    size uniform in `push_force`, constant for `push_duration`. As it begins, the base's velocity
    jumps the same way by as large a share of `push_velocity`. The time from one push to the next
    (and from the start to the first) is uniform in `push_interval`.

    `reset(options={"command": ...})` and `env.unwrapped.set_command(...)` give a command instead of
    those drawn, until the episode ends: what the observation shows as commanded, on a gait m/s
    ahead, m/s and rad/s to the left.

    ## Episode End
    Termination by a *fall*, the base lower than 0.6 H above the contact points or tilted by more
    than 60 degrees; or *diverged*, the simulation unstable (a velocity above 500 m/s or rad/s, or
    not finite): then the last observation is that of the step before. Truncation after
    `episode_seconds`, inside the environment: no `TimeLimit` wrapper is needed.

    ## Arguments
    Those of `EnvConfig` and of the task; docs/arguments.md, or `python -m fbid_gym.envs`, has also
    those of layers, what `randomisation` takes, and how environments are drawn: an arrow is a push.
    `gym.make_vec` adds those of `RobotVectorEnv`; environment i of a batch with seed s is this
    environment with seed s + i, to the bit. `FbidError` is raised for an argument or an action that
    is not valid, naming the value and the choices; a bad action steps nothing. It is also Python's
    `TypeError` for an unknown keyword, `ValueError` for a bad value.

    ## Info
    `reset` returns an empty dictionary. Where robots have sensors, `step` also tells by how much
    their estimate errs: `estimate_tilt_error` and others, see docs/measured.md.

    ## Version History
    * v0: Initial version.
    """

    metadata: dict[str, Any] = METADATA

    def __init__(self, robot: Any = "biped", **arguments: Any) -> None:
        """Build the environment."""
        drawing, rest = Drawing.of({"robot": robot} | arguments)
        config = EnvConfig.of(rest)
        self.batch = EnvBatch(config, 1)
        self.observation_space, self.action_space = self._present(config, drawing, self.batch)
        self._only = np.zeros(1, int)
        self._begun, self._closed = False, False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start a new episode. Only a seed begins a curriculum anew.

        Args:
            seed: of all that is random from now on.
            options: {"command": ...}, see `set_command`; else commands are drawn.
        """
        self._check_open()
        command = by_name("options", options, ("command",)).get("command")
        asked = None if command is None else self.batch.check_command(command, 1)
        seed = checked_seed("seed", seed)
        super().reset(seed=seed)
        self.batch.seed(0, self.np_random, anew=seed is not None)
        self.batch.reset(self._only, asked)
        self._begun = True
        if self.render_mode == "human":
            self.render()
        return self.batch.observation()[0], {}

    def set_command(self, command: Any) -> None:
        """Have the robot follow a command until its episode ends, see `Chunks.set_command`."""
        self._check_open()
        self.batch.set_command(self._only, self.batch.check_command(command, 1))

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Hold the action (A,) for one policy step."""
        self._check_open()
        if not self._begun:
            raise FbidError("There is no episode to step: call reset().")
        step = self.batch.step(self.batch.check_action(action)[None])
        if self.render_mode == "human":
            self.render()
        info = {name: value[0] for name, value in step.info.items()}
        ended = bool(step.terminated[0]), bool(step.truncated[0])
        return step.observation[0], float(step.reward[0]), *ended, info

    def render(self) -> np.ndarray | None:
        """Draw the environment: (H, W, 3) uint8 for "rgb_array", a window for "human"."""
        if self.render_mode is None:
            gym.logger.warn("render() without a render_mode draws nothing")
            return None
        self._check_open()
        return self._renderer.render(self.batch, 0)

    def close(self) -> None:
        """Close the window and give back the memory; nothing steps any more."""
        self._closed = True
        vars(self).pop("batch", None)
        self._renderer.close()

    def _check_open(self) -> None:
        if self._closed:
            raise FbidError("This environment is closed: make another one.")

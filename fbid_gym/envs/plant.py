"""The simulated robot, and the model that the layers have of it."""

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.dynamics.mujoco_dynamics import LiveTerms, without_contact
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.envs.loop_delay import LoopDelay
from fbid_gym.envs.simulation import Simulation, hush
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.robots.mjcf import moving_joints
from fbid_gym.runtime.randomisation import Randomisation

# What is drawn for a whole robot, or for each of its motors, from a (least, most).
_RANGES = (
    *("friction", "motor_strength", "action_delay"),
    *("total_mass", "model_total_mass", "model_inertia", "model_com_ahead"),
)
# Likewise; younger, so drawn last and only where they vary: seeds go on to mean the same robots.
_YOUNGER = ("loop_delay", "motor_speed", "motor_lag", "payload")
_CONTACT_TIME = "contact_time"  # likewise, and kept only then: older critics do not observe it

_OFF_CENTRE = 0.2  # of the mean distance of the contact points from their centre


class Plant:
    """The robots' physical parameters, and the dynamics terms that controllers see.

    Where nothing is random all robots are as their MJCF says, and controllers know it. Else each
    robot differs from its MJCF, and the controller's model differs from the MJCF too. That model is
    a second batch that only computes dynamics terms, without any contact: so this costs less than
    the position and velocity stages of the simulation. It is also what terms come from where
    controllers have but an estimate of the state.
    """

    def __init__(
        self,
        simulation: Simulation,
        randomisation: Randomisation,
        estimate: RobotState | None = None,
    ) -> None:
        """Draw from the ranges of `randomisation`; controllers know the state, or its estimate."""
        self._simulation, self._ranges = simulation, randomisation
        count = simulation.num_robots
        # As drawn of the robots and of the controllers' model, by its name in a state.
        self.arrays: dict[str, np.ndarray] = {}
        # s, from the choice of an action to its arrival at the action layer.
        self.action_delay = np.zeros(count)
        self._apart = randomisation.any or estimate is not None
        if not self._apart:
            return
        robot, hz, longest = simulation.robot, simulation.loop.control_hz, randomisation.loop_delay
        simulation.loop = LoopDelay(count, robot.num_joints, hz, longest[1])
        model = without_contact(robot)
        self._believed = mujoco.batch.Batch(model, count, 1, persistent=True)
        hush(self._believed, np.arange(count))
        self._live = LiveTerms(robot, self._believed)
        self._qpos, self._qvel = self._believed.bind("qpos"), self._believed.bind("qvel")
        self._terms: DynamicsTerms
        self._seen = -1  # `Simulation.changes` when they were computed
        actual = simulation.qpos, simulation.qvel
        self._where = actual if estimate is None else (estimate.qpos, estimate.qvel)
        if not randomisation.any:
            return
        bodies = (count, model.nbody)
        self.arrays = {
            "mass": np.ones(bodies),
            "com": np.zeros((*bodies, 3)),
            "friction": np.ones(count),
            "motor_strength": np.ones((count, robot.num_joints)),
            "action_delay": self.action_delay,
            "model_mass": np.ones(bodies),
            "model_com": np.zeros((*bodies, 3)),
            "total_mass": np.ones(count),
            "model_total_mass": np.ones(count),
            "model_inertia": np.ones(count),
            "model_com_ahead": np.zeros(count),
            **{name: np.full(count, getattr(randomisation, name)[0]) for name in _YOUNGER},
            "payload_place": np.zeros((count, 2)),
        }
        if randomisation.contact_time != (1.0, 1.0):
            self.arrays[_CONTACT_TIME] = np.ones(count)

    @property
    def drawn(self) -> dict[str, np.ndarray]:
        """Random parameters of the robots, not those of the model: (N, ...) by name; live."""
        return {name: value for name, value in self.arrays.items() if "model" not in name}

    def draw(self, env: int, rng: np.random.Generator) -> None:
        """Draw the parameters of one robot for its next episode."""
        if not self.arrays:
            return
        ranges, bodies = self._ranges, self.arrays["mass"].shape[1]
        for name, scale in (("mass", ranges.mass), ("model_mass", ranges.model_mass)):
            self.arrays[name][env] = 1.0 + rng.uniform(-scale, scale, bodies)
        for name, size in (("com", ranges.com), ("model_com", ranges.model_com)):
            self.arrays[name][env] = rng.uniform(-size, size, (bodies, 3))
        for name in _RANGES:
            least, most = getattr(ranges, name)
            self.arrays[name][env] = rng.uniform(least, most, self.arrays[name].shape[1:])
        for name in (*_YOUNGER, *self.arrays.keys() & {_CONTACT_TIME}):
            least, most = getattr(ranges, name)
            self.arrays[name][env] = rng.uniform(least, most) if least < most else least
        if ranges.payload[1] > 0.0:
            self.arrays["payload_place"][env] = rng.uniform(-1.0, 1.0, 2)

    def apply(self, ids: np.ndarray) -> None:
        """Give the robots `ids` (K,) their drawn parameters."""
        if not self.arrays:
            return
        simulated, batch = self._simulation.model, self._simulation.batch
        drawn = {name: value[ids] for name, value in self.arrays.items()}
        robot, com = self._simulation.robot, drawn["com"]
        mass, base = drawn["mass"] * drawn["total_mass"][:, None], robot.base_body
        welded = np.flatnonzero(simulated.body_weldid == simulated.body_weldid[base])
        base = int(welded[np.argmax(simulated.body_mass[welded])])  # the frame may be a body alone
        # What is carried, beside the base as it is.
        load = drawn["payload"] * robot.mass / (simulated.body_mass[base] * mass[:, base])
        away = _OFF_CENTRE * Stance.of(robot).radius * drawn["payload_place"]
        com[:, base] += (load / (1.0 + load))[:, None] * (away @ base_from_trunk(robot)[:, :2].T)
        mass[:, base] *= 1.0 + load
        _weigh(batch, simulated, ids, mass, mass, com)
        mass = drawn["model_mass"] * drawn["model_total_mass"][:, None]
        inertia, com = mass * drawn["model_inertia"][:, None], drawn["model_com"]
        ahead = base_from_trunk(robot)[:, 0]
        com[:, robot.base_body] += drawn["model_com_ahead"][:, None] * ahead
        _weigh(self._believed, robot.model, ids, mass, inertia, com)
        self._simulation.loop.begin(ids, drawn["loop_delay"])
        if (motors := self._simulation.motors) is not None:
            motors.speed[ids], motors.lag[ids] = drawn["motor_speed"], drawn["motor_lag"]
        # A motor whose gear is larger gives more torque for the same control, and a joint lets as
        # much more through.
        joints = np.array(moving_joints(robot.model))
        for field, index in (("actuator_gear", robot.actuator), ("jnt_actfrcrange", joints)):
            nominal = getattr(simulated, field)
            strength = np.ones((len(ids), len(nominal), 1))
            strength[:, index, 0] = drawn["motor_strength"]
            batch.expand(field)[ids] = nominal * strength
        # Sliding has one number of a geom and two of a pair.
        for field, sliding in (("geom_friction", slice(1)), ("pair_friction", slice(2))):
            nominal = getattr(simulated, field)
            scaled = np.tile(nominal, (len(ids), 1, 1))
            scaled[:, :, sliding] *= drawn["friction"][:, None, None]
            batch.expand(field)[ids] = scaled
        if _CONTACT_TIME in drawn:
            for field in ("geom_solref", "pair_solref", "pair_solreffriction"):
                nominal = getattr(simulated, field)
                # Below zero they are a stiffness, 1/s^2, and a damping, 1/s.
                powers = np.where(nominal[:, :1] < 0.0, (-2.0, -1.0), (1.0, 0.0))
                batch.expand(field)[ids] = nominal * drawn[_CONTACT_TIME][:, None, None] ** powers
        self._seen = -1

    def terms(self) -> DynamicsTerms:
        """Return the terms of the controllers' model, where they believe the robots to be."""
        if not self._apart:
            return self._simulation.terms()
        if self._seen != self._simulation.changes:
            self._qpos[:], self._qvel[:] = self._where
            self._believed.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
            self._seen, self._terms = self._simulation.changes, self._live()
        return self._terms


def _weigh(
    batch: mujoco.batch.Batch,
    model: mujoco.MjModel,
    ids: np.ndarray,
    mass: np.ndarray,
    inertia: np.ndarray,
    com: np.ndarray,
) -> None:
    """Give robots (K,) of a batch factors (K, bodies) on their bodies, shifts (K, bodies, 3) m."""
    batch.expand("body_mass")[ids] = model.body_mass * mass
    batch.expand("body_inertia")[ids] = model.body_inertia * inertia[:, :, None]
    batch.expand("body_ipos")[ids] = model.body_ipos + com
    batch.set_const(ids)

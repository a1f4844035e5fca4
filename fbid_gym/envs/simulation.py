"""The physics of N robots: MuJoCo's batch, seen through the robot's joints and feet."""

import copy

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.dynamics.contacts import point_positions
from fbid_gym.dynamics.mujoco_dynamics import LiveTerms, column_of
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.loop_delay import LoopDelay
from fbid_gym.envs.motors import MotorState, turn_motors
from fbid_gym.envs.tick import Wiring, find_diverged, read
from fbid_gym.errors import RobotError
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.robots import Robot
from fbid_gym.robots.drives import drives_of
from fbid_gym.runtime.effort import Effort
from fbid_gym.runtime.rates import Rates

# Generalized speed (m/s, rad/s) beyond which a simulation counts as diverged.
MAX_SPEED = 500.0
_ALL, _VELOCITY = slice(None), int(mujoco.mjtStage.mjSTAGE_VEL)
_STATE = ("time", "qpos", "qvel", "act", "qacc_warmstart", "ctrl", "qfrc_applied", "xfrc_applied")
_WARN = mujoco.mjtWarning
_DIVERGENCE = np.array(
    [int(kind) for kind in (_WARN.mjWARN_BADQPOS, _WARN.mjWARN_BADQVEL, _WARN.mjWARN_BADQACC)]
)


class Simulation:
    """N robots, stepped on the calling thread. They do not meet: each has a world of its own."""

    def __init__(
        self, robot: Robot, num_robots: int, rates: Rates, world: mujoco.MjModel | None = None
    ) -> None:
        """Build N copies of the robot's world; by default the robot alone on its ground.

        Another `world` is compiled from a copy of `robot.spec` with bodies added at the end; raises
        RobotError if it does not begin with the robot.
        """
        model = copy.copy(robot.model if world is None else world)
        _check_world(robot, model)
        model.opt.timestep = 1.0 / rates.physics
        self.robot, self.model, self.num_robots = robot, model, num_robots
        # Its position- and velocity-dependent fields are always current.
        self.batch = mujoco.batch.Batch(model, num_robots, 1, persistent=True)
        self.qpos = self.batch.bind("qpos")[:, : robot.nq]  # live
        self.qvel = self.batch.bind("qvel")[:, : robot.nv]  # live
        self._substeps, self._geometry = rates.substeps, Stance.of(robot).geometry
        self._push = self.batch.bind("xfrc_applied")[:, robot.base_body, :3]
        self._controls, shape = self.batch.bind("ctrl"), (num_robots, robot.num_joints)
        first = robot.contact_sensor.min()
        columns = slice(first, first + robot.contact_sensor.size)
        if not np.array_equal(np.r_[columns], robot.contact_sensor.ravel()):
            raise AssertionError("the contact sensors of a Robot are consecutive")
        sensors = self.batch.bind("sensordata")
        self._wiring = Wiring(
            rows=self.batch.state,
            sensors=sensors,
            warning=self.batch.warning,
            position=column_of(self.qpos, self.batch),
            velocity=column_of(self.qvel, self.batch),
            push=column_of(self._push, self.batch),
            controls=column_of(self._controls, self.batch) + robot.actuator.astype(np.int64),
            contact=int(first),
            gear=robot.gear,
        )
        self._sensors = sensors[:, columns].reshape(num_robots, robot.num_points, 3)
        # (N, P, 3) N, world, of the ground on each contact point in the last physics step.
        self.contact_force = np.zeros(self._sensors.shape)
        self._live = LiveTerms(robot, self.batch)
        self._terms: DynamicsTerms | None = None
        self._stale = np.ones(num_robots, bool)  # whose terms are those of an earlier state
        # Delays torques on their way to the motors, by nothing unless it is replaced.
        self.loop = LoopDelay(*shape, rates.control, 0.0)
        self._drives, self._motors = drives_of(robot), MotorState.cold(*shape)
        self.motors = None if robot.drives is None else self._motors
        turns = 1 if self.motors is None else self._substeps
        steps = self._substeps // turns
        self._turns, self._turn = turns, (steps, steps / rates.physics, 1.0 / turns)
        self.changes = 0  # of the state
        hush(self.batch, np.arange(num_robots))
        self.batch.forward()
        self.contact_force[:] = self._sensors

    def terms(self) -> DynamicsTerms:
        """Return the dynamics at the current state, in arrays that the next state's overwrite."""
        if self._terms is None:
            self._terms = self._live(self._stale)
            self._stale[:] = False
        return self._terms

    def place(
        self, ids: np.ndarray, qpos: np.ndarray, qvel: np.ndarray, ground: np.ndarray | float = 0.0
    ) -> None:
        """Start the robots `ids` (K,) anew, each with its lowest contact point on the ground.

        They begin at qpos (K, nq), but for the height of the base, which is set here, with qvel
        (K, nv); the height of the ground there is `ground` (K,) m.
        """
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self.qpos[ids], self.qvel[ids] = qpos, qvel
        if self.motors is not None:
            self.motors.cool(ids)
        self.batch.forward(ids, stage=_VELOCITY)
        self.note_change(ids)
        lowest = point_positions(self._geometry, self.terms())[ids, :, 2].min(axis=1)
        self.qpos[ids, 2] -= lowest - ground
        self.batch.forward(ids)
        hush(self.batch, ids)
        self.contact_force[ids] = self._sensors[ids]
        self.note_change(ids)

    def push(self, force: np.ndarray) -> None:
        """Push each base with (N, 3) N, world, at its centre of mass, until told otherwise."""
        self._push[:] = force

    def jump(self, velocity: np.ndarray) -> None:
        """Change the velocities of the bases at once, by (N, 3) m/s, world."""
        ids = np.flatnonzero(velocity.any(axis=1))
        if len(ids):
            self.qvel[ids, :3] += velocity[ids]
            self.batch.forward(ids, stage=_VELOCITY)
            self.note_change(ids)

    def step(self, torque: np.ndarray, ids: np.ndarray | None = None) -> None:
        """Advance one control tick under (N, n) N·m of ideal motors: all robots, or some `ids`."""
        self._controls[:, self.robot.actuator] = torque / self.robot.gear
        self.batch.step(ids, nstep=self._substeps, stage=_VELOCITY)
        self.note_change()
        self.contact_force[:] = self._sensors

    def tick(self, torque: np.ndarray, push: np.ndarray, effort: Effort, state: RobotState) -> None:
        """Push all robots by (N, 3) N and advance them one control tick, as `push` and `step` do.

        Limits the torques (N, n) N·m; a robot whose torques are no numbers gets none. Adds to
        `effort`, and updates `state`, whose arrays are the caller's but for `contact_force`, which
        is the simulation's.
        """
        steps, seconds, share = self._turn
        for _ in range(self._turns):
            own = self._wiring, self._drives, self._motors
            turn_motors(*own, effort, torque, push, seconds, share)
            self.batch.step(None, nstep=steps, stage=_VELOCITY)
        self.note_change()
        read(self._wiring, effort, state)

    def note_change(self, ids: np.ndarray | slice = _ALL) -> None:
        """Have what depends on states of robots computed anew: for who writes to `qpos`, `qvel`."""
        self._stale[ids], self._terms = True, None
        self.changes += 1

    def diverged(self) -> np.ndarray:
        """Return which robots' states can no longer be trusted: (N,) bool.

        MuJoCo restarts a simulation whose state is no longer finite; one that merely moves
        absurdly fast is about to get there.
        """
        return find_diverged(self._wiring, _DIVERGENCE, self.robot.nv, MAX_SPEED)

    def go_on(self) -> None:
        """Continue from what was written to `arrays`, bit for bit."""
        self.batch.forward(stage=_VELOCITY)
        hush(self.batch, np.arange(self.num_robots))
        self.note_change()

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All that the future depends on, by its name in a state; live."""
        motors = {} if self.motors is None else self.motors._asdict()
        waiting = self.loop.arrays if self.loop.most_ticks else {}
        return {
            **{name: self.batch.bind(name) for name in _STATE},
            **{f"motor_{name}": value for name, value in motors.items()},
            **{f"loop_{name}": value for name, value in waiting.items()},
            "contact_force": self.contact_force,
        }


def hush(batch: mujoco.batch.Batch, ids: np.ndarray) -> None:
    """Tell MuJoCo that it has warned once of everything in the simulations `ids` (K,).

    It writes the first warning of a kind to the terminal and to a file in the working directory.
    When it restarts a diverged simulation it clears these counters: that is how `diverged` knows.
    """
    batch.warning[ids, :, 1] = 1


def _check_world(robot: Robot, world: mujoco.MjModel) -> None:
    """Raise an error unless the robot's bodies, coordinates, motors and sensors come first."""
    own = robot.model
    for field in ("body_parentid", "dof_bodyid", "M_rowadr", "actuator_trnid", "sensor_adr"):
        ours, theirs = getattr(own, field), getattr(world, field)
        if len(theirs) < len(ours) or not np.array_equal(theirs[: len(ours)], ours):
            raise RobotError(
                f"The world does not begin with {robot.name!r}: its {field} differ. "
                "Expected a model compiled from a copy of robot.spec with bodies added at the end."
            )

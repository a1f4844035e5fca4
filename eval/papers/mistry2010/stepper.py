"""A controller of ours for figures 8-9, from the paper's parts: it holds where its feet can.

Torques are inverse dynamics of a desired acceleration, and that comes from eq. (19): the feet are
its constraints, the centre of mass and the trunk its task, the squat's posture takes what is left.
What the paper does not have:

- Balance is a law for the divergent component of motion xi = c + cdot / omega, which says where the
  robot falls (T. Takenaka, IROS 2009; J. Englsberger, T-RO 2015). Its centre of pressure is clipped
  to the hull of the soles that stand, plus a little that the swinging trunk makes up for.
- Contact forces are limited to friction cones under the soles, and the trunk's moment yields first.
- A foot in the air moves in space, not in joint angles: it comes down level and beside the other,
  or where the robot falls if that is elsewhere.
- A planned step waits until the robot has got over a push. If it falls beyond its soles, forward or
  backward, it takes a step that was not planned.
"""

from typing import Any, NamedTuple

import numpy as np

from eval.papers.mistry2010.controllers import SplitTorque
from eval.papers.mistry2010.footwork import Footwork, swing
from eval.papers.mistry2010.polygon import Polygon
from eval.papers.trial import Memory
from fbid_gym.control import (
    ContactLimits,
    limited_inverse_dynamics,
    operational_space_acceleration,
    task_acceleration,
)
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.dynamics.frames import quaternion_to_matrix, rotation_vector, skew
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import Steps, stepping
from fbid_gym.quantities import Reference, RobotState
from fbid_gym.robots import Robot

_SIDE = np.array([1.0, -1.0])  # left, right
_LOWEST = 0.1  # m, height of the centre of mass; less is a robot that lies


class StepperGains(NamedTuple):
    """Numbers of the controller.

    Attributes:
        balance: k of p = p_plan + (1 + k) (xi - xi_plan), which makes xi return with k omega.
        height: rad/s, critically damped, of the base's height.
        tilt: rad/s, of the base's orientation.
        posture: rad/s, of the joints.
        level: rad/s, of the orientation of a foot in the air.
        grip: 1/s, at which a sole on the ground that creeps or tips comes to rest.
        lift: m, height of a step.
        fastest: m/s^2, limit of the acceleration of a foot in the air.
        friction: coefficient that is counted on.
        sole: share of the sole's length and width that is counted on.
        lunge: m, how far beyond the soles the force may point; the trunk swings then.
        moment: cost of errors of the trunk's moment beside one for forces.
        calm: m, error of xi (forward and sideways) above which no planned step begins.
        edge: m, how near to the ends of the soles xi may come before a foot steps there.
        apart: m that one foot is ahead of the other, above which any side of the hull counts as an
            end.
        dead: m that xi may miss its place by, forward, when a foot lands, and the foot not follow.
        cover: m, how far beyond xi a foot lands sideways.
        reach: (2,) m, farthest that a foot follows xi, forward and sideways.
    """

    balance: float = 6.0
    height: float = 10.0
    tilt: float = 10.0
    posture: float = 8.0
    level: float = 30.0
    grip: float = 25.0
    lift: float = 0.05
    fastest: float = 60.0
    friction: float = 0.7
    sole: float = 0.98
    lunge: float = 0.03
    moment: float = 0.05
    calm: float = 0.025
    edge: float = 0.015
    apart: float = 0.05
    dead: float = 0.02
    cover: float = 0.045
    reach: tuple[float, float] = (0.35, 0.25)


class Footing(NamedTuple):
    """Where N robots stand.

    Attributes:
        upright: (N, 3, 3) world from the level axes ahead, to the left and up.
        ground: (N,) m, height of the feet that stand.
        beside: (N, 2, 2) m, where each foot belongs beside the other.
        middle: (N, 2) m, between the feet; one in the air counts as where it belongs.
        arms: (N, P, 3) m, contact points from their foot's reference, world axes.
        points: (N, P, 2) m, contact points from above.
        on: (N, P) bool, points of feet that stand.
    """

    upright: np.ndarray
    ground: np.ndarray
    beside: np.ndarray
    middle: np.ndarray
    arms: np.ndarray
    points: np.ndarray
    on: np.ndarray

    @property
    def heading(self) -> np.ndarray:
        """(N, 2, 2) world from the level axes ahead and to the left."""
        return self.upright[:, :2, :2]


class Capture(NamedTuple):
    """Where N robots fall, and what is done about it.

    Attributes:
        omega: (N, 1) 1/s.
        xi: (N, 2) m, divergent component of motion.
        xi_plan: (N, 2) m, where the motion has it.
        hull: of the soles that stand.
        pressure: (N, 2) m, centre of pressure wanted, within the hull.
        pull: (N, 2) m/s^2, acceleration of the centre of mass.
    """

    omega: np.ndarray
    xi: np.ndarray
    xi_plan: np.ndarray
    hull: Polygon
    pressure: np.ndarray
    pull: np.ndarray


class Seen(NamedTuple):
    """What the controller knows on one tick.

    Attributes:
        state: of the robots.
        terms: their dynamics.
        plan: what trunk and squat shall do.
        footing: where they stand.
        capture: where they fall.
    """

    state: RobotState
    terms: DynamicsTerms
    plan: Reference
    footing: Footing
    capture: Capture


class Stepper:
    """Squat and step, and stay up. A `Controller` for bipeds with a left and a right foot.

    The memory gets "base" and "base_target" (N, 2) m in the frame of the feet, and the entries of
    `Footwork`.

    Attributes:
        plan: the motion with its feet on the ground throughout: what trunk and squat shall do.
    """

    def __init__(self, robot: Robot, steps: Steps) -> None:
        """For the motion `stepping(robot, steps)`."""
        home = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
        self.robot, self.gains, self.geometry = robot, StepperGains(), contact_geometry(robot)
        self.plan = stepping(robot, steps._replace(lift=(0.0, 0.0, 0.0), ramp=0.0))
        self._footwork = Footwork(1.0 / self.plan.hz, steps.single * steps.period)
        # m, of each foot from the middle; lever arm that makes moments comparable to forces.
        self._width = float(home.foot_position[0, 0, 1]) + steps.spread
        self._length = Stance.of(robot).radius

    def memory(self, num_robots: int) -> Memory:
        """See `Controller`."""
        standing = self._footwork.memory(np.ones((num_robots, 2), bool))
        return standing | {"begun": False, "warm_start": np.zeros((num_robots, 6))}

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: Reference, memory: Memory
    ) -> SplitTorque:
        """See `Controller`. The goal is not used: `plan` is it, without the lifted legs."""
        plan = self.plan.reference(state.tick)
        if not memory["begun"]:
            memory.update(self._footwork.memory(plan.planted), begun=True)
        footing = self._footing(terms, memory["swings"])
        seen = Seen(state, terms, plan, footing, self._capture(footing, terms, plan))
        self._step(seen, memory)
        on = ~memory["swings"][:, self.geometry.foot_of_point]
        feet = self._feet(seen, memory)
        # Eq. (19)'s constraints; the feet in the air are to move.
        held = (
            terms.foot_jacobian.reshape(len(on), 12, -1),
            (terms.foot_bias - feet).reshape(len(on), 12),
        )
        torque = self._torque(seen, on, held, self._acceleration(seen, held), memory)
        base = np.vecmat(terms.base_position[:, :2] - footing.middle, footing.heading)
        memory["base"], memory["base_target"] = base, plan.qpos[:, :2]
        friction = self.robot.joint_damping * state.qvel[:, 6:]
        return SplitTorque(torque + friction, np.zeros_like(torque))

    def _footing(self, terms: DynamicsTerms, swings: np.ndarray) -> Footing:
        """Look at the feet; `swings` (N, 2) bool are those in the air."""
        foot, turn, owner = terms.foot_position, terms.world_from_foot, self.geometry.foot_of_point
        share = ~swings / (~swings).sum(axis=1, keepdims=True)
        ahead = np.vecmat(share, turn[:, :, :2, 0])
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        beside = foot[:, ::-1, :2] + 2.0 * self._width * _SIDE[:, None] * aside[:, None]
        upright = np.zeros((len(foot), 3, 3))
        upright[:, :2, 0], upright[:, :2, 1], upright[:, 2, 2] = ahead, aside, 1.0
        arms = np.matvec(turn[:, owner], self.gains.sole * self.geometry.offset)
        return Footing(
            upright=upright,
            ground=np.vecdot(share, foot[..., 2]),
            beside=beside,
            middle=np.where(swings[..., None], beside, foot[..., :2]).mean(axis=1),
            arms=arms,
            points=foot[:, owner, :2] + arms[..., :2],
            on=~swings[:, owner],
        )

    def _capture(self, footing: Footing, terms: DynamicsTerms, plan: Reference) -> Capture:
        """Choose the centre of pressure, and with it how the centre of mass accelerates."""
        height = np.maximum(terms.com[:, 2] - footing.ground, _LOWEST)
        gravity = -self.robot.model.opt.gravity[2]
        omega = np.sqrt((gravity + plan.qacc[:, 2]) / height)[:, None]
        com = terms.com[:, :2]
        xi = com + terms.com_velocity[:, :2] / omega
        ahead = plan.com_in_support[:, :2] + plan.com_velocity_in_support[:, :2] / omega
        below = plan.com_in_support[:, :2] - plan.com_acceleration_in_support[:, :2] / omega**2
        xi_plan = footing.middle + np.matvec(footing.heading, ahead)
        p_plan = footing.middle + np.matvec(footing.heading, below)

        hull = Polygon.around(footing.points, footing.on)
        wanted = p_plan + (1.0 + self.gains.balance) * (xi - xi_plan)
        pressure = hull.nearest(wanted)
        beyond = wanted - pressure
        size = np.linalg.norm(beyond, axis=1, keepdims=True)
        lunge = beyond * np.minimum(1.0, self.gains.lunge / np.maximum(size, 1e-9))
        return Capture(omega, xi, xi_plan, hull, pressure, omega**2 * (com - pressure - lunge))

    def _step(self, seen: Seen, memory: Memory) -> None:
        """Lift and land."""
        state, terms, plan, footing, capture = seen
        gains, foot = self.gains, terms.foot_position[..., :2]
        owner = self.geometry.foot_of_point == np.arange(2)[:, None]
        load = state.contact_force[..., 2] @ owner.T
        error = np.vecmat(capture.xi - capture.xi_plan, footing.heading)
        calm = (np.abs(error) < gains.calm).all(axis=1)
        # Sideways no foot can step without crossing the other: only ahead and behind count.
        ahead = footing.heading[:, :, 0]
        forward = np.vecdot(footing.points - footing.middle[:, None], ahead[:, None])
        place = np.vecdot(capture.xi - footing.middle, ahead)
        front = np.where(footing.on, forward, -np.inf).max(axis=1) - gains.edge
        back = np.where(footing.on, forward, np.inf).min(axis=1) + gains.edge
        apart = np.abs(np.vecdot(foot[:, 0] - foot[:, 1], ahead)) > gains.apart
        lost = (place > front) | (place < back) | (apart & (capture.hull.margin(capture.xi) < 0.0))
        # The robot stays on the foot that is nearer to where it falls.
        far = np.linalg.norm(foot - capture.xi[:, None], axis=2)
        farther = far == far.max(axis=1, keepdims=True)
        self._footwork.advance(plan.planted, load, calm, lost[:, None] & farther, memory)

    def _feet(self, seen: Seen, memory: Memory) -> np.ndarray:
        """Wanted accelerations of the feet: (N, 2, 6) m/s^2 and rad/s^2, world axes."""
        _, terms, _, footing, capture = seen
        gains, rows = self.gains, np.arange(len(footing.ground))
        swings, clock, span = memory["swings"], memory["clock"], memory["span"]
        air, which = swings.any(axis=1), swings.argmax(axis=1)
        tilted = rotation_vector(footing.upright[:, None] @ terms.world_from_foot.mT)
        feet = -gains.grip * terms.foot_velocity
        feet[..., 3:5] += (0.5 * gains.grip) ** 2 * tilted[..., :2]

        # Where the robot will fall when the foot lands, the pressure held where it is.
        left = np.maximum(span - clock, 0.0)[:, None]
        xi = capture.pressure + (capture.xi - capture.pressure) * np.exp(capture.omega * left)
        shift = np.vecmat(xi - capture.xi_plan, footing.heading)
        shift = np.sign(shift) * np.maximum(np.abs(shift) - gains.dead, 0.0)
        outward = np.vecdot(xi - footing.middle, footing.heading[:, :, 1]) * _SIDE[which]
        shift[:, 0] = np.clip(shift[:, 0], -gains.reach[0], gains.reach[0])
        shift[:, 1] = _SIDE[which] * np.clip(
            outward + gains.cover - self._width, 0.0, gains.reach[1]
        )
        target = np.empty((len(rows), 3))
        target[:, :2] = footing.beside[rows, which] + np.matvec(footing.heading, shift)
        target[:, 2] = footing.ground
        velocity = terms.foot_velocity[rows, which]
        fly = swing(
            terms.foot_position[rows, which], velocity[:, :3], target, clock, span,
            gains.lift, gains.fastest,
        )  # fmt: skip
        turn = gains.level**2 * tilted[rows, which] - 2.0 * gains.level * velocity[:, 3:]
        feet[rows[air], which[air]] = np.concatenate([fly, turn], axis=1)[air]
        return feet

    def _acceleration(self, seen: Seen, held: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Eq. (19) with feet that may move, a task of six rows and a posture: (N, nv)."""
        state, terms, plan, footing, capture = seen
        gains, (count, size) = self.gains, state.qvel.shape
        # The linear rows of M are the mass times the centre of mass's Jacobian.
        jacobian, bias = np.zeros((count, 6, size)), np.zeros((count, 6))
        jacobian[:, :2] = terms.mass_matrix[:, :2] / self.robot.mass
        jacobian[:, 2:, 2:6] = np.eye(4)
        bias[:, :2] = terms.bias[:, :2] / self.robot.mass

        facing = footing.upright @ quaternion_to_matrix(plan.qpos[:, 3:7])
        lean = rotation_vector(terms.world_from_base.mT @ facing)
        height = terms.base_position[:, 2] - footing.ground
        task = np.empty((count, 6))
        task[:, :2] = capture.pull
        task[:, 2:3] = _returning(
            gains.height,
            (plan.qpos[:, 2:3], plan.qvel[:, 2:3], plan.qacc[:, 2:3]),
            (height[:, None], state.qvel[:, 2:3]),
        )
        task[:, 3:] = _returning(
            gains.tilt,
            (lean, plan.qvel[:, 3:6], plan.qacc[:, 3:6]),
            (np.zeros_like(lean), state.qvel[:, 3:6]),
        )
        posture = np.zeros((count, size))
        posture[:, 6:] = _returning(
            gains.posture,
            (plan.qpos[:, 7:], plan.qvel[:, 6:], plan.qacc[:, 6:]),
            (state.qpos[:, 7:], state.qvel[:, 6:]),
        )
        found = operational_space_acceleration(*held, jacobian, bias, task, posture)
        return found.motion

    def _torque(
        self,
        seen: Seen,
        on: np.ndarray,
        held: tuple[np.ndarray, np.ndarray],
        acceleration: np.ndarray,
        memory: Memory,
    ) -> np.ndarray:
        """Inverse dynamics with limited forces; feet in the air move as told and carry nothing."""
        count, owner, points = len(on), self.geometry.foot_of_point, self.geometry.num_points
        rows = np.arange(points)
        spread = np.zeros((count, 2, 6, points, 3))
        spread[:, owner, :3, rows] = np.eye(3)
        spread[:, owner, 3:, rows] = skew(seen.footing.arms).swapaxes(0, 1)
        spread *= on[:, None, None, :, None]
        cost = self.gains.moment
        law = limited_inverse_dynamics(
            seen.terms.mass_matrix,
            seen.terms.bias,
            held[0],
            acceleration,
            held[1],
            ContactLimits(self.gains.friction),
            point_map=spread.reshape(count, 12, -1),
            active=on,
            length=self._length,
            wrench_cost=(1.0, 1.0, 1.0, cost, cost, cost),
            warm_start=memory["warm_start"],
        )
        memory["warm_start"] = law.warm_start
        return law.torque


def _returning(omega: float, plan: tuple[Any, Any, Any], now: tuple[Any, Any]) -> np.ndarray:
    """Critically damped return to a plan: its position, rate and acceleration, against now."""
    return np.asarray(
        task_acceleration(
            plan[0], now[0], now[1], omega**2, 2.0 * omega,
            desired_velocity=plan[1], desired_acceleration=plan[2],
        )
    )  # fmt: skip

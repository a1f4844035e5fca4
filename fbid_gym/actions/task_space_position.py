"""Layer `task_space_position`: the action moves targets of body and feet, held by PD on them."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import scipy.linalg

from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.joint_gains import (
    JointGains,
    damped_enough,
    default_frequency,
    fed_drag,
    greatest_share,
    growth,
    missing_damping,
    sampled_growth,
)
from fbid_gym.actions.joint_motion import (
    LegJoints,
    WayLeft,
    lead_foot,
    legs_of,
    room_for,
    see_body,
    see_foot,
    solve_leg,
)
from fbid_gym.actions.layer import GetTerms, Memoryless
from fbid_gym.actions.pendulum import Pendulum, carry
from fbid_gym.actions.ranges import DampingRatio, Frequency, LoopDelay, TargetScale
from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.vectors import matrix, turn
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Number, checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import add_transposed_times

_TINY = 1e-12  # keeps the direction of a body that points up or down defined
_ROUNDING = 1e-7  # of a growth of one
_NEUTRAL = 1e-5  # likewise, where nothing holds the body
_RANK = 1e-9


class Reach(NamedTuple):
    """Gains of body and feet; constants of a robot with n joints."""

    legs: LegJoints  # which joints move which foot
    stiffness: np.ndarray  # (rows,) N/m, N·m/rad: of a foot's place, and of its rotation
    joints: JointGains  # gains of the joints; those of legs have no stiffness
    feet_scale: float  # m, by which action 1 moves a foot


@dataclass(frozen=True, eq=False)
class TaskSpacePosition(Memoryless):
    """tau = what carries the robot + sum of J^T K (gap of each foot) + K_D (qdot_t - qdot).

    The gap is what is left of a foot's way to its target with the body at its own: a foot that
    stands pushes the body there. It is that of `joint_position`, and so are the rates of the joints
    and their damping; only the stiffness is that of places instead of joints,

        K = m / F (2 pi f)^2,

    m / F being the mass of the robot for each of its feet; of a foot's rotation times the square of
    the height of the centre of mass. It is limited as those of joints are, see `JointGains`: all of
    it by one share, and then the vertical's, which carries the weight, by as little as it can be.
    What damps the body through feet that bear it (`LegJoints.calm`) is limited likewise, in the air
    and on all feet.
    """

    robot: Robot  # whose joints
    reach: Reach  # of body and feet
    pendulum: Pendulum  # what carries the robot
    scale: np.ndarray  # (6,) m and rad, by which action 1 moves the body
    natural_frequency: float  # Hz

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        kind: MotionKind,
        *,
        gravity: bool = False,
        leg_weight: bool = True,
        natural_frequency: Frequency | None = None,
        damping_ratio: DampingRatio = 1.0,
        loop_delay: LoopDelay = 0.0,
        scale: Annotated[float, Number(1e-6, 10.0)] = 0.1,
        rotation_scale: TargetScale = 0.3,
    ) -> "TaskSpacePosition":
        """Derive the gains.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            gravity: whether the weight of every link is compensated where the robot is, with the
                ground's forces where the target has the centre of pressure. Else the feet carry the
                robot as a pendulum.
            leg_weight: whether a pendulum's legs also hold their own weight, see `joint_position`.
            natural_frequency: f in Hz. Default: 3.4 times that at which it falls, see `Falling`,
                2.5 times on soles on a gait.
            damping_ratio: zeta of the joints.
            loop_delay: s from the state to the torque that answers it, for which gains are steady.
            scale: m at action 1, of body and feet, in heights of the centre of mass.
            rotation_scale: rad at action 1, of the body.

        Raises:
            InvalidValueError: beyond what any joint can be held with.
            RobotError: a foot has no joints of its own to place it.
        """
        frequency = natural_frequency or default_frequency(kind, robot)
        joints = JointGains.of(robot, control_hz, frequency, damping_ratio, loop_delay)
        legs = legs_of(robot, default_gains(robot, kind), aware=False, calm=0.0)
        height = float(Stance.of(robot).home_com[2])
        own = Stance.of(robot).legs.any(axis=0)
        held = fed_drag(robot, joints._replace(stiffness=np.where(own, 0.0, joints.stiffness)))
        stiffness = _stiffness(robot, control_hz, joints, held, loop_delay)
        calm = _calm(robot, control_hz, stiffness, held, missing_damping(joints), loop_delay)
        return cls(
            robot=robot,
            reach=Reach(legs._replace(calm=calm), stiffness, held, scale * height),
            pendulum=Pendulum.of(robot, kind, links=gravity, leg_weight=leg_weight),
            scale=np.repeat([scale * height, rotation_scale], 3),
            natural_frequency=joints.natural_frequency,
        )

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six of the body, three of each foot."""
        ways = ("ahead", "to the left", "up")
        names = [f"target of the body {way}, heading (x {self.scale[0]:.3g} m)" for way in ways]
        names += [
            f"rotation of the body, base {axis} (x {self.scale[3]:.3g} rad)" for axis in "xyz"
        ]
        feet = self.robot.foot_names
        size = f"(x {self.reach.feet_scale:.3g} m)"
        return (*names, *(f"target of {foot} {way}, trunk {size}" for foot in feet for way in ways))

    @property
    def per_acceleration(self) -> np.ndarray:
        """Action for each m/s^2 of the body ahead and to the left, (2,): by half of the feet."""
        pushing = max(self.robot.num_feet // 2, 1) * self.reach.stiffness[0]
        return self.robot.mass / pushing / self.scale[:2]

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known = terms()
        held = carry(self.pendulum, target, known)
        body = self.scale * action[:, :6]
        feet = self.reach.feet_scale * action[:, 6:]
        return reach_out(self.reach, body, feet, held, state, target, known)


@kernel
def reach_out(
    reach: Reach,
    moved_body: np.ndarray,
    moved_feet: np.ndarray,
    held: np.ndarray,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
) -> np.ndarray:
    """Return the torques (N, n) N·m that bring body and feet to their targets, and those `held`.

    The body's target is moved by `moved_body` (N, 6), m along the heading and rad in the base's
    axes; those of the feet by `moved_feet` (N, 3F), m in the trunk's axes.
    """
    legs, gains = reach.legs, reach.joints
    (count, size), (feet, most), rows = state.qvel.shape, legs.own.shape, legs.rows
    torque = np.empty((count, size - 6))
    body = WayLeft(np.zeros(6), np.zeros(6), np.zeros(6))
    as_is = WayLeft(np.zeros(6), np.empty(6), body.acceleration)
    led = WayLeft(np.zeros(6), body.rate, body.acceleration)
    left, moves, force, pull = room_for(rows), room_for(most), np.empty(rows), np.empty(most)
    jacobian, lower = np.empty((rows, most)), np.empty((rows, rows))
    for i in range(count):
        for j in range(size - 6):
            error = target.qpos[i, 7 + j] - state.qpos[i, 7 + j]
            rate = target.qvel[i, 6 + j] - state.qvel[i, 6 + j]
            torque[i, j] = held[i, j] + gains.stiffness[j] * error
            torque[i, j] += gains.damping[j] * rate + gains.drag[j] * target.qvel[i, 6 + j]
        see_body(legs, target, terms, body, i)
        body.rate[2] = target.qvel[i, 2]
        _move_body(moved_body, terms, body, i)
        for k in range(6):
            as_is.rate[k] = state.qvel[i, k]
        for foot in range(feet):
            own = legs.own[foot]
            for r in range(rows):
                for k in range(most):
                    there = own[k] >= 0
                    jacobian[r, k] = terms.foot_jacobian[i, foot, r, 6 + own[k]] if there else 0.0
            lead_foot(legs, body, as_is, target.load[i, foot], led)
            see_foot(target, terms, led, left, i, foot)
            at = 3 * foot
            moved = moved_feet[i, at], moved_feet[i, at + 1], moved_feet[i, at + 2]
            added = turn(matrix(terms.world_from_trunk, (i,)), moved)
            left.gap[0], left.gap[1], left.gap[2] = (
                left.gap[0] + added[0],
                left.gap[1] + added[1],
                left.gap[2] + added[2],
            )
            for r in range(rows):
                force[r] = reach.stiffness[r] * left.gap[r]
            for k in range(most):
                pull[k] = 0.0
            add_transposed_times(jacobian, force, pull)
            solve_leg(jacobian, lower, left, moves)
            for k in range(most):
                j = own[k]
                if j >= 0:
                    # Instead of the target's own rate, which of legs says nothing.
                    rate = moves.rate[k] - target.qvel[i, 6 + j]
                    torque[i, j] += pull[k] + (gains.damping[j] + gains.drag[j]) * rate
    return torque


@compiled
def _move_body(moved: np.ndarray, terms: DynamicsTerms, body: WayLeft, i: int) -> None:
    """Move the body's target by (N, 6), see `reach_out`."""
    x, y = terms.world_from_trunk[i, 0, 0], terms.world_from_trunk[i, 1, 0]
    size = np.hypot(x, y) + _TINY
    body.gap[0] += (x * moved[i, 0] - y * moved[i, 1]) / size
    body.gap[1] += (y * moved[i, 0] + x * moved[i, 1]) / size
    for k in range(2, 6):
        body.gap[k] += moved[i, k]


def _stiffness(
    robot: Robot, control_hz: int, joints: JointGains, held: JointGains, loop_delay: float
) -> np.ndarray:
    """Return that of a foot's rows, as great as the joints' damping and sampling allow."""
    stance, rows = Stance.of(robot), 6 if robot.has_soles else 3
    tilting, turning = float(stance.home_com[2]) ** 2, stance.terms.mass_matrix[0, 5, 5]
    inertia = np.array([1.0, 1.0, 1.0, tilting, tilting, turning / robot.mass])[:rows]
    inertia *= robot.mass / robot.num_feet
    jacobians = stance.terms.foot_jacobian[0, :, :rows, 6:] * stance.legs[:, None]
    wanted = inertia * (2.0 * np.pi * joints.natural_frequency) ** 2
    # The damping of each row that the joints' is while the foot goes along it and nowhere else, or
    # hardly anywhere, if its leg has too few joints.
    yields = np.einsum("frj,j,fsj->frs", jacobians, 1.0 / joints.damping, jacobians)
    resists = np.linalg.pinv(yields, rcond=_RANK, hermitian=True)
    goes = np.diagonal(yields @ resists, axis1=1, axis2=2)
    damping = np.diagonal(resists, axis1=1, axis2=2) / np.maximum(goes, _RANK) ** 2
    damping = np.where(goes > _RANK, damping, np.inf).min(axis=0)
    most = damped_enough(wanted, damping, inertia) if robot.has_soles else wanted
    for alike in (slice(0, 3), slice(3, 5)):  # in the world's axes, whichever way the robot faces
        most[alike] = most[alike].min(initial=np.inf)
    others = np.diag(held.stiffness)

    def steady(rows: np.ndarray) -> bool:
        pulled = np.einsum("frj,r,frk->jk", jacobians, rows, jacobians) + others
        # With little stiffness joints stay nearly where they are: rounding is not to count.
        grown = sampled_growth(robot, pulled, joints.damping, control_hz, loop_delay)
        return grown < 1.0 + _ROUNDING

    found = min(1.0, greatest_share(lambda share: steady(share * most))) * most
    upright = np.eye(rows)[2]
    alone = greatest_share(lambda share: steady(found + upright * (share * most - found)))
    return np.maximum(found, min(1.0, alone) * upright * most)


def _calm(
    robot: Robot,
    control_hz: int,
    stiffness: np.ndarray,
    held: JointGains,
    wanted: float,
    loop_delay: float,
) -> float:
    """Return as much of a wanted `LegJoints.calm`, s, as lets no mode of motion grow.

    Neither of the robot at home in the air, v = B u with B = 1, where feet are that bear less than
    is planned, nor with all feet held where they are. The body's target stays where it is: of gaps
    of the feet those are left that the joints make.
    """
    if wanted == 0.0:
        return 0.0
    stance, rows = Stance.of(robot), len(stiffness)
    mass_matrix, feet = stance.terms.mass_matrix[0], stance.terms.foot_jacobian[0, :, :rows]
    legs = feet[:, :, 6:] * stance.legs[:, None]
    springs = np.einsum("frj,r,frk->jk", legs, stiffness, legs) + np.diag(held.stiffness)
    # The force of each foot that answers how fast the base rises, falls and turns.
    base = wanted * np.einsum("frj,r,frk->jk", legs, stiffness, feet[:, :, 2:6])
    flying = np.eye(robot.nv)
    standing = scipy.linalg.null_space(feet.reshape(-1, robot.nv), rcond=_RANK)

    def steady(share: float, moves: np.ndarray) -> bool:
        yields = np.linalg.solve(moves.T @ mass_matrix @ moves, moves[6:].T)
        damped = yields @ (held.damping[:, None] * moves[6:] - share * base @ moves[2:6])
        grown = growth(yields @ springs @ moves[6:], damped, control_hz, loop_delay)
        return grown < 1.0 + _NEUTRAL

    most = greatest_share(lambda share: steady(share, flying) and steady(share, standing))
    return min(1.0, most) * wanted

"""The law of a body on its feet: what a robot shall do now becomes joint torques.

Feet go first: those that stand stay, those in the air go where the target has them (layers that
command joints let them go). Then comes the body, in what the feet leave, then the joints, then the
contact forces within the friction cones, then the torques: see `fbid_gym.control.whole_body`.
Standing is this law with all feet planted.

Layers differ in their `Command`. With `contact_limits="none"` the same accelerations become torques
by [M10] eq. (15), whose contact forces can pull and never slip.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY
from fbid_gym.control.grip import GripModel, notice_slip
from fbid_gym.control.inverse_dynamics import invert_dynamics
from fbid_gym.control.motor_limits import (
    PASSES,
    MotorModel,
    ask_more,
    believed_strength,
    bound_forces,
    exceed_limits,
)
from fbid_gym.control.whole_body import (
    FREE,
    MOVES,
    STANDS,
    Feet,
    MotionRows,
    Work,
    contact_error,
    deliver_forces,
    factor_legs,
    joint_torques,
    missing_directions,
    move_with_feet,
    put_together,
    room_to_move,
    room_to_work,
    serve_body,
    yield_to_limits,
)
from fbid_gym.dynamics.contacts import reduce_contacts
from fbid_gym.dynamics.passive_joints import PassiveJoints, give_back
from fbid_gym.dynamics.rotations import rotation_at, turned_left
from fbid_gym.dynamics.stance import Limbs
from fbid_gym.dynamics.vectors import (
    NOTHING,
    Rotation,
    Vector,
    add,
    add_share,
    cross,
    matrix,
    product,
    scale,
    six,
    store_six,
    subtract,
    transposed,
    turn,
    vector,
)
from fbid_gym.quantities import (
    BodyGains,
    Constraint,
    ContactGeometry,
    DynamicsTerms,
    EquationOfMotion,
    Memory,
    RobotState,
    Target,
)
from fbid_gym.small_matrices import copy, dot, times

NONE = np.empty((0, 6))
"""What a `Command` leaves out."""

_LEAST_LOAD = 0.02  # of a foot's greatest force, so that it is held down


class LawConstants(NamedTuple):
    """Constants of the law on one robot."""

    gains: BodyGains  # of feet and base
    limbs: Limbs  # which joints move which feet
    geometry: ContactGeometry  # of the contact points
    limits: np.ndarray  # (1, P, 3) of `limit_rows`
    most_load: float  # of the weight, on one foot
    mobility: np.ndarray  # (nv,) how readily each coordinate departs from what it shall do
    least_gain: np.ndarray  # (6,) of a task of the body
    # (6,) turns errors of the wrench on the base into N whose squares are comparable.
    nearness: np.ndarray
    gravity: float  # m/s^2
    ahead: np.ndarray  # (3,) the trunk's forward direction in the base's axes
    turning_inertia: np.ndarray  # (3, 3) kg·m^2, what a moment has to overcome to turn the base
    turning_mobility: np.ndarray  # (3, 3) its inverse
    feet_first: bool  # whether feet in the air are moved as tasks; else they follow their joints
    passive: PassiveJoints  # what joints take of their torques, to be given back
    motors: MotorModel  # what is believed of them
    grip: GripModel  # when feet slip


class Command(NamedTuple):
    """Commands of a layer to N robots at a tick."""

    # (N, nv) accelerations that the robots stay near to, m/s^2 and rad/s^2. (0, 6): those of
    # `stabilise`, to whose `body` this one adds; with a push the base's height and rotation
    # accelerate as the target's.
    reference: np.ndarray
    # (N, m) accelerations of the body that go before these, m of 0, 2 or 6: of the centre of mass
    # in the world's x and y (m/s^2), of the base's height (m/s^2), and of its rotation (rad/s^2,
    # base's axes).
    body: np.ndarray
    # (N, 6) N and N·m to add at the centre of mass, along the heading; with it the body is moved by
    # its momentum, see `_move_momentum`. (0, 6): it is not.
    push: np.ndarray

    @classmethod
    def to_target(cls, added: np.ndarray) -> "Command":
        """Return that which brings robots to their target, with what (N, 6) adds to `body`."""
        return cls(NONE, added, NONE)


class LawMemory(NamedTuple):
    """Memory of the law on N robots; the law updates it."""

    warm_start: np.ndarray  # (N, 6) of the contact forces
    # (N,) share of the weight by which the wrench on the base misses the desired one, and of
    # gravity by which contacts would move.
    residual: np.ndarray
    underactuation: np.ndarray  # (N,) directions of the base that the contacts cannot push
    strength: np.ndarray  # (N,) share of their torques that the motors are taken to give
    grip: np.ndarray  # (N,) share of the coefficient of friction that is counted on
    allowed: np.ndarray  # (N, F) m/s that feet which carry may have, see `notice_slip`
    priority: np.ndarray  # (N,) factor on errors of the moment, as the layer has it at this tick
    vertical: np.ndarray  # (N, 4) of the robots' vertical motion, see `believed_strength`
    acceleration: np.ndarray  # (N, nv) that its last torques were made for

    @classmethod
    def of(cls, memory: Memory) -> "LawMemory":
        """Return the law's part of a layer's memory, to be updated in place."""
        return cls(*map(memory.__getitem__, cls._fields))


@kernel
def torque_within_limits(
    law: LawConstants,
    command: Command,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    active: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) whose contact forces keep within their limits; updates the memory."""
    count, size = terms.bias.shape
    slipping = memory.allowed, memory.grip
    notice_slip(law.grip, law.geometry, law.gravity, state, terms, active, *slipping)
    feet = _feet(law, memory.grip, target, terms, active)
    work = room_to_work(law.limbs, law.geometry, law.mobility)
    motion, carried = room_to_move(law.limbs, law.geometry), room_to_move(law.limbs, law.geometry)
    torque, start, nearness = np.empty((count, size - 6)), np.empty(6), np.empty(6)
    command = stabilise(law, command, state, target, terms)
    for i in range(count):
        _move(law, command, state, target, terms, feet, i, work, motion, carried)
        copy(law.nearness, nearness)
        for k in range(3):
            nearness[3 + k] *= memory.priority[i] * math.sqrt(target.moment[i, k])
        _hold(law, nearness, state, terms, feet, memory, i, start, work, motion, torque)
    give_back(law.passive, torque, state.qpos, state.qvel)
    ask_more(memory.strength, torque)
    return torque


@compiled
def _hold(
    law: LawConstants,
    nearness: np.ndarray,
    state: RobotState,
    terms: DynamicsTerms,
    feet: Feet,
    memory: LawMemory,
    i: int,
    start: np.ndarray,
    work: Work,
    motion: MotionRows,
    torque: np.ndarray,
) -> None:
    """Write the torques (N, n) of one robot's motion, as far as forces within their limits go."""
    weight, past = law.gravity * terms.mass_matrix[i, 0, 0], memory.vertical[i]
    missing, missed = work.forces.point.missing, work.forces.trial.missing
    strength = believed_strength(law.motors, law.gravity, terms, past, i)
    copy(memory.warm_start[i], start)
    for times_bound in range(1 + PASSES):
        if times_bound == 0:
            deliver_forces(
                law.geometry, feet, terms, nearness, DEFAULT_ACCURACY, weight, start,
                memory.warm_start[i], i, work, motion,
            )  # fmt: skip
            copy(missing, missed)
        elif not exceed_limits(
            law.motors.line, strength, state.qvel, torque[i], i
        ) or not bound_forces(
            law.motors.line, strength, DEFAULT_ACCURACY, weight, terms, state.qvel, torque[i], i,
            work, missed,
        ):  # fmt: skip
            break
        yield_to_limits(law.mobility, nearness, terms, i, work, motion)
        put_together(law.limbs, work, motion)
        joint_torques(terms, i, work, motion, torque[i])
    missed_share = np.sqrt(dot(missed, missed)) / weight
    memory.strength[i] = strength
    copy(motion.whole, memory.acceleration[i])
    past[1] = (motion.momentum[2] + terms.bias[i, 2]) / strength
    moved = contact_error(law.limbs, feet, i, work, motion) / law.gravity
    memory.residual[i] = np.hypot(missed_share, moved)
    memory.underactuation[i] = missing_directions(terms, i, work)


@kernel
def torque_without_limits(
    law: LawConstants,
    command: Command,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    active: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) by [M10] eq. (15), whose contact forces have no limits."""
    desired = desired_acceleration(law, command, state, target, terms, active)
    contacts = reduce_contacts(law.geometry, active, terms)
    # Of the motion that is desired, which damps what feet move that stand.
    held = np.empty(contacts.bias.shape)
    for i in range(len(held)):
        times(contacts.jacobian[i], desired[i], held[i])
        held[i] *= -1.0
    standing = Constraint(contacts.jacobian, held)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    alike = np.empty((0, desired.shape[1] - 6))
    found = invert_dynamics(motion, standing, desired, alike, law.mobility)
    copy(found.underactuation, memory.underactuation)
    copy(desired, memory.acceleration)
    return give_back(law.passive, found.torque, state.qpos, state.qvel)


@kernel
def desired_acceleration(
    law: LawConstants,
    command: Command,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    active: np.ndarray,
) -> np.ndarray:
    """Return the accelerations (N, nv) that a command comes to, before forces have limits."""
    feet = _feet(law, np.ones(len(active)), target, terms, active)
    work = room_to_work(law.limbs, law.geometry, law.mobility)
    motion, carried = room_to_move(law.limbs, law.geometry), room_to_move(law.limbs, law.geometry)
    desired = np.empty(terms.bias.shape)
    command = stabilise(law, command, state, target, terms)
    for i in range(len(desired)):
        _move(law, command, state, target, terms, feet, i, work, motion, carried)
        put_together(law.limbs, work, motion)
        copy(motion.whole, desired[i])
    return desired


@compiled
def _feet(
    law: LawConstants, grip: np.ndarray, target: Target, terms: DynamicsTerms, active: np.ndarray
) -> Feet:
    """Return the motion of the feet, and the forces that their points can bear."""
    (count, feet), points = target.planted.shape, active.shape[1]
    asked, acceleration = np.full((count, feet), FREE), np.zeros((count, feet, 6))
    asking = Feet(asked, acceleration, active, np.empty((count, points, 3)))
    _ask(law, grip, target, terms, asking)
    return asking


@compiled
def _ask(
    law: LawConstants, grip: np.ndarray, target: Target, terms: DynamicsTerms, asking: Feet
) -> None:
    """Write what is asked of the feet, whose active points are known."""
    gains, asked, acceleration, limits = law.gains, asking.asked, asking.acceleration, asking.limits
    (count, feet), active = asked.shape, asking.active
    for i in range(count):
        weight, stands = law.gravity * terms.mass_matrix[i, 0, 0], False
        for point in range(active.shape[1]):
            foot = law.geometry.foot_of_point[point]
            if active[i, point]:
                asked[i, foot], stands = STANDS, True
            friction, least, most = law.limits[0, point]
            load = max(target.load[i, foot], _LEAST_LOAD)
            limits[i, point, 0], limits[i, point, 2] = (
                grip[i] * friction,
                min(most, load * law.most_load * weight),
            )
            limits[i, point, 1] = min(least, limits[i, point, 2])
        for foot in range(feet):
            if asked[i, foot] == STANDS:
                for k in range(6):
                    acceleration[i, foot, k] = -gains.hold * terms.foot_velocity[i, foot, k]
            elif law.feet_first and (stands or not target.planted[i, foot]):
                # In flight, a foot that shall stand has no place to go to: it goes with its leg.
                asked[i, foot] = MOVES
                left = turned_left(
                    matrix(target.world_from_foot, (i, foot)),
                    matrix(terms.world_from_foot, (i, foot)),
                )
                for k in range(6):
                    error = left[k - 3]
                    if k < 3:
                        error = target.foot_position[i, foot, k] - terms.foot_position[i, foot, k]
                    rate = target.foot_velocity[i, foot, k] - terms.foot_velocity[i, foot, k]
                    acceleration[i, foot, k] = target.foot_acceleration[i, foot, k]
                    acceleration[i, foot, k] += gains.swing * error + gains.swing_damping * rate


@compiled
def _move(
    law: LawConstants,
    command: Command,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    feet: Feet,
    i: int,
    work: Work,
    motion: MotionRows,
    carried: MotionRows,
) -> None:
    """Find the motion that a command comes to on the feet: all but its `whole`."""
    copy(command.reference[i], motion.reference)
    factor_legs(
        *(law.limbs, law.geometry, law.mobility, law.gains.give, feet, terms, i, work, motion)
    )
    move_with_feet(law.limbs, law.mobility, feet, terms, i, work, motion)
    size, mass = command.body.shape[1], terms.mass_matrix[i, 0, 0]
    if size > 0:
        _base_rows(mass, work)
        for k in range(size):
            now = motion.base[k]
            if k < 2:
                now = (motion.momentum[k] + terms.bias[i, k]) / mass
            work.share[k] = command.body[i, k] - now
        serve_body(size, law.least_gain, work, motion)
    if len(command.push) > 0:
        _move_momentum(law, command, state, target, terms, feet, i, work, motion, carried)


@compiled
def _base_rows(mass: float, work: Work) -> None:
    """Write rows of the centre of mass in x and y, the base's height and its rotation."""
    for row in range(6):
        share = 1.0 / mass if row < 2 else 0.0
        store_six(add_share(NOTHING, share, six(work.reach, (row,))), work.rows, (row,))
        if row >= 2:
            work.rows[row, row] = 1.0
        for k in range(len(work.free)):
            work.other_rows[row, k] = work.by_others[row, k] / mass if row < 2 else 0.0


@compiled
def _move_momentum(
    law: LawConstants,
    command: Command,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    feet: Feet,
    i: int,
    work: Work,
    motion: MotionRows,
    carried: MotionRows,
) -> None:
    """Have the momentum change as it shall, [G15] (38), (39), with a reference that moves.

    The reference is the momentum h_d that the robot as it stands has if its feet go as they shall
    and its base is carried along as the target has it:

        h' = h_d' + K e + D (h_d - h) + push,    K = w^2 I,

    with springs on the base's height and rotation error e. I is the mass, and for the rotation what
    a moment has to overcome to turn the base between feet that stay: a sixth to a third of the
    locked robot's inertia on long legs, which turn against the trunk. For the same reason h_d' is
    no detail: a moment that ignored what the legs' swing takes would turn the trunk instead. In the
    same units, accelerations of the base, moments are weighed against forces where legs of too few
    joints cannot give both.

    `motion` comes with the accelerations that h_d' is of; `carried` has room for velocities.
    """
    gains, limbs, mobility = law.gains, law.limbs, law.mobility
    mass = terms.mass_matrix[i, 0, 0]
    # How fast robots move that are carried along: the feet as they shall, the body as the target.
    for foot in range(len(limbs.legs)):
        for row in range(carried.asked.shape[1]):
            carried.asked[foot, row] = 0.0
            if feet.asked[i, foot] == MOVES and row < limbs.rows[foot]:
                carried.asked[foot, row] = target.foot_velocity[i, foot, row]
    move_with_feet(limbs, mobility, feet, terms, i, work, carried)
    spin = _target_spin(target, terms, i)
    for k in range(3):
        now = carried.momentum[k] / mass if k < 2 else carried.base[k]
        work.share[k] = (terms.com_velocity[i, k] if k < 2 else target.qvel[i, k]) - now
        work.share[3 + k] = spin[k] - carried.base[3 + k]
    _base_rows(mass, work)
    serve_body(6, law.least_gain, work, carried)
    for row in range(6):
        carried.momentum[row] -= dot(terms.mass_matrix[i, row], state.qvel[i])

    cosine, sine = heading_axes(law, target, i)
    x, y, z = _turned_left(target, terms, i)
    turned = cosine * x + sine * y, cosine * y - sine * x, z
    moment = turn(matrix(law.turning_inertia, ()), turned)
    moment = add(scale(gains.rotation, moment), vector(command.push, (i,), 3))
    moment = cosine * moment[0] - sine * moment[1], sine * moment[0] + cosine * moment[1], moment[2]
    ahead, left = command.push[i, 0], command.push[i, 1]
    rise = target.qpos[i, 2] - terms.base_position[i, 2]
    up = (gains.height * rise * mass) + gains.height_damping * carried.momentum[2]
    # Of a force on the base X makes a wrench at the centre of mass.
    rotation = matrix(terms.world_from_base, (i,))
    arm = subtract(vector(terms.base_position, (i,)), vector(terms.com, (i,)))
    late = turn(rotation, vector(carried.momentum, (), 3))
    late = add(late, cross(arm, vector(carried.momentum, ())))
    along = (cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)
    inverse = product(product(along, matrix(law.turning_mobility, ())), transposed(along))
    sped = turn(inverse, add(moment, scale(gains.rotation_damping, late)))
    work.share[0] = (cosine * ahead - sine * left) / mass
    work.share[1] = (sine * ahead + cosine * left) / mass
    work.share[2] = (up + command.push[i, 2]) / mass
    work.share[3], work.share[4], work.share[5] = sped
    for column in range(6):
        _momentum_column(mass, rotation, arm, inverse, work.reach, column, work.rows)
    for column in range(len(work.free)):
        _momentum_column(mass, rotation, arm, inverse, work.by_others, column, work.other_rows)
    serve_body(6, law.least_gain, work, motion)


@compiled
def _momentum_column(
    mass: float,
    rotation: Rotation,
    arm: Vector,
    inverse: Rotation,
    forces: np.ndarray,
    column: int,
    rows: np.ndarray,
) -> None:
    """Write momentum per mass and per `inverse` inertia to a column (6,), from rows b of M."""
    force = forces[0, column], forces[1, column], forces[2, column]
    moment = forces[3, column], forces[4, column], forces[5, column]
    turning = turn(inverse, add(turn(rotation, moment), cross(arm, force)))
    for k in range(3):
        rows[k, column], rows[3 + k, column] = force[k] / mass, turning[k]


@compiled
def heading_axes(law: LawConstants, target: Target, i: int) -> tuple[float, float]:
    """Return cosine and sine of the heading that robot i shall have."""
    x, y, _ = turn(rotation_at(target.qpos, i, 3), vector(law.ahead, ()))
    size = math.hypot(x, y) + 1e-12
    return x / size, y / size


@compiled
def _turned_left(target: Target, terms: DynamicsTerms, i: int) -> Vector:
    """Axis times sine of the rotation that is left to the base, world axes."""
    wanted = rotation_at(target.qpos, i, 3)
    return turned_left(wanted, matrix(terms.world_from_base, (i,)))


@compiled
def _target_spin(target: Target, terms: DynamicsTerms, i: int) -> Vector:
    """The target's angular velocity, rad/s, in the axes of the base as it is."""
    world = turn(rotation_at(target.qpos, i, 3), vector(target.qvel, (i,), 3))
    return turn(transposed(matrix(terms.world_from_base, (i,))), world)


@kernel
def stabilise(
    law: LawConstants, command: Command, state: RobotState, target: Target, terms: DynamicsTerms
) -> Command:
    """Return a command with a reference: if it has none, that which brings robots to their target.

    The body by its accelerations, horizontally of the centre of mass, else of the base:

        x: a + w^2 (x_target - x) + 2 zeta w (xdot_target - xdot) + what is added

    and the joints in the same way; a is the target's, xdot the base's if so told. What is
    added is the command's `body` (N, 6): m/s^2 along the heading, rad/s^2 in the base's axes.
    """
    if len(command.reference) > 0:
        return command
    found = Command(np.zeros(state.qvel.shape), np.empty((len(state.qvel), 6)), command.push)
    _stabilise(law, command.body, state, target, terms, found)
    return found


@compiled
def _stabilise(
    law: LawConstants,
    added: np.ndarray,
    state: RobotState,
    target: Target,
    terms: DynamicsTerms,
    command: Command,
) -> None:
    """Write a command."""
    gains, reference, body = law.gains, command.reference, command.body
    count, size = reference.shape
    for i in range(count):
        for k in range(6, size):
            error = target.qpos[i, k + 1] - state.qpos[i, k + 1]
            rate = target.qvel[i, k] - state.qvel[i, k]
            reference[i, k] = target.qacc[i, k] + gains.posture * error
            reference[i, k] += gains.posture_damping * rate
        cosine, sine = heading_axes(law, target, i)
        velocity = state.qvel if gains.of_base > 0.0 else terms.com_velocity
        x = target.com_velocity[i, 0] - velocity[i, 0]
        y = target.com_velocity[i, 1] - velocity[i, 1]
        share = min(1.0, gains.small_error / (math.hypot(x, y) + 1e-12))
        damping = gains.balance_damping + share * gains.small_errors
        for k, rate in enumerate((x, y)):
            place = target.com[i, k] - terms.com[i, k]
            body[i, k] = target.com_acceleration[i, k] + gains.balance * place + damping * rate
        body[i, 0] += cosine * added[i, 0] - sine * added[i, 1]
        body[i, 1] += sine * added[i, 0] + cosine * added[i, 1]
        rise = target.qpos[i, 2] - terms.base_position[i, 2]
        rate = target.qvel[i, 2] - state.qvel[i, 2]
        body[i, 2] = target.qacc[i, 2] + gains.height * rise + gains.height_damping * rate
        body[i, 2] += added[i, 2]
        to_base = transposed(matrix(terms.world_from_base, (i,)))
        left = turn(to_base, _turned_left(target, terms, i))
        spin = _target_spin(target, terms, i)
        for k in range(3):
            rate = spin[k] - state.qvel[i, 3 + k]
            body[i, 3 + k] = target.qacc[i, 3 + k] + gains.rotation * left[k]
            body[i, 3 + k] += gains.rotation_damping * rate + added[i, 3 + k]
        if len(command.push) > 0:
            for k in range(2, 6):
                body[i, k] = target.qacc[i, k]

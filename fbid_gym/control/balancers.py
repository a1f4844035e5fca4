"""Three ways from contact forces to joint torques, and what they leave out.

In the coordinates of [G15], with h the momentum and q the joints, the joints' equations (25) are

    Lambda_q qddot + (Gamma xi)_q = tau + Jbar_q^T lambda,

and A_q^T Lambda_h w of the contacts' wrench w is the part of Jbar_q^T lambda that goes by way of
the base: -Jbar_q^T lambda = -J_q^T lambda + A_q^T Lambda_h w.

- Ott, Roa, Hirzinger 2011: tau = -Jcheck_q^T lambda, in coordinates of the centre of mass and the
  base's orientation. Against the next, A_lq^T Lambda_l (moment) is missing: the moment is taken to
  act on the base alone. [G15], section 5, "some terms of the model are neglected".
- [G15]: tau = -Jbar_q^T lambda, quasi-static: as if the joints did not accelerate.
- Full inverse dynamics: nothing is left out. The contacts stay where they are, which with the
  momentum's rate known is a condition on the joints alone,

      Jbar_q qddot = -Jdot v - Jbar_h (w - P h_base),

  with P and the base's bias force h_base as in `fbid_gym.dynamics.centroidal`: w - P h_base is
  hdot - Adot v, and gravity cancels.

While the contacts hold, the power of the quasi-static torques is that of the wrench on the velocity
of the centre of mass and, for the moment, on the base's angular velocity (Ott) or on the average
one, Lambda_l l ([G15]). On two heavy legs the average is a small part of the base's (a tenth for
the biped, a quarter for the humanoid), and so is the grip of [G15]'s moment on the base.

A desired posture is an acceleration of the joints, (N, n). All three follow it as far as it moves
neither the contacts nor the momentum: its part in the null space of Jbar_q, to which they add
Lambda_q times it. It changes no contact force. Where joints must depart from it, the change is the
least in the sum of qddot_j^2 / mobility_j: little mobility makes a joint follow its own command,
such as a swinging leg's, while the others make up for it.
"""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.arrays import Array, as_numpy, check_shape, from_numpy, on_host
from fbid_gym.control.torque_map import TorqueMap
from fbid_gym.small_matrices import (
    dot,
    factor,
    gram,
    multiply,
    solve_factored,
    times,
)

if TYPE_CHECKING:
    from fbid_gym.dynamics.centroidal import CentroidalTerms
    from fbid_gym.dynamics.contacts import ReducedContacts
    from fbid_gym.dynamics.terms import DynamicsTerms

# Relative to the mean squared singular value of Jbar_q. Near a straight knee the joints cannot move
# the contacts as they should, and this bounds what they do instead. At home it lets the contacts'
# acceleration be off by at most a hundredth.
RIDGE = 1e-4

OTT2011, GAROFALO2015, INVERSE_DYNAMICS = range(3)


def torque_map_ott2011(
    terms: "DynamicsTerms",
    body: "CentroidalTerms",
    contacts: "ReducedContacts",
    posture: Array | None = None,
    mobility: Array | None = None,
) -> TorqueMap:
    """Return tau = -Jcheck_q^T lambda of Ott, Roa, Hirzinger 2011, [G15] after eq. (37).

    Args:
        terms: of the robots. Torch tensors are computed on the host, in all three maps.
        body: `centroidal_terms` of the same.
        contacts: `reduced_contacts` of the same.
        posture: (N, n) rad/s^2, desired acceleration of the joints. Default: none.
        mobility: (N, n) positive, how readily each joint departs from it. Default: all alike.
    """
    return _torque_map(OTT2011, terms, body, contacts, posture, mobility)


def torque_map_garofalo2015(
    terms: "DynamicsTerms",
    body: "CentroidalTerms",
    contacts: "ReducedContacts",
    posture: Array | None = None,
    mobility: Array | None = None,
) -> TorqueMap:
    """Return tau = -Jbar_q^T lambda of [G15], after eq. (39).

    Args:
        terms: of the robots.
        body: `centroidal_terms` of the same.
        contacts: `reduced_contacts` of the same.
        posture: (N, n) rad/s^2, desired acceleration of the joints. Default: none.
        mobility: (N, n) positive, how readily each joint departs from it. Default: all alike.
    """
    return _torque_map(GAROFALO2015, terms, body, contacts, posture, mobility)


def torque_map_inverse_dynamics(
    terms: "DynamicsTerms",
    body: "CentroidalTerms",
    contacts: "ReducedContacts",
    posture: Array | None = None,
    mobility: Array | None = None,
) -> TorqueMap:
    """Return the torques of full inverse dynamics, see the module.

    With these torques and hard contacts the momentum changes by exactly the wrench that the contact
    forces deliver (and gravity), at any velocity.

    Args:
        terms: of the robots.
        body: `centroidal_terms` of the same.
        contacts: `reduced_contacts` of the same.
        posture: (N, n) rad/s^2, desired acceleration of the joints. Default: none.
        mobility: (N, n) positive, how readily each joint departs from it. Default: all alike.
    """
    return _torque_map(INVERSE_DYNAMICS, terms, body, contacts, posture, mobility)


def _torque_map(
    balancer: int,
    terms: "DynamicsTerms",
    body: "CentroidalTerms",
    contacts: "ReducedContacts",
    posture: Array | None,
    mobility: Array | None,
) -> TorqueMap:
    """One of the three."""
    count, joints = terms.bias.shape[0], terms.bias.shape[1] - 6
    for name, given in (("posture", posture), ("mobility", mobility)):
        if given is not None and given.shape != (count, joints):
            check_shape(name, given, (count, joints), "(N, n)")
    like: Array = terms.bias
    jacobian = contacts.jacobian
    if not isinstance(like, np.ndarray):
        terms, body, contacts = on_host(terms), on_host(body), on_host(contacts)
    offset, per_wrench = np.empty((count, joints)), np.empty((count, joints, 6))
    fill_torque_map(
        balancer,
        RIDGE,
        body.matrix,
        body.to_com,
        body.mass,
        body.inverse_inertia,
        body.wrench_map,
        terms.mass_matrix,
        terms.bias,
        contacts.jacobian,
        contacts.bias,
        _row(joints, 0.0) if posture is None else as_numpy(posture),
        _row(joints, 1.0) if mobility is None else as_numpy(mobility),
        offset,
        per_wrench,
    )
    if isinstance(like, np.ndarray):
        return TorqueMap(offset, jacobian, per_wrench)
    return TorqueMap(from_numpy(offset, like), jacobian, from_numpy(per_wrench, like))


@lru_cache(maxsize=256)
def _row(joints: int, value: float) -> np.ndarray:
    """The same number for all joints, in a row that stands for all robots: (1, n)."""
    return np.full((1, joints), value)


@kernel
def fill_torque_map(
    balancer: int,
    ridge: float,
    matrix: np.ndarray,
    to_com: np.ndarray,
    mass: np.ndarray,
    inverse_inertia: np.ndarray,
    wrench_map: np.ndarray,
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    contact_bias: np.ndarray,
    posture: np.ndarray,
    mobility: np.ndarray,
    offset: np.ndarray,
    per_wrench: np.ndarray,
) -> None:
    """Write offset and per_wrench of a `TorqueMap`, as one of the three balancers has them.

    Joint accelerations are affine in the wrench. The first column is what they are without one,
    and only inverse dynamics has six others. Columns are rows here.
    """
    count, rows, joints = jacobian.shape[0], jacobian.shape[1], offset.shape[1]
    dynamic = balancer == INVERSE_DYNAMICS
    columns = 7 if dynamic else 1
    of_momentum, momentum_part = np.empty((6, 6)), np.empty((rows, 6))
    joint_part, moving = np.empty((rows, joints)), np.empty((rows, joints))
    lower, base = np.empty((rows, rows)), np.empty(6)
    motion, acceleration = np.empty((columns, rows)), np.empty((columns, joints))
    full, force = np.empty((columns, 6 + joints)), np.empty((columns, 6 + joints))
    for robot in range(count):
        wanted = posture[min(robot, len(posture) - 1)]
        readiness = mobility[min(robot, len(mobility) - 1)]
        ours, lift, rate = matrix[robot], wrench_map[robot, 6:], motion[0]
        _base_of_momentum(to_com[robot], mass[robot], inverse_inertia[robot], of_momentum)
        _split_jacobian(jacobian[robot], of_momentum, ours, momentum_part, joint_part)

        # Least joint accelerations that move the contacts as they should.
        for i in range(rows):
            rate[i] = -dot(joint_part[i], wanted)
        if dynamic:
            times(to_com[robot], bias[robot, :6], base)
            for i in range(rows):
                rate[i] += dot(momentum_part[i], base) - contact_bias[robot, i]
                for k in range(6):
                    motion[1 + k, i] = -momentum_part[i, k]
        for i in range(rows):
            for j in range(joints):
                moving[i, j] = joint_part[i, j] * readiness[j]
        gram(moving, joint_part, 0.0, lower)
        trace = 0.0
        for i in range(rows):
            trace += lower[i, i]
        for i in range(rows):
            lower[i, i] += ridge / rows * trace + ridge**3
        factor(lower)
        for k in range(columns):
            solve_factored(lower, motion[k])
        multiply(motion, moving, acceleration)
        for j in range(joints):
            acceleration[0, j] += wanted[j]

        # Lambda_q times them: the force on the joints if the base makes room, so that the momentum
        # stays.
        for k in range(columns):
            _with_base(acceleration[k], of_momentum, ours, full[k])
        multiply(full, mass_matrix[robot], force)
        for j in range(joints):
            offset[robot, j] = force[0, 6 + j]
            for k in range(6):
                per_wrench[robot, j, k] = lift[j, k]
            if balancer == OTT2011:
                per_wrench[robot, j, 3:] = 0.0
            if dynamic:
                offset[robot, j] += bias[robot, 6 + j] - dot(lift[j], base)
                for k in range(6):
                    per_wrench[robot, j, k] += force[1 + k, 6 + j]


@compiled
def _base_of_momentum(
    to_com: np.ndarray, mass: float, inverse_inertia: np.ndarray, result: np.ndarray
) -> None:
    """P^T Lambda_h: the base's velocity at some momentum and joints that stand still: (6, 6)."""
    for i in range(6):
        for axis in range(3):
            result[i, axis] = to_com[axis, i] / mass
            total = 0.0
            for other in range(3):
                total += to_com[3 + other, i] * inverse_inertia[other, axis]
            result[i, 3 + axis] = total


@compiled
def _split_jacobian(
    jacobian: np.ndarray,
    of_momentum: np.ndarray,
    matrix: np.ndarray,
    momentum_part: np.ndarray,
    joint_part: np.ndarray,
) -> None:
    """Write Jbar_h (k, 6) and Jbar_q (k, n)."""
    for i in range(len(jacobian)):
        for axis in range(6):
            total = 0.0
            for k in range(6):
                total += jacobian[i, k] * of_momentum[k, axis]
            momentum_part[i, axis] = total
        for j in range(joint_part.shape[1]):
            total = jacobian[i, 6 + j]
            for k in range(6):
                total -= momentum_part[i, k] * matrix[k, 6 + j]
            joint_part[i, j] = total


@compiled
def _with_base(
    acceleration: np.ndarray, of_momentum: np.ndarray, matrix: np.ndarray, full: np.ndarray
) -> None:
    """Write joint accelerations (n,), and before them those of a base that keeps the momentum."""
    full[:6] = 0.0
    full[6:] = acceleration
    for k in range(6):
        change = dot(matrix[k, 6:], acceleration)
        for i in range(6):
            full[i] -= of_momentum[i, k] * change

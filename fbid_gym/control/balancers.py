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

from functools import partial

import numpy as np

from fbid_gym.checks import positive_numbers
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.equations import checked_equations, fitted, fitted_all
from fbid_gym.quantities import (
    CentroidalTerms,
    Constraint,
    DynamicsTerms,
    EquationOfMotion,
    PostureCommand,
    ReducedContacts,
    TorqueMap,
)
from fbid_gym.small_matrices import copy, dot, factor, gram, multiply, solve_factored, times

# Relative to the mean squared singular value of Jbar_q. Near a straight knee the joints cannot move
# the contacts as they should, and this bounds what they do instead. At home it lets the contacts'
# acceleration be off by at most a hundredth.
RIDGE = 1e-4

OTT2011, GAROFALO2015, INVERSE_DYNAMICS = range(3)


def torque_map(
    balancer: int,
    terms: DynamicsTerms,
    body: CentroidalTerms,
    contacts: ReducedContacts,
    posture: np.ndarray | None = None,
    mobility: np.ndarray | None = None,
) -> TorqueMap:
    """Return the torques of a balancer, see the module.

    Args:
        balancer: `OTT2011`, `GAROFALO2015` or `INVERSE_DYNAMICS`; those below have it filled in.
        terms: of the robots.
        body: `centroidal_terms` of the same.
        contacts: `reduced_contacts` of the same.
        posture: (N, n) rad/s^2, desired acceleration of the joints. Default: none.
        mobility: (N, n) positive, how readily each joint departs from it. Default: all alike.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `mobility` is not positive and finite.
    """
    motion, constraint, sizes = checked_equations(
        terms.mass_matrix, terms.bias, contacts.jacobian, contacts.bias, "contacts.bias"
    )
    of_body = ("(N, 6, nv)", "(N, 6)", "(N,)", "(N, 3, 3)", "(N, 3, 3)", "(N, 6, 6)", "(N, nv, 6)")
    own_body = fitted_all("body.", body, of_body, sizes)
    wanted = fitted("posture", posture, "(N, n)", sizes, np.zeros((1, sizes["n"])))
    readiness = fitted("mobility", mobility, "(N, n)", sizes, np.ones((1, sizes["n"])))
    positive_numbers("mobility", readiness.ravel(), readiness.size)
    command = PostureCommand(wanted, readiness)
    return map_torques(balancer, motion, own_body, constraint, command, RIDGE)


torque_map_ott2011 = partial(torque_map, OTT2011)
"""tau = -Jcheck_q^T lambda of Ott, Roa, Hirzinger 2011, [G15] after eq. (37)."""

torque_map_garofalo2015 = partial(torque_map, GAROFALO2015)
"""tau = -Jbar_q^T lambda of [G15], after eq. (39)."""

torque_map_inverse_dynamics = partial(torque_map, INVERSE_DYNAMICS)
"""Full inverse dynamics. With these torques and hard contacts the momentum changes by the wrench
that the contact forces deliver (and gravity), at any velocity; but for what `RIDGE` costs, at
postures 0.1 rad from home up to 5e-4 of the weight (go1) or 2e-2 (biped)."""


@kernel
def map_torques(
    balancer: int,
    motion: EquationOfMotion,
    body: CentroidalTerms,
    constraint: Constraint,
    posture: PostureCommand,
    ridge: float,
) -> TorqueMap:
    """Return the torques as a function of contact forces, as one of the three balancers has them.

    Joint accelerations are affine in the wrench. The first column is what they are without one,
    and only inverse dynamics has six others. Columns are rows here.
    """
    jacobian, bias = constraint.jacobian, motion.bias
    count, rows, joints = jacobian.shape[0], jacobian.shape[1], jacobian.shape[2] - 6
    offset, per_wrench = np.empty((count, joints)), np.empty((count, joints, 6))
    dynamic = balancer == INVERSE_DYNAMICS
    columns = 7 if dynamic else 1
    of_momentum, momentum_part = np.empty((6, 6)), np.empty((rows, 6))
    joint_part, moving = np.empty((rows, joints)), np.empty((rows, joints))
    lower, base = np.empty((rows, rows)), np.empty(6)
    moved, acceleration = np.empty((columns, rows)), np.empty((columns, joints))
    full, force = np.empty((columns, 6 + joints)), np.empty((columns, 6 + joints))
    for robot in range(count):
        wanted = posture.acceleration[min(robot, len(posture.acceleration) - 1)]
        readiness = posture.mobility[min(robot, len(posture.mobility) - 1)]
        to_com, ours, lift = body.to_com[robot], body.matrix[robot], body.wrench_map[robot, 6:]
        rate = moved[0]
        _base_of_momentum(to_com, body.mass[robot], body.inverse_inertia[robot], of_momentum)
        _split_jacobian(jacobian[robot], of_momentum, ours, momentum_part, joint_part)

        # Least joint accelerations that move the contacts as they should.
        for i in range(rows):
            rate[i] = -dot(joint_part[i], wanted)
        if dynamic:
            times(to_com, bias[robot, :6], base)
            for i in range(rows):
                rate[i] += dot(momentum_part[i], base) - constraint.bias[robot, i]
                for k in range(6):
                    moved[1 + k, i] = -momentum_part[i, k]
        for i in range(rows):
            for j in range(joints):
                moving[i, j] = joint_part[i, j] * readiness[j]
        gram(moving, joint_part, 0.0, lower)
        trace = 0.0
        for i in range(rows):
            trace += lower[i, i]
        for i in range(rows):
            # Without a trace, as in flight, there is nothing to solve for.
            lower[i, i] += ridge / rows * trace if trace > 0.0 else 1.0
        factor(lower)
        for k in range(columns):
            solve_factored(lower, moved[k])
        multiply(moved, moving, acceleration)
        for j in range(joints):
            acceleration[0, j] += wanted[j]

        # Lambda_q times them: the force on the joints if the base makes room, so that the momentum
        # stays.
        for k in range(columns):
            _with_base(acceleration[k], of_momentum, ours, full[k])
        multiply(full, motion.mass_matrix[robot], force)
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
    return TorqueMap(offset, jacobian, per_wrench)


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
    copy(acceleration, full[6:])
    for k in range(6):
        change = dot(matrix[k, 6:], acceleration)
        for i in range(6):
            full[i] -= of_momentum[i, k] * change

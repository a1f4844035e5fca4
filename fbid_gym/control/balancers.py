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

from typing import TYPE_CHECKING, NamedTuple

from fbid_gym.control.arrays import Array, identity, matvec, namespace
from fbid_gym.control.wrench_distribution import TorqueMap

if TYPE_CHECKING:
    from fbid_gym.dynamics.centroidal import CentroidalTerms
    from fbid_gym.dynamics.contacts import ReducedContacts
    from fbid_gym.dynamics.terms import DynamicsTerms

# Relative to the mean squared singular value of Jbar_q. Near a straight knee the joints cannot move
# the contacts as they should, and this bounds what they do instead. At home it lets the contacts'
# acceleration be off by at most a hundredth.
_RIDGE = 1e-4


class _Joints(NamedTuple):
    """What the balancers know of the joints' dynamics."""

    lift: Array  # (N, n, 6) A_q^T Lambda_h
    momentum_part: Array  # (N, k, 6) Jbar_h
    joint_part: Array  # (N, k, n) Jbar_q
    mobility: Array | None  # (N, n)

    @classmethod
    def of(cls, body: "CentroidalTerms", jacobian: Array, mobility: Array | None) -> "_Joints":
        """From the centroidal terms and the Jacobian of the contacts."""
        matrix = body.matrix[:, :, 6:]
        lift = body.wrench_map[:, 6:]
        base = jacobian[:, :, :6] @ body.to_com.mT
        xp = namespace(base)
        momentum_part = xp.concat(
            (base[:, :, :3] / body.mass[:, None, None], base[:, :, 3:] @ body.inverse_inertia),
            axis=-1,
        )
        joint_part = jacobian[:, :, 6:] - momentum_part @ matrix
        return cls(lift, momentum_part, joint_part, mobility)

    def least_motion(self, motion: Array) -> Array:
        """Least joint accelerations (N, n, m) that move the contacts by `motion` (N, k, m)."""
        xp = namespace(motion)
        part = self.joint_part
        moving = part if self.mobility is None else part * self.mobility[:, None]
        gram, rows = moving @ part.mT, part.shape[1]
        if rows == 0:
            return part.mT @ motion
        flat = gram.reshape(gram.shape[0], rows * rows)
        ridge = (_RIDGE / rows) * xp.sum(flat[:, :: rows + 1], axis=-1) + _RIDGE**3
        gram = gram + ridge[:, None, None] * identity(rows, gram)
        return moving.mT @ xp.linalg.solve(gram, motion)


def torque_map_ott2011(
    terms: "DynamicsTerms",
    body: "CentroidalTerms",
    contacts: "ReducedContacts",
    posture: Array | None = None,
    mobility: Array | None = None,
) -> TorqueMap:
    """Return tau = -Jcheck_q^T lambda of Ott, Roa, Hirzinger 2011, [G15] after eq. (37).

    Args:
        terms: of the robots.
        body: `centroidal_terms` of the same.
        contacts: `reduced_contacts` of the same.
        posture: (N, n) rad/s^2, desired acceleration of the joints. Default: none.
        mobility: (N, n) positive, how readily each joint departs from it. Default: all alike.
    """
    joints = _Joints.of(body, contacts.jacobian, mobility)
    per_wrench = namespace(joints.lift).zeros_like(joints.lift)
    per_wrench[:, :, :3] = joints.lift[:, :, :3]
    return TorqueMap(_posture(joints, terms, body, posture), contacts.jacobian, per_wrench)


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
    joints = _Joints.of(body, contacts.jacobian, mobility)
    return TorqueMap(_posture(joints, terms, body, posture), contacts.jacobian, joints.lift)


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
    joints = _Joints.of(body, contacts.jacobian, mobility)
    acceleration, per_wrench = _joint_acceleration(joints, terms, body, contacts, posture)
    lift, matrix = joints.lift, body.matrix[:, :, 6:]
    inertia = terms.mass_matrix[:, 6:, 6:]
    base = matvec(body.to_com, terms.bias[:, :6]) + matvec(matrix, acceleration)
    offset = matvec(inertia, acceleration) + terms.bias[:, 6:] - matvec(lift, base)
    response = inertia @ per_wrench - lift @ (matrix @ per_wrench)
    return TorqueMap(offset, contacts.jacobian, lift + response)


def _joint_acceleration(
    joints: _Joints,
    terms: "DynamicsTerms",
    body: "CentroidalTerms",
    contacts: "ReducedContacts",
    posture: Array | None,
) -> tuple[Array, Array]:
    """Joint accelerations that keep the contacts, (N, n), and what a wrench adds, (N, n, 6)."""
    xp = namespace(terms.bias)
    base = matvec(body.to_com, terms.bias[:, :6])
    motion = matvec(joints.momentum_part, base) - contacts.bias
    if posture is not None:
        motion = motion - matvec(joints.joint_part, posture)
    both = xp.concat((motion[..., None], -joints.momentum_part), axis=-1)
    solution = joints.least_motion(both)
    acceleration = solution[..., 0]
    return (acceleration if posture is None else acceleration + posture), solution[..., 1:]


def _posture(
    joints: _Joints, terms: "DynamicsTerms", body: "CentroidalTerms", posture: Array | None
) -> Array:
    """Torques (N, n) of a posture's part that moves neither contacts nor momentum."""
    if posture is None:
        return namespace(terms.bias).zeros_like(terms.bias[:, 6:])
    moved = matvec(joints.joint_part, posture)
    free = posture - joints.least_motion(moved[..., None])[..., 0]
    through_base = matvec(joints.lift, matvec(body.matrix[:, :, 6:], free))
    return matvec(terms.mass_matrix[:, 6:, 6:], free) - through_base

"""Joint torques as a function of contact forces: what a balancer makes, and forces are put into."""

from typing import NamedTuple

from fbid_gym.control.arrays import Array, matvec


class TorqueMap(NamedTuple):
    """Joint torques as a function of contact forces: tau = offset - J_q^T lambda + W w.

    Attributes:
        offset: (N, n) N m.
        jacobian: (N, k, nv) of the contact rows, whose joint columns are J_q.
        per_wrench: (N, n, 6) W, of the wrench at the centre of mass.
    """

    offset: Array
    jacobian: Array
    per_wrench: Array

    def torque(self, row_force: Array, wrench: Array) -> Array:
        """Return torques (N, n) from lambda (N, k) and w (N, 6)."""
        contact = matvec(self.jacobian[:, :, 6:].mT, row_force)
        return self.offset - contact + matvec(self.per_wrench, wrench)

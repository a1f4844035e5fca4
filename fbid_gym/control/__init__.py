"""Control laws: pure functions from dynamics and a command to torques, on batches of arrays."""

from fbid_gym.control.contact_forces import ContactForces, ContactLimits, limited_contact_forces
from fbid_gym.control.inverse_dynamics import (
    InverseDynamics,
    LimitedInverseDynamics,
    limited_inverse_dynamics,
    orthogonal_inverse_dynamics,
)
from fbid_gym.control.pseudo_inverse import symmetric_pseudo_inverse

__all__ = [
    "ContactForces",
    "ContactLimits",
    "InverseDynamics",
    "LimitedInverseDynamics",
    "limited_contact_forces",
    "limited_inverse_dynamics",
    "orthogonal_inverse_dynamics",
    "symmetric_pseudo_inverse",
]

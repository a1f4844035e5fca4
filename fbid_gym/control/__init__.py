"""Control laws: pure functions from dynamics and a command to torques, on batches of arrays."""

from fbid_gym.control.balance import (
    BalanceTarget,
    desired_wrench_garofalo2015,
    desired_wrench_ott2011,
    resting_target,
)
from fbid_gym.control.balance_gains import BalanceGains
from fbid_gym.control.balancers import (
    torque_map_garofalo2015,
    torque_map_inverse_dynamics,
    torque_map_ott2011,
)
from fbid_gym.control.contact_forces import ContactLimits
from fbid_gym.control.inverse_dynamics import InverseDynamics, orthogonal_inverse_dynamics
from fbid_gym.control.limited_inverse_dynamics import (
    LimitedInverseDynamics,
    limited_inverse_dynamics,
)
from fbid_gym.control.operational_space import (
    TaskMotion,
    operational_space_acceleration,
    task_acceleration,
)
from fbid_gym.control.wrench_distribution import (
    Distribution,
    distribute,
    distribute_freely,
    underactuation,
)
from fbid_gym.quantities import Accuracy, TorqueMap

__all__ = [
    "Accuracy",
    "BalanceGains",
    "BalanceTarget",
    "ContactLimits",
    "Distribution",
    "InverseDynamics",
    "LimitedInverseDynamics",
    "TaskMotion",
    "TorqueMap",
    "desired_wrench_garofalo2015",
    "desired_wrench_ott2011",
    "distribute",
    "distribute_freely",
    "limited_inverse_dynamics",
    "operational_space_acceleration",
    "orthogonal_inverse_dynamics",
    "resting_target",
    "task_acceleration",
    "torque_map_garofalo2015",
    "torque_map_inverse_dynamics",
    "torque_map_ott2011",
    "underactuation",
]

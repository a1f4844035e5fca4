"""The laws that stand on their own, each called once: what `compile_all` has to keep of them."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fbid_gym import control
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import CentroidalTerms, DynamicsTerms, ReducedContacts
from fbid_gym.robots import load

_Array = np.ndarray
_ROBOT = "quadruped"
_LIMITS = control.ContactLimits(0.6)


class _Standing(NamedTuple):
    """A robot at home, at rest; which one makes no difference to what is compiled."""

    terms: DynamicsTerms
    body: CentroidalTerms
    contacts: ReducedContacts
    velocity: np.ndarray  # (1, nv)

    @property
    def equations(self) -> tuple[_Array, _Array, _Array, _Array, _Array]:
        """What inverse dynamics begin with."""
        contacts, terms = self.contacts, self.terms
        rest = np.zeros_like(self.velocity)
        return terms.mass_matrix, terms.bias, contacts.jacobian, rest, contacts.bias

    @property
    def wrench(self) -> np.ndarray:
        """(1, 6) that holds the robot, N and N·m."""
        return np.array([[0.0, 0.0, self.weight[0], 0.0, 0.0, 0.0]])

    @property
    def weight(self) -> np.ndarray:
        """(1,) N."""
        return np.array([load(_ROBOT).weight])

    @property
    def distributed(self) -> dict[str, Any]:
        """What distributions of a wrench take beside it."""
        return {
            "to_com": self.body.to_com,
            "point_map": self.contacts.point_map,
            "weight": self.weight,
        }


@lru_cache(maxsize=1)
def _standing() -> _Standing:
    robot = load(_ROBOT)
    stance, velocity = Stance.of(robot), np.zeros((1, robot.nv))
    contacts = reduced_contacts(stance.geometry, stance.terms)
    body = centroidal_terms(stance.terms, velocity)
    return _Standing(stance.terms, body, contacts, velocity)


def _task(robot: _Standing) -> Any:
    _, _, jacobian, rest, bias = robot.equations
    task = np.broadcast_to(np.eye(rest.shape[1])[:2], (1, 2, rest.shape[1])).copy()
    return control.operational_space_acceleration(jacobian, bias, task, None, np.zeros((1, 2)))


def _map(robot: _Standing) -> control.TorqueMap:
    return control.torque_map_garofalo2015(robot.terms, robot.body, robot.contacts)


def _shared(robot: _Standing) -> Any:
    limit = np.full((1, robot.velocity.shape[1] - 6), np.inf)
    return control.distribute(
        _map(robot), robot.wrench, _LIMITS, torque_limit=limit, **robot.distributed
    )


def _at_points(robot: _Standing) -> Any:
    points = robot.contacts.point_map.shape[2] // 3
    wrench_map = np.zeros((1, 6, 3 * points))
    wrench_map[0, :3] = np.tile(np.eye(3), points)
    return control.limited_contact_forces(wrench_map, robot.wrench, _LIMITS, weight=robot.weight)


def _steered(robot: _Standing) -> Any:
    body, rotation = robot.body, robot.terms.world_from_base
    inertia = float(body.mass[0]), body.inertia[0]
    gains = control.BalanceGains.from_frequencies(*inertia, linear=0.5, rotation=0.5)
    return control.desired_wrench_garofalo2015(
        gains,
        control.resting_target(robot.terms.com, rotation),
        com=robot.terms.com,
        rotation=rotation,
        momentum=body.momentum,
        mass=body.mass,
    )


LAWS: dict[str, Callable[[_Standing], Any]] = {
    "limited_inverse_dynamics": lambda robot: control.limited_inverse_dynamics(
        *robot.equations, _LIMITS
    ),
    "distribute": _shared,
    "distribute_freely": lambda robot: control.distribute_freely(
        _map(robot), robot.wrench, **robot.distributed
    ),
    "orthogonal_inverse_dynamics": lambda robot: control.orthogonal_inverse_dynamics(
        *robot.equations
    ),
    "operational_space_acceleration": _task,
    "limited_contact_forces": _at_points,
    "desired_wrench_garofalo2015": _steered,
    "underactuation": lambda robot: control.underactuation(robot.contacts.jacobian),
    "symmetric_pseudo_inverse": lambda robot: control.symmetric_pseudo_inverse(
        robot.terms.mass_matrix
    ),
}
"""By name, what takes longest to compile first."""


def call(name: str) -> Any:
    """Return what a law says of a robot that stands."""
    return LAWS[name](_standing())

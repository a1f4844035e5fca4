"""The three balancers of the experiments, alike in everything but the laws themselves."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from eval.papers.garofalo2015.bout import Goal
from eval.papers.trial import Memory
from fbid_gym.control import (
    BalanceGains,
    ContactLimits,
    TorqueMap,
    desired_wrench_garofalo2015,
    desired_wrench_ott2011,
    distribute,
    torque_map_garofalo2015,
    torque_map_inverse_dynamics,
    torque_map_ott2011,
)
from fbid_gym.dynamics import DynamicsTerms, centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import RobotState
from fbid_gym.robots import Robot

TABLE_1 = BalanceGains(
    stiffness=(6000.0, 2000.0, 4000.0),
    damping=(7.0, 1.0, 0.05),
    rotation_stiffness=(500.0, 400.0, 100.0),
    rotation_damping=(20.0, 20.0, 2.0),
)
"""Gains of [G15], table 1, for TORO, with (38). Its damping is printed in N s/(kg m): it multiplies
momentum, and the unit is 1/s."""

OTT, GAROFALO, INVERSE = "Ott 2011", "Garofalo 2015", "inverse dynamics"
ON_VELOCITY, ON_MOMENTUM = "(36)", "(38)"
COLOUR = {OTT: 1, GAROFALO: 0, INVERSE: 2}
_TORQUE_MAP: dict[str, Callable[..., TorqueMap]] = {
    OTT: torque_map_ott2011,
    GAROFALO: torque_map_garofalo2015,
    INVERSE: torque_map_inverse_dynamics,
}
_LIMITS = ContactLimits(friction=0.7)


class BalancerCommand(NamedTuple):
    """Desired and resulting quantities of a balancer on one tick."""

    torque: np.ndarray  # (N, n) N·m; applied within the limits
    desired: np.ndarray  # (N, 6) N and N·m, wrench at the centre of mass


class Balancer:
    """A law for the wrench with a map to the torques."""

    def __init__(
        self,
        robot: Robot,
        torque_map: str,
        wrench: str | None = None,
        posture_hertz: float = 1.5,
        compensate_damping: bool = False,
    ) -> None:
        """Measure the robot.

        Args:
            robot: that it believes to control.
            torque_map: which map from contact forces to joint torques, by its balancer's name.
            wrench: which law, "(36)" or "(38)" of [G15]; None for the balancer's own. (38) has the
                gains of [G15]'s table 1, (36) those that damp a rigid body alike.
            posture_hertz: Hz, of the joints' return to the posture where neither contacts nor
                momentum are moved by it.
            compensate_damping: add what the joints' viscous damping takes away.
        """
        self.robot, self.torque_map = robot, _TORQUE_MAP[torque_map]
        self.wrench = wrench or (ON_VELOCITY if torque_map == OTT else ON_MOMENTUM)
        self.posture_rate = 2.0 * np.pi * posture_hertz
        self.compensated = robot.joint_damping * compensate_damping
        self.geometry, self.length = contact_geometry(robot), Stance.of(robot).radius
        self.on_velocity = TABLE_1.on_velocity(robot.mass, stance_rotation_inertia(robot))

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        return {"warm_start": np.zeros((num_robots, 6))}

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, goal: Goal, memory: Memory
    ) -> BalancerCommand:
        """Return the torques for one control tick."""
        robot, rate = self.robot, state.qvel[:, 6:]
        body = centroidal_terms(terms, state.qvel)
        contacts = reduced_contacts(self.geometry, terms)
        omega = self.posture_rate
        posture = omega**2 * (goal.posture - state.qpos[:, 7:]) - 2.0 * omega * rate
        torque_map = self.torque_map(terms, body, contacts, posture)
        torque_map = torque_map._replace(offset=torque_map.offset + self.compensated * rate)
        placed: dict[str, Any] = {"com": terms.com, "rotation": terms.world_from_base}
        if self.wrench == ON_MOMENTUM:
            placed |= {"momentum": body.momentum, "mass": body.mass}
            wrench = desired_wrench_garofalo2015(TABLE_1, goal.target, **placed)
        else:
            spin = np.matvec(terms.world_from_base, state.qvel[:, 3:6])
            placed |= {"com_velocity": terms.com_velocity, "angular_velocity": spin}
            wrench = desired_wrench_ott2011(self.on_velocity, goal.target, mass=body.mass, **placed)
        found = distribute(
            torque_map,
            wrench,
            _LIMITS,
            to_com=body.to_com,
            point_map=contacts.point_map,
            weight=robot.weight,
            torque_limit=robot.torque_limit,
            contact_rotation=goal.contact_rotation,
            length=self.length,
            warm_start=memory["warm_start"],
        )
        memory["warm_start"] = found.warm_start
        return BalancerCommand(found.torque, found.wrench_desired)


def stance_angular_momentum(robot: Robot) -> np.ndarray:
    """Return the angular momentum that goes with a motion of centre of mass and hip at home.

    While the feet stay where they are and the joints that no foot hangs from keep still.

    Returns:
        (3, 6) kg m^2/s about the centre of mass per m/s of the centre of mass and rad/s of the
        base, world axes.
    """
    terms = Stance.of(robot).terms
    body = centroidal_terms(terms, np.zeros((1, robot.nv)))
    contacts = reduced_contacts(contact_geometry(robot), terms)
    spin = np.zeros((3, robot.nv))
    spin[:, 3:6] = terms.world_from_base[0]
    given = np.concatenate([contacts.jacobian[0], body.matrix[0, :3] / robot.mass, spin])
    asked = np.zeros((len(given), 6))
    asked[-6:] = np.eye(6)
    moving = np.abs(terms.foot_jacobian[0]).max(axis=(0, 1)) > 0.0
    motion = np.linalg.lstsq(given[:, moving], asked, rcond=None)[0]
    return np.asarray(body.matrix[0, 3:, moving].T @ motion)


def stance_rotation_inertia(robot: Robot) -> np.ndarray:
    """Return the angular momentum per angular velocity of the base at home: (3, 3) kg m^2.

    The symmetric part of `stance_angular_momentum`'s.
    """
    inertia = stance_angular_momentum(robot)[:, 3:]
    return 0.5 * (inertia + inertia.T)

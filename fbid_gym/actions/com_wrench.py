"""Layer `com_wrench`: the balancer of [G15], to whose desired wrench the action adds."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from fbid_gym.actions.balance_law import BalanceLaw, PostureGains, desired_wrench
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.falling import Falling, in_hertz
from fbid_gym.actions.law_memory import DIAGNOSTICS
from fbid_gym.actions.ranges import DampingRatio, Frequency, Priority
from fbid_gym.actions.scaled_names import scaled_names
from fbid_gym.control import BalanceGains
from fbid_gym.control.balancers import GAROFALO2015, INVERSE_DYNAMICS, OTT2011
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.options import Choice, checked
from fbid_gym.quantities import CentroidalTerms, DynamicsTerms, Memory, Reference, RobotState
from fbid_gym.robots import Robot

BALANCERS = {
    "garofalo2015": GAROFALO2015,
    "ott2011": OTT2011,
    "inverse_dynamics": INVERSE_DYNAMICS,
}
"""Name of a balancer -> what it is in `fbid_gym.control.balancers`."""

_VERTICAL_SCALE = 0.5  # of the weight
_LEAST_INERTIA = 0.05  # of the locked robot's: below it the base turns too easily to tell


@dataclass(frozen=True, eq=False)
class ComWrench:
    """The contacts push the centre of mass and the base back to their reference, plus the action.

    The desired wrench at the centre of mass is that of [G15] eqs. (38), (39) (for "ott2011" that of
    (36)): weight, springs on the position of the centre of mass and on the base's orientation,
    damping of the linear and angular momentum, the reference's rate of momentum, and scale *
    action, along the axes of the support frame (x the feet's forward direction, z up). The
    reference's momentum is that of the robot as it stands moving at the reference's velocities.
    The contact forces that come nearest to that wrench within their limits and the torque limits
    then become joint torques by the map of the balancer.

    The joints follow the reference as far as neither contacts nor momentum object. Legs whose foot
    is not taken to be on the ground swing: their joints follow the reference with the gains of
    `swing_frequency` and the inertia of the leg, and the other joints make up for it.

    The scale of the action is what the contacts can do: horizontally the force that moves the
    centre of pressure from below the centre of mass to the nearest edge of the support polygon,
    weight * margin / height, but no more than friction allows; vertically half of the weight; for
    tilting the moment of the same shift, weight * margin, for turning that of friction.

    Attributes:
        law: from action to torque.
        stance: the home stance.
        gains: of the wrench.
    """

    law: BalanceLaw
    stance: Stance
    gains: BalanceGains

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        balancer: Annotated[str, Choice(BALANCERS)] = "garofalo2015",
        balance_frequency: Frequency = Falling(1.2),
        height_frequency: Frequency = Falling(2.0),
        rotation_frequency: Frequency = Falling(2.0),
        posture_frequency: Frequency = Falling(1.7),
        swing_frequency: Frequency = Falling(6.8),
        damping_ratio: DampingRatio = 1.5,
        moment_priority: Priority = 1.0,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "ComWrench":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            balancer: "garofalo2015", [G15]; "ott2011", its predecessor; or "inverse_dynamics", the
                wrench of [G15] through full inverse dynamics, which neglects no velocity and no
                acceleration of the joints.
            balance_frequency: Hz, of the centre of mass's horizontal return.
            height_frequency: Hz, of its vertical return.
            rotation_frequency: Hz, of the base's orientation.
            posture_frequency: Hz, of joints whose foot stands, and of those without foot.
            swing_frequency: Hz, of the joints of a leg that swings.
            damping_ratio: zeta, of all five.
            moment_priority: weight of squared errors of the moment (per weight and mean distance of
                the contact points) beside one for the force (per weight), where the contacts cannot
                deliver both.
            contact: what it assumes of contacts.
        """
        frequencies = in_hertz(
            robot,
            balance_frequency=balance_frequency,
            height_frequency=height_frequency,
            rotation_frequency=rotation_frequency,
            posture_frequency=posture_frequency,
            swing_frequency=swing_frequency,
        )
        balance, height, rotation, posture, swing = map(float, frequencies.values())
        stance = Stance.of(robot)
        inertia = turning_inertia(robot, balancer)
        gains = BalanceGains.from_frequencies(
            robot.mass,
            inertia,
            linear=(balance, balance, height),
            rotation=rotation,
            damping_ratio=damping_ratio,
        )
        on_velocity = balancer == "ott2011"
        if on_velocity:
            gains = gains.on_velocity(robot.mass, inertia)
        # Derived along the trunk's axes, and meant along the base's.
        own = base_from_trunk(robot)
        gains = replace(gains, rotation_stiffness=own @ gains.rotation_stiffness @ own.T)
        on_errors = gains.of_velocity() if on_velocity else gains.of_momentum()
        on_joints = PostureGains.of(posture, swing, damping_ratio)
        return cls(
            law=BalanceLaw.of(
                robot,
                control_hz,
                contact,
                BALANCERS[balancer],
                (on_errors, on_joints),
                moment_priority,
                wrench_scale_of(robot, stance, contact.friction),
            ),
            stance=stance,
            gains=gains,
        )

    @property
    def scale(self) -> np.ndarray:
        """What action 1 adds to the wrench: (6,) N and N·m."""
        return self.law.constants.push

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six components of the wrench at the centre of mass."""
        names = [f"force {axis} at the centre of mass, support frame" for axis in "xyz"]
        names += [f"moment {axis} about the centre of mass, support frame" for axis in "xyz"]
        return scaled_names(names, self.scale, "N", "N·m")

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """The wrench's residual, and the directions in which contacts cannot push."""
        return DIAGNOSTICS

    def memory(self, num_robots: int) -> Memory:
        """See `ActionLayer.memory`."""
        return self.law.memory(num_robots)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        return self.law.torque(action, state, reference, terms(), memory)

    def wrench(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        body: CentroidalTerms,
    ) -> np.ndarray:
        """Return the desired wrench at the centre of mass: (N, 6) N and N·m, world."""
        return desired_wrench(
            self.law.constants.wrench,
            self.law.constants.gravity,
            self.scale * action,
            state,
            reference,
            terms,
            body,
            self.stance.frame(terms),
        )


def turning_inertia(robot: Robot, balancer: str) -> np.ndarray:
    """Return what a moment at the centre of mass must overcome to turn the base: (3, 3) kg·m².

    In the home stance, with the feet and the centre of mass in place and the joints moving as they
    do when the base turns with the least kinetic energy. Through full inverse dynamics it is the
    angular momentum per angular velocity of the base. The torques of Ott's balancer do the work of
    the moment on the base's angular velocity, so it is twice the kinetic energy per square of that.
    Those of [G15] do it on the average angular velocity, which takes the locked robot's inertia.

    Args:
        robot: the robot.
        balancer: one of `BALANCERS`.
    """
    stance = Stance.of(robot)
    terms, body = stance.terms, centroidal_terms(stance.terms, np.zeros((1, robot.nv)))
    locked = body.inertia[0]
    if balancer == "garofalo2015":
        return 0.5 * (locked + locked.T)
    contacts = reduced_contacts(stance.geometry, terms)
    # The metric of the kinetic energy turns least energy into least squares.
    root = np.linalg.inv(np.linalg.cholesky(terms.mass_matrix[0])).T
    held = np.concatenate([contacts.jacobian[0], body.matrix[0, :3]]) @ root
    turn = np.zeros((3, robot.nv))
    turn[:, 3:6] = terms.world_from_base[0]
    turn = turn @ root
    turn -= (turn @ np.linalg.pinv(held, rcond=1e-6)) @ held
    motion = root @ np.linalg.pinv(turn, rcond=1e-6)
    if balancer == "ott2011":
        inertia = motion.T @ terms.mass_matrix[0] @ motion
    else:
        inertia = body.matrix[0, 3:] @ motion
    values, vectors = np.linalg.eigh(0.5 * (inertia + inertia.T))
    least = _LEAST_INERTIA * np.linalg.eigvalsh(locked)[0]
    return (vectors * np.maximum(values, least)) @ vectors.T


def wrench_scale_of(robot: Robot, stance: Stance, friction: float) -> np.ndarray:
    """What action 1 means, see `ComWrench`: (6,) N and N·m."""
    margin = stance.margin
    pressed = np.minimum(margin / stance.home_com[2], friction)
    return robot.weight * np.concatenate(
        [pressed, [_VERTICAL_SCALE], margin[::-1], [friction * stance.radius]]
    )

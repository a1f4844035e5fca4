"""Joint PD controllers: gains from a response of the home stance, or those of a file's servos."""

from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_positive
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots import Robot

SERVO = "servo"
"""In place of a natural frequency: the gains of the file's servos."""


class JointGains(NamedTuple):
    """K_P = I (2 pi f)^2 and K_D = 2 zeta I (2 pi f), of every joint.

    I is the inertia that the joint moves while its foot stands (`Stance.standing_inertia`). K_D
    stays below the inertia that the joint moves in the air times the control rate, beyond which
    sampled damping itself oscillates.

    Attributes:
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad.
        natural_frequency: f, Hz; infinite for gains that come from elsewhere.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    natural_frequency: float

    @classmethod
    def of_servos(cls, robot: Robot, control_hz: int) -> "JointGains":
        """Take the gains of the file's servos.

        Raises:
            InvalidValueError: see `servo_fault`.
        """
        servos, fault = robot.servo_gains, servo_fault(robot, control_hz)
        if servos is None or fault:
            raise InvalidValueError("natural_frequency", SERVO, f"a number in Hz: {fault}")
        return cls(servos.stiffness.copy(), servos.damping.copy(), np.inf)

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        natural_frequency: float | None,
        damping_ratio: float,
        stiffer_than_falling: float,
    ) -> "JointGains":
        """Derive the gains.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            natural_frequency: f in Hz. None: `stiffer_than_falling` times that of the robot falling
                over, the pendulum frequency sqrt(g / height of the centre of mass) / (2 pi), or the
                largest that `control_hz` allows, if that is less.
            damping_ratio: zeta.
            stiffer_than_falling: see there.

        Raises:
            InvalidValueError: not positive, or so stiff that the sampled controller oscillates.
        """
        check_positive(damping_ratio=damping_ratio)
        most = steady_frequency(robot, control_hz, damping_ratio)
        if natural_frequency is None:
            pendulum = np.sqrt(robot.gravity / Stance.of(robot).home_com[2])
            natural_frequency = min(stiffer_than_falling * pendulum / (2.0 * np.pi), most)
        check_positive(natural_frequency=natural_frequency)
        if natural_frequency > most:
            raise InvalidValueError(
                "natural_frequency",
                natural_frequency,
                f"at most {most:.3g} Hz at {control_hz} control ticks per second: beyond, "
                f"{robot.name} oscillates in the air",
            )
        gains = _gains(robot, control_hz, natural_frequency, damping_ratio)
        return cls(*gains, float(natural_frequency))


def servo_fault(robot: Robot, control_hz: int) -> str:
    """Say why the gains of the file's servos do not serve; an empty string if they do.

    They do where they hold every joint and let every mode decay in the air, sampled, with the help
    of the joints' own damping.
    """
    servos = robot.servo_gains
    if servos is None or not np.all(servos.stiffness > 0.0):
        return f"{robot.name} came without position servos on all joints"
    damping = servos.damping + robot.joint_damping
    if sampled_growth(robot, servos.stiffness, damping, control_hz) >= 1.0:
        return f"sampled at {control_hz} Hz, the servos of {robot.name} oscillate in the air"
    return ""


def _gains(
    robot: Robot, control_hz: int, natural_frequency: float, damping_ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    stance, omega = Stance.of(robot), 2.0 * np.pi * natural_frequency
    damping = 2.0 * damping_ratio * omega * stance.standing_inertia
    return (
        stance.standing_inertia * omega**2,
        np.minimum(damping, stance.hanging_inertia * control_hz),
    )


def steady_frequency(robot: Robot, control_hz: int, damping_ratio: float) -> float:
    """Largest natural frequency (Hz) whose gains, sampled, let every mode decay in the air.

    Gains of the stance are high for what a joint moves in the air, the foot above all.
    """
    low, high = 0.0, float(control_hz)
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        gains = _gains(robot, control_hz, middle, damping_ratio)
        if sampled_growth(robot, *gains, control_hz) < 1.0:
            low = middle
        else:
            high = middle
    return low


def holding_torque(robot: Robot) -> np.ndarray:
    """Return the least joint torques that keep the home stance in equilibrium: (n,) N·m."""
    stance = Stance.of(robot)
    contacts = reduced_contacts(stance.geometry, stance.terms)
    rest = np.zeros((1, robot.nv))
    solution = orthogonal_inverse_dynamics(
        stance.terms.mass_matrix, stance.terms.bias, contacts.jacobian, rest, contacts.bias
    )
    return solution.torque[0]


def sampled_growth(
    robot: Robot, stiffness: np.ndarray, damping: np.ndarray, control_hz: int
) -> float:
    """Return how much a joint PD controller's motion grows from tick to tick, at worst.

    The robot hangs in the air in its home posture, and torques are held for a tick: the spectral
    radius of that linear system, below 1 if every mode decays.

    Args:
        robot: the robot.
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad.
        control_hz: control ticks per second.
    """
    mobility = np.linalg.inv(Stance.of(robot).terms.mass_matrix[0])[6:, 6:]
    tick, one = 1.0 / control_hz, np.eye(robot.num_joints)
    stiff, damp = mobility * stiffness, mobility * damping
    step = np.block(
        [
            [one - tick**2 / 2 * stiff, tick * one - tick**2 / 2 * damp],
            [-tick * stiff, one - tick * damp],
        ]
    )
    return float(np.abs(np.linalg.eigvals(step)).max())

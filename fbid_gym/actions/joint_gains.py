"""Gains of joint PD controllers, from the response that they shall give the home stance."""

from typing import NamedTuple

import numpy as np

from fbid_gym.actions.options import positive
from fbid_gym.actions.stance import own_inertia, sampled_growth, stance_inertia
from fbid_gym.dynamics.support import Support
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots import Robot


class JointGains(NamedTuple):
    """K_P = I (2 pi f)^2 and K_D = 2 zeta I (2 pi f), of every joint.

    I is the inertia that the joint moves while its foot stands (`stance_inertia`). K_D stays below
    the inertia that the joint moves in the air times the control rate, beyond which sampled damping
    itself oscillates.

    Attributes:
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad.
        natural_frequency: f, Hz.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    natural_frequency: float

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
        positive(damping_ratio=damping_ratio)
        most = _steady_frequency(robot, control_hz, damping_ratio)
        if natural_frequency is None:
            pendulum = np.sqrt(robot.weight / robot.mass / Support.of(robot).home_com[2])
            natural_frequency = min(stiffer_than_falling * pendulum / (2.0 * np.pi), most)
        positive(natural_frequency=natural_frequency)
        if natural_frequency > most:
            raise InvalidValueError(
                "natural_frequency",
                natural_frequency,
                f"at most {most:.3g} Hz at {control_hz} control ticks per second: beyond, "
                f"{robot.name} oscillates in the air",
            )
        return cls(*_gains(robot, control_hz, natural_frequency, damping_ratio), natural_frequency)


def _gains(
    robot: Robot, control_hz: int, natural_frequency: float, damping_ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    inertia, omega = stance_inertia(robot), 2.0 * np.pi * natural_frequency
    damping = 2.0 * damping_ratio * omega * inertia
    return inertia * omega**2, np.minimum(damping, own_inertia(robot) * control_hz)


def _steady_frequency(robot: Robot, control_hz: int, damping_ratio: float) -> float:
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

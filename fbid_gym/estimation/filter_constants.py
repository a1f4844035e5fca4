"""Constants of the filter, from a robot's sensors, size and weight."""

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.estimation.invariant_filter import Filter
from fbid_gym.estimation.legs import Mounting
from fbid_gym.estimation.sensors import Sensors
from fbid_gym.robots import Robot

# In units of the robot: of the height h of its centre of mass, the speed sqrt(g h), the pendulum
# time sqrt(h / g), gravity g. What sensors do not err by, a filter still has to allow for: a foot
# that creeps, a sole that tips, a tick that is not short enough.
_SLIPPING = 0.006  # of the speed, per sqrt(Hz)
_PLACING = 0.002  # of the height
_TURNING = 0.001  # of the rate, per sqrt(Hz)
_PUSHING = 0.004  # of gravity, per sqrt(Hz)
_START = 0.05  # of the speed
_TILT = 0.01  # rad
_FASTEST = 6.0  # of the speed
_VAGUEST = 0.6  # of the speed
_PATIENCE = 1.0  # pendulum times
_SETTLE = 1.0  # pendulum times
_CORRECTIONS, _SELDOM = 13.0, 0.0125  # in a pendulum time, at least, and s from one to the next
_LEANING = 0.1  # of gravity, by which a robot that walks accelerates, each way a pendulum time long
_GATE = 16.27  # 99.9 % of chi-square with three degrees of freedom


def filter_of(sensors: Sensors, robot: Robot, mounting: Mounting, hz: int) -> Filter:
    """Return the filter's constants for a robot at its control rate, Hz."""
    own, stance, tick = sensors.scaled, Stance.of(robot), 1.0 / hz
    height = float(stance.home_com[2])
    speed, time = np.sqrt(robot.gravity * height), np.sqrt(height / robot.gravity)
    every = max(1, int(hz * min(time / _CORRECTIONS, _SELDOM)))
    step = every * tick
    turning = np.hypot(own.gyroscope_noise, _TURNING / time)
    pushing = np.hypot(own.accelerometer_noise, _PUSHING * robot.gravity)
    # What lasts for a time has twice that as the density of its variance.
    leaning = _LEANING**2 * 2.0 * time
    tilt_variance = _TILT**2 + own.misalignment**2
    accelerometer_variance = own.accelerometer_bias**2
    accelerometer_variance += (own.accelerometer_scale * robot.gravity) ** 2
    if sensors.estimator == "linear":
        lasting = accelerometer_variance + robot.gravity**2 * tilt_variance
        pushing = np.hypot(pushing, np.sqrt(2.0 * time * lasting))
    return Filter(
        tick=tick,
        every=every,
        gravity=robot.gravity,
        turning=float(turning**2 * step),
        pushing=float(pushing**2 * step),
        gyroscope_drift=own.gyroscope_drift**2 * step,
        accelerometer_drift=own.accelerometer_drift**2 * step,
        slipping=float((_SLIPPING * speed) ** 2 * step),
        placing=(_PLACING * height) ** 2,
        encoder=own.encoder_noise**2 + own.encoder_resolution**2 / 12.0,
        threshold=own.contact_threshold * robot.weight,
        gate=_GATE,
        tilt_variance=tilt_variance,
        velocity_variance=float((_START * speed) ** 2),
        gyroscope_variance=own.gyroscope_bias**2,
        accelerometer_variance=accelerometer_variance,
        fastest=float(_FASTEST * speed),
        vaguest=float((_VAGUEST * speed) ** 2),
        patience=round(_PATIENCE * time / step),
        settle=float(min(tick / (_SETTLE * time), 1.0)),
        leaning=float(leaning / tick),
        mounting=mounting,
        foot_of_point=stance.geometry.foot_of_point,
        points=np.array([float(foot.num_points) for foot in robot.feet]),
    )
